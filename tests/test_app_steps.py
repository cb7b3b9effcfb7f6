"""What steps set by hand change of the values of a walk, from the motion of the last run: beside the run itself."""

from collections.abc import Iterator
from pathlib import Path
from shutil import copy

import pytest

from biodance.app.sessions import Archive, SessionPlace
from biodance.app.tasks import stride_rows
from biodance.batch.work import process_session
from biodance.errors import BiodanceError
from biodance.library import parse_json

TRIAL = "HC030A05"


@pytest.fixture(scope="module")
def place(data: Path, tmp_path_factory: pytest.TempPathFactory) -> SessionPlace:
    folder = tmp_path_factory.mktemp("steps")
    (folder / "archive" / "HC030A").mkdir(parents=True)
    for name in ("HC030A01", TRIAL):
        copy(data / "biomechzoo" / "HC030A" / f"{name}.c3d", folder / "archive" / "HC030A")
    archive = Archive(folder / "archive", folder / "results")
    process_session(archive["HC030A"].task())
    return archive["HC030A"]


@pytest.fixture
def told(place: SessionPlace) -> Iterator[Path]:
    yield place.folder / "session.toml"
    (place.folder / "session.toml").unlink(missing_ok=True)


def events(place: SessionPlace) -> list[dict]:
    document = parse_json((place.results / "results.json").read_text(encoding="utf-8"))
    (moved,) = [one for one in document["movement"]["trials"] if one["trial"] == TRIAL]
    return moved["events"]


def by_hand(some: list[dict]) -> str:
    rows = (
        f'{{side = "{e["side"]}", kind = "{"strike" if e["down"] else "off"}", time = {e["time_s"]}}}' for e in some
    )
    return f"[trials.{TRIAL}]\nevents = [{', '.join(rows)}]\n"


def values(place: SessionPlace) -> dict[tuple[str, str], dict]:
    rows = stride_rows(place.results, place.folder, TRIAL, TRIAL)
    return {(one["quantity"], one["side"]): one for one in rows}


def test_the_same_events_by_hand_give_what_the_run_gave(place, told):
    told.write_text(by_hand(events(place)), encoding="utf-8")
    found = values(place)
    assert {side for name, side in found if name == "cadence"} == {"left", "right"}
    for one in found.values():
        assert one["after"] == pytest.approx(one["before"], rel=1e-6), one


def test_a_strike_moved_by_a_tenth_of_a_second_changes_the_strides_by_it(place, told):
    some = [dict(one) for one in events(place)]
    side = "left"
    last = max((one for one in some if one["side"] == side and one["down"]), key=lambda one: one["time_s"])
    last["time_s"] -= 0.1
    told.write_text(by_hand([one for one in some if one["side"] == side]), encoding="utf-8")
    found = values(place)
    one, other = found["stride_time", side], found["stride_time", "right"]
    assert one["before"] - one["after"] == pytest.approx(0.1 / one["count"], abs=1e-6)
    assert other["after"] == pytest.approx(other["before"], rel=1e-6)


def test_a_trial_that_the_last_run_did_not_follow_is_refused(place):
    with pytest.raises(BiodanceError, match="gave no motion"):
        stride_rows(place.results, place.folder, "HC030A99", "HC030A99")

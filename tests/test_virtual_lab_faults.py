"""Hidden faults arrive in the files as they were asked for: read back through the lab's own door and compared with
the clean session.
"""

from pathlib import Path

import numpy as np
import pytest
from hidden_faults import about_centre, standing_recording

from biodance.errors import BiodanceError, UnknownName
from biodance.lab.read import read_trial
from biodance.records import Subject, Trial
from biodance.virtual_lab.faults.causes import Hidden, hide, parse_cause
from biodance.virtual_lab.movement.protocol import read_protocol
from biodance.virtual_lab.recording.laboratory import Laboratory, LabVisit
from biodance.virtual_lab.tolerances import instruments_perfect

SUBJECT = Subject(60.0, 1.70, "F", 30.0)
TRIAL = "standing_1"


def recorded(folder: Path, texts: tuple[str, ...], *, plate_type: int = 2) -> Trial:
    visit = LabVisit(laboratory=Laboratory(plate_type=plate_type), tolerances=instruments_perfect())
    return read_trial(standing_recording(folder, *texts, visit=visit))


@pytest.fixture(scope="module", params=[2, 4])
def clean(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Trial]:
    return request.param, recorded(tmp_path_factory.mktemp("clean") / "s", (), plate_type=request.param)


def test_channel_faults_have_the_size_asked_for(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    centre = before.plates[0].centre
    texts = (
        "plate_gain:target=Fz,gain=0.04",
        "plate_crosstalk:target=Fz->My,ratio=0.01",
        "plate_offset:target=Mx,offset=8",
    )
    after = recorded(tmp_path / "s", texts, plate_type=kind)
    x, y = (about_centre(one.plates[0], centre) for one in (before, after))
    tolerance = 0.2 if kind == 2 else 2.0  # TYPE 4 is stored in coarse volts
    np.testing.assert_allclose(y[:, 2], 1.04 * x[:, 2], atol=tolerance)
    np.testing.assert_allclose(y[:, 4], x[:, 4] + 0.01 * 1.04 * x[:, 2], atol=tolerance)
    np.testing.assert_allclose(y[:, 3], x[:, 3] + 8, atol=tolerance)


def test_forces_come_late(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    after = recorded(tmp_path / "s", ("time_delay:delay=0.02",), plate_type=kind)
    shift = round(0.02 * before.plates[0].wrench.rate)
    np.testing.assert_allclose(after.plates[0].wrench.value[shift:], before.plates[0].wrench.value[:-shift], atol=2.0)


def test_a_shifted_plate_shifts_the_centre_of_pressure(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    after = recorded(tmp_path / "s", ("plate_position:target=plate1:x,shift=0.02",), plate_type=kind)
    np.testing.assert_allclose(after.plates[0].centre - before.plates[0].centre, [0.02, 0, 0], atol=1e-6)
    moved = np.nanmedian(after.plates[0].wrench.cop() - before.plates[0].wrench.cop(), axis=0)
    np.testing.assert_allclose(moved[:2], [0.02, 0.0], atol=5e-4)


def test_a_turned_plate_turns_the_forces(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    after = recorded(tmp_path / "s", ("plate_rotation:target=plate1:z,angle=0.1",), plate_type=kind)
    c, s = np.cos(0.1), np.sin(0.1)
    turned = before.plates[0].wrench.force @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    np.testing.assert_allclose(after.plates[0].wrench.force, turned, atol=0.3)


def test_a_load_is_weighed_but_not_declared(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    after = recorded(tmp_path / "s", ("added_mass:target=left_forearm_hand,mass=2.4",), plate_type=kind)
    more = (after.plates[0].wrench.force[:, 2].mean() - before.plates[0].wrench.force[:, 2].mean()) / 9.80665
    assert more == pytest.approx(2.4, abs=0.02)
    assert after.measurements["Bodymass"] == before.measurements["Bodymass"]


def test_labels_are_exchanged_and_mass_is_underdeclared(clean: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = clean
    after = recorded(tmp_path / "s", ("labels_swapped:target=LKNE/RKNE", "body_mass:error=3"), plate_type=kind)
    np.testing.assert_allclose(np.nanmean(after.markers["LKNE"] - before.markers["RKNE"], axis=0), 0, atol=1e-4)
    assert after.measurements["Bodymass"] == pytest.approx(before.measurements["Bodymass"] - 3)


def test_words_are_read_and_wrong_ones_refused() -> None:
    assert parse_cause("added_mass:target=left_shank,mass=1,place=0;-0.1;0.05") == Hidden(
        "added_mass", "left_shank", {"mass": (1.0,), "place": (0.0, -0.1, 0.05)}
    )
    plan = read_protocol("standing")
    for text, match in (
        ("plate_gain:target=Fz,gian=0.1", "gain"),
        ("plate_gain:target=Fq,gain=0.1", "channel"),
        ("nothing", "Legal"),
    ):
        with pytest.raises((BiodanceError, UnknownName), match=match):
            hide((parse_cause(text),), SUBJECT, plan, seed=1)
    with pytest.raises(BiodanceError, match="not a number"):
        parse_cause("plate_gain:target=Fz,gain=much")

"""Visits side by side: a known change is told with sign and size, the same movement on another day is not; wrong input
is refused in a sentence.
"""

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from accessible import ASKED, complaints, unfold
from browser import Page
from scipy.stats import t as student

from biodance.cli import run
from biodance.cycles import TrialMovement
from biodance.cycles.curves import CycleCurve
from biodance.cycles.cut import PERCENT, Cycle
from biodance.cycles.strides import Stride
from biodance.cycles.summary import key_values, leading_foot, stride_values
from biodance.errors import SessionRefused
from biodance.pipeline import visits as pipeline
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.visits import (
    ExaminedVisit,
    Untested,
    VisitComparison,
    compare_visits,
    cycle_quantities,
    read_visits,
)
from biodance.records import Session, Subject
from biodance.report.visits import comparison_sentence, write_visits
from biodance.uncertainty.visits import KeyKind, beyond_chance, change_of_mean, placement_sd, visit_mean
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import LabVisit, perform_in

SPEED = 0.9
"""m/s at a stature of 1.75 m; in proportion to the root of the stature."""
PROTOCOL = """\
name = "walking"
description = "Standing, then walking on a split-belt treadmill."
belts = 2

[[trials]]
name = "static"
role = "static"
lead = 2.0

[[trials]]
name = "walk_1"
gait = "walk"
speed = {speed}
seconds = 10.0
"""


def simulated(out: Path, *, day: int, speed: float = SPEED, mass: float = 62.0, seed: int = 1) -> Path:
    """Write a visit in which the gait of the first day is walked: markers glued, cameras and plates set anew."""
    plan = out.with_suffix(".toml")
    plan.write_text(PROTOCOL.format(speed=speed))

    def performed(instruments, person, trial):
        return perform_in(replace(instruments, visit=replace(instruments.visit, number=0)), person, trial)

    subject = Subject(mass, 1.70, "F", 31.0)
    return simulate_session(subject, plan, out, seed=seed, visit=LabVisit(day), performed=performed)


@pytest.fixture(scope="module", autouse=True)
def _each_visit_is_examined_once() -> Iterator[None]:
    """Let every comparison of this file, the command's too, have what the first one found in a visit."""
    known: dict[tuple[Path, str], ExaminedVisit] = {}
    examined = pipeline._examined

    def once(session: Session, name: str, tell: Callable[[str], None]) -> ExaminedVisit:
        key = (session.folder, name)
        if key not in known:
            known[key] = examined(session, name, tell)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "_examined", once)
        yield


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One person: as she is, the same again, faster, 3 kg heavier."""
    folder = tmp_path_factory.mktemp("visits")
    made = {
        "first": {"day": 0},
        "same": {"day": 1},
        "faster": {"day": 2, "speed": 1.05},
        "heavier": {"day": 3, "mass": 65.0},
    }
    return {name: simulated(folder / name, **how) for name, how in made.items()}


@pytest.fixture(scope="module")
def compared(visits: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, VisitComparison]:
    return {
        name: compare_visits(read_visits([visits["first"], visits[name]])) for name in ("same", "faster", "heavier")
    }


def told(found: VisitComparison, name: str, side: str = "both"):
    return next(one for one in found.quantities if (one.name, one.side) == (name, side))


def test_the_same_movement_on_another_day_is_not_told_to_have_changed(compared) -> None:
    found = compared["same"]
    assert found.changed == ()
    assert found.tested > 150
    few = f"None of the {found.tested} quantities that could be tested ({len(found.quantities)} in all)"
    assert comparison_sentence(found) == f"{few} changed beyond its uncertainty."
    few = VisitComparison(found.visits, tuple(replace(one, p=None, change_ci95=None) for one in found.quantities[:5]))
    assert comparison_sentence(few).startswith("Nothing can be told to have changed")


def test_another_speed_is_told_with_sign_and_size(compared) -> None:
    found, true = compared["faster"], 0.15 * np.sqrt(1.70 / 1.75)
    speed = told(found, "speed")
    assert speed.changed
    low, high = speed.change_ci95
    assert low < true < high
    assert high - low < 0.05
    assert found.quantities[0].changed
    flags = [one.changed for one in found.quantities]
    assert flags == sorted(flags, reverse=True), "changed rows first"
    assert not told(found, "total_mass").changed


def test_three_kilograms_are_told_and_no_other_speed(compared) -> None:
    found = compared["heavier"]
    mass = told(found, "total_mass")
    assert mass.changed
    low, high = mass.change_ci95
    assert low < 3.0 < high
    assert not told(found, "speed").changed


def test_page_table_and_json_say_the_same(compared, tmp_path: Path) -> None:
    document = write_visits(compared["faster"], tmp_path)
    assert document == json.loads((tmp_path / "results.json").read_text())
    wanted = {"name", "side", "unit", "values", "ci95", "change", "change_ci95", "changed"}
    assert all(wanted <= set(row) for row in document["quantities"])
    assert all(len(row["values"]) == len(row["ci95"]) == 2 for row in document["quantities"])
    speed = next(row for row in document["quantities"] if row["name"] == "speed")
    assert speed["change"] == pytest.approx(speed["values"][1] - speed["values"][0])
    page = (tmp_path / "compare.html").read_text()
    assert document["text"] in page
    assert document["text"].startswith(f"{document['changed_count']} of {document['tested_count']} quantities changed")
    assert "Benjamini and Hochberg" in page
    assert "n = 8, 8" in page
    assert page.index(document["text"]) < page.index("Walking, right: angles") < page.index("<h2>What changed")
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    lines = (tmp_path / "quantities.csv").read_text().splitlines()
    assert len(lines) == 1 + len(document["quantities"])


@ASKED
def test_nobody_is_shut_out_of_the_page(compared, tmp_path: Path) -> None:
    write_visits(compared["faster"], tmp_path)
    with Page("about:blank#begin") as browser:
        unfold(browser, (tmp_path / "compare.html").as_uri())
        assert complaints(browser) == []


def test_the_command_writes_prints_and_refuses(visits, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, faster, out = visits["first"], visits["faster"], tmp_path / "out"
    assert run(["compare", str(first), str(faster), "--out", str(out), "--json"]) in (0, 1)
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "results.json").read_text())
    assert {"compare.html", "quantities.csv", "manifest.json"} <= {path.name for path in out.iterdir()}
    shorter = replaced_subject(first, tmp_path / "short", "height_m = 1.7", "height_m = 1.6")
    man = replaced_subject(first, tmp_path / "man", 'sex = "F"', 'sex = "M"')
    copy = Path(shutil.copytree(first, tmp_path / "copy"))
    wrong = {
        ("compare", first): "Give two or more visits",
        ("compare", first, first): "is given twice",
        ("compare", first, copy): "the same recording",
        ("compare", faster, shorter): "1.70 m and 1.60 m are declared",
        ("compare", faster, man): "female and male are declared",
    }
    for words, sentence in wrong.items():
        assert run([*map(str, words), "--out", str(tmp_path / "other")]) == 2
        assert sentence in capsys.readouterr().err
    assert run(["compare", str(first), str(faster), "--out", str(out)]) == 2
    assert "nothing is overwritten" in capsys.readouterr().err
    assert run(["compare", str(first), str(faster), "--out", str(out), "--force"]) in (0, 1)
    capsys.readouterr()
    assert run(["compare", str(first), str(faster), "--out", str(faster)]) == 2
    assert "results are never written beside them" in capsys.readouterr().err


def replaced_subject(visit: Path, place: Path, old: str, new: str) -> Path:
    """Copy a visit with another declaration."""
    shutil.copytree(visit, place)
    file = place / "session.toml"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    return place


CYCLES = [Cycle("walk", "gait", "right", 1.1 * k, 1.1 * (k + 1), 1.1 * k + 0.66) for k in range(40)]


def walked(rng: np.random.Generator, *, count: int, more: float = 0.0, name: str = "visit") -> SessionMovement:
    """Return a visit of ``count`` strides of one foot: knee flexion 60 deg sin(pi x)² + 5 deg, each stride with its own
    size and shift (sd 2 deg), and ``more`` deg of range.
    """
    curves, strides = [], []
    for cycle in CYCLES[:count]:
        shift, size = rng.normal(0, 2, 2)
        value = 5 + shift + (60 + more + size) * np.sin(np.pi * PERCENT / 100) ** 2
        nothing = np.full(PERCENT.size, np.nan)
        curves.append(CycleCurve(cycle, "knee_flexion", "right", "deg", value, nothing))
        strides.append(Stride(cycle, {"speed": float(rng.normal(1.2, 0.03)), "stance": 60 + float(rng.normal(0, 1))}))
    trial = TrialMovement("walk", (), tuple(CYCLES[:count]), tuple(curves), tuple(strides), (np.empty(0), np.empty(0)))
    return SessionMovement(name, (trial,), "table", 70.0, {})


def test_halves_of_one_recording_are_told_alike() -> None:
    wrong = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found = list(cycle_quantities([walked(rng, count=12), walked(rng, count=12)]))
        assert len(found) == 7
        wrong += int(beyond_chance([one.p for one in found]).sum())
    assert wrong == 0


def test_a_hidden_range_lies_in_the_interval() -> None:
    inside = 0
    for seed in range(20):
        rng = np.random.default_rng(100 + seed)
        found = list(cycle_quantities([walked(rng, count=12), walked(rng, count=10, more=-15.0)]))
        one = next(one for one in found if one.name == "knee_flexion_range")
        assert one.change < 0
        assert beyond_chance([one.p])[0]
        inside += one.change_ci95[0] < -15.0 < one.change_ci95[1]
    assert inside >= 18


def test_few_strides_make_no_claim() -> None:
    rng = np.random.default_rng(3)
    found = list(cycle_quantities([walked(rng, count=2), walked(rng, count=12, more=-40.0)]))
    for one in found:
        assert one.change_ci95 is None
        assert one.p is None
        assert one.ci95[0] is None
        assert one.ci95[1] is not None
        assert one.why is Untested.FEW_CYCLES
    assert not beyond_chance([one.p for one in found]).any()


def test_visits_without_common_cycles_have_nothing_in_common() -> None:
    rng = np.random.default_rng(3)
    none = SessionMovement("other", (), "table", 70.0, {})
    assert list(cycle_quantities([walked(rng, count=5), none])) == []


def test_visits_with_nothing_in_common_are_refused(
    visits, compared: dict[str, VisitComparison], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = iter(compared["same"].visits)

    def still(*_):
        one = next(seen)
        moved = replace(one.moved, trials=())
        return replace(one, moved=moved, identified=None, result=replace(one.result, weighed=None), unweighed="No fit.")

    monkeypatch.setattr("biodance.pipeline.visits._examined", still)
    with pytest.raises(SessionRefused, match="have no quantity in common"):
        compare_visits(read_visits([visits["first"], visits["same"]]))


def test_a_middle_visit_may_lack_a_quantity() -> None:
    rng = np.random.default_rng(3)
    none = SessionMovement("other", (), "table", 70.0, {})
    one = next(cycle_quantities([walked(rng, count=5), none, walked(rng, count=5)]))
    assert one.values[1] is None
    assert one.ci95[1] is None
    assert one.counts == (5, 0, 5)
    assert one.change == pytest.approx(one.values[2] - one.values[0])


def test_without_what_strides_share_the_interval_is_welch_s() -> None:
    from scipy.stats import ttest_ind

    rng = np.random.default_rng(0)
    one, other = rng.normal(0, 1, 7), rng.normal(1, 2, 11)
    found, welch = change_of_mean(visit_mean(one), visit_mean(other)), ttest_ind(other, one, equal_var=False)
    low, high = welch.confidence_interval(0.95)
    assert found.interval == pytest.approx((low, high))
    assert found.p == pytest.approx(welch.pvalue)
    half = student.ppf(0.975, 6) * one.std(ddof=1) / np.sqrt(7)
    assert visit_mean(one).interval == pytest.approx((one.mean() - half, one.mean() + half))


def test_false_discoveries_are_counted_over_all_quantities() -> None:
    assert beyond_chance([0.001, None, 0.04, 0.6]).tolist() == [True, False, False, False]
    assert beyond_chance([0.001, 0.02]).tolist() == [True, True]
    assert beyond_chance([]).tolist() == []
    rng = np.random.default_rng(5)
    chance = [beyond_chance(rng.uniform(size=160).tolist()).any() for _ in range(400)]
    assert np.mean(chance) < 0.09, "5 % of the visits without change may tell one"


def test_a_turned_frame_shifts_a_curve_and_leaves_its_range() -> None:
    lone = KeyKind(quantity="knee_flexion", key="range", unit="deg")
    assert placement_sd(lone) == 0.0
    assert placement_sd(replace(lone, key="maximum")) == pytest.approx(np.degrees(0.05 * np.sqrt(2)))
    mixed = replace(lone, quantity="hip_adduction", beside=45.0)
    assert placement_sd(mixed) == pytest.approx(0.05 * np.sqrt(2) * 45.0)
    assert placement_sd(KeyKind(quantity="knee_flexion_moment", key="maximum", unit="N·m/kg")) == pytest.approx(
        0.0785, abs=1e-4
    )
    assert placement_sd(KeyKind(quantity="cadence", key="", unit="steps/min")) == 0.0


def test_key_values_are_read_from_their_cycle() -> None:
    cycle = Cycle("walk", "gait", "left", 0.0, 1.0, 0.6)
    value = 10.0 + 0.5 * PERCENT
    unknown = np.full(PERCENT.size, np.nan)
    angle = CycleCurve(cycle, "hip_flexion", "left", "deg", value, unknown)
    power = CycleCurve(cycle, "hip_power", "left", "W/kg", PERCENT / 100, np.full(PERCENT.size, 0.1))
    found = {one.name: one for one in key_values([angle, power])}
    numbers = {name: one.value for name, one in found.items()}
    assert numbers == pytest.approx(
        {
            "hip_flexion_maximum": 60.0, "hip_flexion_minimum": 10.0, "hip_flexion_range": 50.0,
            "hip_flexion_at_strike": 10.0, "hip_flexion_at_off": 40.0,
            "hip_power_maximum": 1.0, "hip_power_minimum": 0.0,
        }
    )  # fmt: skip
    assert found["hip_power_maximum"].sd == pytest.approx(0.1)
    assert found["hip_power_maximum"].rate == pytest.approx(np.radians(50.0))


def test_the_strides_of_one_foot_tell_of_the_person() -> None:
    right, left = (
        Stride(Cycle("w", "gait", side, 0, 1, 0.6), {"speed": 1.0, "stance": 60.0}) for side in ("right", "left")
    )
    foot = leading_foot([[right, left, left], [left]])
    assert foot == "left"
    found = [(one.name, one.side) for one in stride_values([right, left], leading=foot)]
    assert found == [("stance", "right"), ("speed", "both"), ("stance", "left")]


def test_one_visit_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SessionRefused, match="Give two or more visits"):
        read_visits([tmp_path])

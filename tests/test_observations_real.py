"""Faults written into the bytes of real walks are named by the observers, and clean walks stay missing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from inferred_sessions import heard
from inject import inject

from biodance.diagnosis.diagnosis import Finding
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.observations import observe, recording
from biodance.observations.stride_force import StrideForce
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.records import Wrench
from biodance.virtual_lab.causes import fault_of, parse_cause


def spoiled(session: Path, folder: Path, text: str) -> Path:
    """Return a copy of a session with a fault in every file."""
    for path in sorted(session.glob("*.c3d")):
        inject(path, folder / path.name, fault_of(parse_cause(text), {path.stem: (0.0, 1.0)}))
    return folder


def named_in(folder: Path) -> tuple[Finding, ...]:
    return heard(read_session(folder)).diagnosis.findings


def test_who_stands_with_one_foot_beside_plates_of_unknown_place_weighs_nothing(data: Path) -> None:
    """A plate of a table that measures nothing is left out; what the other foot pushes sideways is no zero."""
    trial = read_trial(data / "subject4/static1.trc", role="static")
    told = ["standing_force", "standing_place", "standing_twist"]
    assert {one.observer for one in observe(recording(trial, mass=60.05), told)} == set(told)
    for plate in trial.plates:
        assert observe(recording(replace(trial, plates=(plate,)), mass=30.0), told) == ()


@pytest.mark.parametrize("name", ["HC038A", "HC050A"])
def test_clean_walks_of_children_name_nothing(name: str, data: Path) -> None:
    assert named_in(data / "biomechzoo" / name) == ()


@pytest.mark.parametrize(
    ("name", "text", "effect", "target", "size"),
    [
        ("HC030A", "plate_position:target=plate1:x,shift=0.02", "plate_position", "plate1:x", 0.02),
        ("HC032A", "time_delay:delay=0.03", "time_delay", "", 0.03),
        ("HC055A", "plate_gain:target=plate1:Fz,gain=0.05", "plate_gain", "plate1:Fz", 0.05),
        ("HC044A", "axis_error:target=plate1:Fz", "axis_error", "plate1:Fz", None),
    ],
)
def test_a_fault_in_real_walks_is_named(
    name: str, text: str, effect: str, target: str, size: float | None, data: Path, tmp_path: Path
) -> None:
    (first, *others) = named_in(spoiled(data / "biomechzoo" / name, tmp_path, text))
    assert (first.effect, first.target, others) == (effect, target, [])
    if size is not None:
        low, high = first.parameters[0].interval
        assert low <= size <= high


def test_a_late_force_never_hides_itself(data: Path, tmp_path: Path) -> None:
    """The contact rules leave no run of such walks: the session is diagnosed all the same, and says what it heard."""
    late = spoiled(data / "biomechzoo/HC050A", tmp_path, "time_delay:delay=0.03")
    found = diagnose_session(examine(read_session(late))).diagnosis
    assert [one.effect for one in found.findings if one.effect != "labels_swapped"] == ["time_delay"]
    assert found.verdict == "named, incomplete"
    assert found.attention[0].text.startswith("2 things are wrong. First, LWRA and LWRB")
    steps = {row.trial: row.seconds for row in found.judged if row.why_not.startswith("only by its steps")}
    assert set(steps) == {"HC050A11", "HC050A33"}
    assert all(0.3 < seconds < 2.0 for seconds in steps.values())


def test_two_belts_weigh_a_runner_of_unknown_mass_alike_and_show_the_one_that_is_wrong(data: Path) -> None:
    """From flight to flight a step carries m (g + a), whoever runs: 72.84 kg by his scales, 30 ms of flight."""
    trial = next(one for one in read_session(data / "opensim_models/raj_run").trials if one.plates)
    seen = recording(trial, mass=75.0, declared=False)
    assert seen.mass_doubt == pytest.approx(22.5)
    steps = [one for one in StrideForce().observe(seen) if one.what.endswith("alone")]
    by = {name: np.mean([one.value for one in steps if one.plate == name]) for name in ("plate1", "plate2")}
    assert len(steps) >= 10
    assert all(abs(value - 72.84) < 0.01 * 72.84 for value in by.values()), by
    louder = np.diag([1, 1, 1.05, 1, 1, 1])
    wrong = tuple(
        replace(one, wrench=Wrench(one.wrench.time, one.wrench.value @ louder)) if one.name == "plate1" else one
        for one in trial.plates
    )
    again = StrideForce().observe(recording(replace(trial, plates=wrong), mass=75.0, declared=False))
    heavier = np.mean([one.value for one in again if one.what.endswith("alone") and one.plate == "plate1"])
    assert heavier == pytest.approx(1.05 * by["plate1"], rel=2e-3)

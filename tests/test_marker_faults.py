"""Markers that stand still to the last bit and markers that jump are not seen, and named; impacts and planted feet are
neither.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lab_sessions import person

from biodance.effects import discrete_effects
from biodance.effects._base.quality_check import Recorded
from biodance.lab.markers.sets import canonical, read_marker_set
from biodance.lab.markers.signals import MarkerFault, faulty_markers, without_faults
from biodance.lab.prepare import prepare
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.records import Markers, Session, Trial


def squat(rate: float = 50.0) -> Markers:
    """Return somebody who squats 0.4 m deep for 3 s, the feet on the ground, with 0.5 mm of noise."""
    markers = person(frames=round(3 * rate), rate=rate)
    depth = 0.2 * (1 - np.cos(2 * np.pi * markers.time / 3.0))
    xyz = markers.xyz.copy()
    high = xyz[..., 2] > 0.3
    xyz[..., 2] -= np.where(high, depth[:, None], 0.0)
    return Markers(markers.names, markers.time, xyz)


def spiked(markers: Markers, label: str, starts: dict[int, int], size: float) -> Markers:
    """Return the markers with one of them ``size`` m aside from each frame on for some frames."""
    xyz = markers.xyz.copy()
    for start, count in starts.items():
        xyz[start : start + count, markers.names.index(label), 1] += size
    return Markers(markers.names, markers.time, xyz)


def held(markers: Markers, labels: tuple[str, ...], start: int, stop: int) -> Markers:
    """Return the markers with some of them as they were in frame ``start`` until before ``stop``."""
    xyz = markers.xyz.copy()
    columns = [markers.names.index(label) for label in labels]
    xyz[start:stop, columns] = xyz[start, columns]
    return Markers(markers.names, markers.time, xyz)


def found_in(markers: Markers, fault: MarkerFault) -> dict[str, tuple]:
    return {one.label: one.spans for one in faulty_markers(markers) if one.fault is fault}


def test_markers_that_hold_their_last_value_are_found_with_their_frames() -> None:
    markers = squat()
    assert faulty_markers(markers) == ()
    wrong = held(markers, ("LKNE", "RASI"), 40, 90)
    assert found_in(wrong, MarkerFault.FROZEN) == {"LKNE": ((41, 90),), "RASI": ((41, 90),)}
    clean = without_faults(wrong, faulty_markers(wrong))
    assert np.isnan(clean["LKNE"][41:90]).all()
    np.testing.assert_array_equal(clean["RANK"], markers["RANK"])


def test_nobody_who_stands_still_has_frozen_markers() -> None:
    markers = person(frames=150, rate=50.0)
    assert faulty_markers(held(markers, ("LKNE",), 40, 90)) == ()


def test_a_computed_foot_that_comes_to_rest_by_and_by_is_not_frozen() -> None:
    markers = squat()
    xyz = markers.xyz.copy()
    phase = np.clip((markers.time - 0.5) / 1.0, 0.0, 1.0)
    way = 0.3 * phase**3 * (10 - 15 * phase + 6 * phase**2)
    heel = markers.names.index("LHEE")
    xyz[:, heel] = xyz[0, heel] + way[:, None] * [1.0, 0.0, 0.0]
    assert faulty_markers(Markers(markers.names, markers.time, xyz)) == ()


@pytest.mark.parametrize("rate", [50.0, 100.0, 150.0])
def test_every_jump_of_one_to_three_frames_is_found(rate: float) -> None:
    markers = squat(rate)
    starts = {10: 1, 20: 2, 30: 3, 43: 2, 47: 1, 100: 3}
    jumps = found_in(spiked(markers, "LKNE", starts, 0.06), MarkerFault.SPIKE)
    assert jumps == {"LKNE": tuple((start, start + count) for start, count in starts.items())}


def test_what_goes_and_stays_away_is_no_spike() -> None:
    assert faulty_markers(spiked(squat(), "LKNE", {60: 90}, 0.2)) == ()


@pytest.mark.parametrize(
    "path",
    [
        *(f"rbds/{person}/runT{speed}.c3d" for person in ("S003", "S009", "S020") for speed in (25, 35)),
        *(f"subject4/{name}.trc" for name in ("DJ1", "DJ2", "DJ3", "DJAsym1", "squats1", "walking1")),
        "biomechzoo/HC036A/HC036A23.c3d",
        "pycgm/Movement_trial.c3d",
        "laas_human/c3d/march.c3d",
    ],
)
def test_real_runs_jumps_and_marches_show_neither(path: str, data: Path) -> None:
    (file,) = (data / path.split("/")[0]).rglob(path.split("/")[-1]) if "rbds" not in path else [data / path]
    trial = read_trial(file)
    worn = canonical(trial.markers, read_marker_set(trial.marker_set)) if trial.marker_set else trial.markers
    assert faulty_markers(worn) == ()


def with_markers(session: Session, name: str, change) -> Session:
    def changed(trial: Trial) -> Trial:
        return replace(trial, markers=change(trial.markers)) if trial.name == name else trial

    return replace(session, trials=tuple(changed(trial) for trial in session.trials))


def test_a_prepared_trial_bridges_what_was_taken_out_and_says_so(data: Path) -> None:
    session = read_session(data / "biomechzoo/HC044A")
    wrong = with_markers(session, "HC044A29", lambda markers: spiked(markers, "LKNE", {100: 2, 200: 3}, 0.08))
    right, mended = (
        prepare(next(trial for trial in one.trials if trial.name == "HC044A29")) for one in (session, wrong)
    )
    np.testing.assert_allclose(mended.markers["LKNE"], right.markers["LKNE"], atol=2e-3)
    assert any("LKNE jumps by up to" in sentence for sentence in mended.history)
    checks = discrete_effects()["marker_spikes"].check(Recorded(wrong))
    assert [(one.effect, one.target, one.ok) for one in checks] == [("marker_spikes", "LKNE", False)]
    assert "HC044A29 1.00, 2.00 s" in checks[0].text


def test_a_diagnosis_names_frozen_markers_and_spikes_and_judges_the_rest(data: Path) -> None:
    session = read_session(data / "biomechzoo/HC044A")
    wrong = with_markers(session, "HC044A15", lambda markers: held(markers, ("LTIB",), 60, 110))
    wrong = with_markers(wrong, "HC044A29", lambda markers: spiked(markers, "RKNE", {100: 1, 200: 3}, 0.08))
    found = diagnose_session(examine(wrong)).diagnosis
    assert {(one.effect, one.target) for one in found.findings} == {
        ("frozen_markers", "LTIB"),
        ("marker_spikes", "RKNE"),
    }
    assert any(row.seconds > 0.5 for row in found.judged)

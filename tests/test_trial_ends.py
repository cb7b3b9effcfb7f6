"""A recording that begins and ends in the middle of a movement."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_plates import session

from biodance.diagnosis.reasons import DiagnosisStatus
from biodance.lab.session.read import read_session
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.session import examine
from biodance.records import LeftOut, Markers, Subject, Trial, Wrench
from biodance.virtual_lab.simulate import simulate_session


def between(trial: Trial, start: float, stop: float, cutoff: float) -> Trial:
    """Return the part of a trial from ``start`` to ``stop`` s, to be low-passed at ``cutoff`` Hz."""
    markers = trial.markers
    assert markers is not None

    def inside(time: np.ndarray) -> np.ndarray:
        return (time >= start) & (time <= stop)

    def part(wrench: Wrench) -> Wrench:
        return Wrench(wrench.time[inside(wrench.time)], wrench.value[inside(wrench.time)])

    return replace(
        trial,
        markers=Markers(markers.names, markers.time[inside(markers.time)], markers.xyz[inside(markers.time)]),
        plates=tuple(replace(plate, wrench=part(plate.wrench)) for plate in trial.plates),
        settings=trial.settings.changed({"filter.cutoff": cutoff}),
    )


@pytest.mark.parametrize("cutoff", [6.0, 10.0])
def test_forces_are_not_compared_where_the_low_pass_makes_up_the_acceleration(
    cutoff: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("biodance.pipeline.session.can_identify", lambda _: False)
    whole = session()
    static, squat = (between(one, *span, cutoff) for one, span in zip(whole.trials, [(0, 9), (0.6, 1.6)], strict=False))
    (found,) = (one for one in examine(replace(whole, trials=(static, squat))).trials if one.name == "squat_1")
    compared = found.comparison
    assert compared is not None
    left = np.abs(compared.measured - compared.simulated)[:, 2]
    assert left[compared.used].max() < 0.4 * left.max()
    assert found.left_out[LeftOut.AT_AN_END] == pytest.approx(1 / cutoff, abs=0.03)


@pytest.mark.parametrize(("seed", "start"), [(13, 2.0), (14, 3.1)])
def test_faultless_squats_cut_in_the_middle_of_the_movement_are_clean(seed: int, start: float, tmp_path: Path) -> None:
    """By what was made up at an end a knee lay elsewhere in the first, and a chair carried the second."""
    read = read_session(simulate_session(Subject(64.0, 1.68, "F", 30.0), "squat", tmp_path / "squat", seed=seed))
    trials = [between(one, *((0, 9) if one.role == "static" else (start, start + 3)), 6.0) for one in read.trials]
    assert diagnose_session(examine(replace(read, trials=tuple(trials)))).diagnosis.status is DiagnosisStatus.CLEAN

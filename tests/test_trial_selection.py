"""Which trials the diagnosis looks at, and the tolerances of the person in them, on sessions whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import RATE, body, known, motion, windows
from inferred_sessions import inferred

from biodance.body.tables.error_sizes import error_size
from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.own_tolerances import UNREST, own_tolerances, soft_tissue, unrest
from biodance.diagnosis.problem import TrialWindow
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline.judged_trials import chosen_windows, left_out
from biodance.pipeline.trial import Step, TrialResult, WrenchComparison
from biodance.records import Array, Motion, Role, Wrench
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import shipped

MARKERS = error_size("marker_distance", "first quartile", state="after")


def still(seconds: float) -> Motion:
    """Return somebody who does not move."""
    moving, frames = motion(3), int(seconds * RATE)
    q = np.repeat(moving.q[:1], frames, axis=0)
    return Motion(
        np.arange(frames) / RATE, q, np.zeros((frames, moving.v.shape[1])), np.zeros((frames, moving.v.shape[1]))
    )


def standing(shaken: Array) -> TrialWindow:
    """Return a static trial whose plates measure what the body needs and ``shaken`` (T, 6)."""
    still_one = still(len(shaken) / RATE)
    trial = windows(1, trials=1)[0].trial
    plate = replace(trial.plates[0], wrench=Wrench(still_one.time, predict_wrench(body(), still_one).value + shaken))
    return TrialWindow(
        replace(trial, name="static", role="static", plates=(plate,)),
        still_one,
        np.ones(len(shaken), dtype=bool),
        0.0,
        0.1,
    )


def result(window: TrialWindow, role: Role, use: Array | None = None) -> TrialResult:
    used = window.use if use is None else use
    value = window.trial.wrench.value
    compared = WrenchComparison(window.motion.time, value, value, used, np.zeros(6), np.ones(6))
    return TrialResult(
        replace(window.trial, role=role), (Step("compare", "done"),), motion=window.motion, comparison=compared
    )


def test_standing_is_looked_at_where_movement_is_short() -> None:
    moving, quiet = windows(1, trials=1)[0], standing(np.zeros((150, 6)))
    short = np.zeros(moving.use.size, dtype=bool)
    short[100:115] = True
    assert [window.trial.name for window in chosen_windows((result(quiet, "static"), result(moving, "fit")))] == ["t0"]
    some = (result(quiet, "static"), result(moving, "fit", short))
    assert [window.trial.name for window in chosen_windows(some)] == ["static", "t0"]
    assert left_out(some) == (
        "t0 was left out: no 0.4 s in which the plates measure all ground contact without a break.",
    )
    assert chosen_windows(some)[0].start == 0.0
    assert chosen_windows(some)[1].end == 1.0


def test_the_unrest_of_standing_is_measured_and_bounded() -> None:
    time = np.arange(int(60 * RATE)) / RATE
    shaken = np.zeros((time.size, 6))
    shaken[:, 0] = 0.8 * np.sqrt(2) * np.sin(2 * np.pi * 1.7 * time)
    shaken[:, 1] = 10 * UNREST * np.sin(2 * np.pi * 4.0 * time)
    shaken[:, 2] = 5 * np.sin(2 * np.pi * 0.1 * time)
    covariance = unrest(body(), (standing(shaken),), np.zeros(3))
    size = np.sqrt(2 * np.diff(BANDS.edges)[:, None] / 25.0 * covariance.diagonal(axis1=1, axis2=2))
    assert size[3, 0] == pytest.approx(0.8, rel=0.05)
    assert size[4, 1] == pytest.approx(UNREST, rel=0.05)
    assert not size[:2].any(), "slow sway is weight and posture, and no unrest"
    own = own_tolerances(body(), (standing(shaken),))
    assert np.all(np.linalg.eigvalsh(own.tolerances.noise - shipped().noise) > -1e-9)
    assert "Standing still" in own.notes[0]
    assert own.believed
    assert own.tolerances.sizes == shipped().sizes


def test_a_zero_that_wanders_between_trials_is_no_alarm() -> None:
    """One plate, four trials: its zero moves by what a spot check accepts (1 N), and by ten times as much."""

    def wanders(size: float) -> tuple[float, str]:
        some = windows(5, hidden=lambda wrench, session, _: wrench + size * (session[0] == 0.25) * np.eye(6)[0])
        own = own_tolerances(body(), some, known=known())
        found = inferred(body(), some, tolerances=own.tolerances, effects=("plate_offset",)).diagnosis
        return max(row.z for row in found.adequacy if row.channel == "Fx" and row.band_hz[0] == 0), found.verdict

    assert wanders(1.0)[0] < LIMIT
    assert wanders(1.0)[1] == "nothing wrong"
    assert wanders(10.0)[0] > LIMIT
    assert wanders(10.0)[1] == "unexplained"


@pytest.mark.parametrize(("factor", "grows"), [(1.2, False), (3.0, True)])
def test_soft_tissue_grows_with_the_markers_distance(factor: float, grows: bool) -> None:
    window = windows(1, trials=1)[0]
    residual = np.full((window.motion.time.size, 5), factor * MARKERS)
    residual[:, 4] = 0.2
    moving = window.motion
    far = replace(window, motion=Motion(moving.time, moving.q, moving.v, moving.a, residual, tuple("abcde")))
    assert soft_tissue((far,)) == pytest.approx(factor * MARKERS), "one marker that is wrong does not count"
    known = replace(shipped(), movement=np.full(shipped().movement.shape, 1e9))  # nobody moves faster
    own = own_tolerances(body(), (far,), known=known)
    assert own.tolerances.size("slide thigh") == pytest.approx(
        shipped().size("slide thigh") * (factor if grows else 1.0)
    )
    for bone in ("joint_centre hip", "segment_length thigh", "tilt knee", "marker_misplaced KNE", "plate_gain Fz"):
        assert own.tolerances.size(bone) == shipped().size(bone) > 0, bone
    more = factor if grows else 1.0
    np.testing.assert_allclose(own.tolerances.noise[1:], more**2 * shipped().noise[1:])
    near = own_tolerances(body(), windows(1, trials=1), known=known)
    np.testing.assert_allclose(own.tolerances.noise[0, :3, :3], near.tolerances.noise[0, :3, :3])
    assert own.believed, "widened, not refused"
    assert bool(own.notes) == grows

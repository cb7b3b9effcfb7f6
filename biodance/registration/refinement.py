"""From an aligned pose to the pose that all evidence asks for, with its covariance."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.anthropometry import error_size
from biodance.diagnosis.problem import TrialWindow
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.errors import TrialRefused
from biodance.motion.contact import Contact, dilate, ground_contact, speeds
from biodance.motion.dynamics import predict_wrench
from biodance.motion.soles import Soles, soles_from_body
from biodance.records import Array, Mask, Motion, Trial, runs
from biodance.registration.evidence import PoseEvidence, feet_pull, plate_steps, together, wrench_pull
from biodance.registration.pose import Forces, FramePose, with_forces_at
from biodance.spatial import quaternion_matrix, zero_moment_point
from biodance.uncertainty.tolerances import Tolerances

_ALIGNED = np.array([0.05, 0.05, np.radians(3.0), 0.03])
"""m, m, rad, s: how far an alignment is off (16 real walks, 23 simulated trials: up to 22 mm, 3 degrees, 20 ms)."""
_INSTALLED = np.array([0.001, 0.001, np.radians(0.1), 0.001])
"""m, m, rad, s: what no evidence here can see of an installed plate: level, axes, the filter of its amplifier."""
_AHEAD = 0.0035
"""m: by how much a table's centre of mass lies wrong along the direction in which a person faces, beyond its sd."""
_REAL = np.array([0.012, 0.012, np.radians(0.5), 0.008])
"""m, m, rad, s beyond its own for the wrench of real people and of contacts shorter than a second: the table's centre
of mass lies up to 40 mm from theirs, and flesh lags (ten walks: 13 mm and 8 ms root mean square, always late)."""
_FEW = 60
"""Rows of the wrench (some 0.5 s of contact) below which its yaw errs by more, in proportion."""
_LIKE_MODEL = 2.3
"""Times the usual distance of markers to the body above which a recording counts as of a real person: simulated ones
have up to 2.3, real ones 2.4 to 4.8."""
_PRESSED, _SLOW = 100.0, 0.3
"""N and m/s: a foot that stands on a plate."""
_TENTH, _AROUND = 0.1, 0.1
"""Share of the weight, and s."""
_ROUNDS = 3
ENOUGH_ROWS = 300
"""Rows of the wrench (some two seconds) from which on it alone can judge."""
HEIGHT_SD = 0.008
"""m: soles of the body against the ground (92 recordings: 6 mm root mean square, mostly too low)."""


@dataclass(frozen=True, eq=False)
class Refined:
    """The ``pose``, the ``covariance`` (4, 4) of x, y m, yaw rad and delay s about ``about`` (3,) m; how many
    ``seconds`` of fully measured contact and ``steps`` it rests on; ``misfit`` of the feet (1 expected; NaN without
    steps); ``fit``, the mean square of the ``rows`` of the wrench; ``notes``.
    """

    pose: FramePose
    covariance: Array
    about: Array
    seconds: float
    steps: int
    misfit: float
    fit: float
    rows: int
    notes: tuple[str, ...] = ()


def floor_of(soles: Soles) -> float:
    """Return the height m in the room on which the feet stand: the median lowest point of slow feet.

    Raises
    ------
    TrialRefused
        No foot is ever slow.
    """
    slow = _slow(soles)
    if not slow.any():
        raise TrialRefused("No foot ever stands still in these markers, so nobody can tell where a plate could be.")
    return float(np.median(_lowest(soles)[slow]))


def _lowest(soles: Soles) -> Array:
    """Return the height (T, 2) m of the lowest point of each foot."""
    return np.asarray(soles.outline[..., 2].min(axis=2))


def _slow(soles: Soles) -> Mask:
    """Return (T, 2) where a whole foot is as slow as one that stands."""
    return np.asarray((speeds(soles) < _SLOW).all(axis=2))


def with_height(pose: FramePose, soles: Soles, forces: Forces) -> FramePose:
    """Return the pose with the height that the soles on loaded plates ask for."""
    gaps = []
    low, slow = _lowest(soles), _slow(soles)
    for plate, value in zip(forces.plates, forces.during(soles.time + pose.delay), strict=True):
        there = zero_moment_point(pose.wrench(np.nan_to_num(value)), height=plate.height + pose.shift[2])
        away = np.linalg.norm((soles.centre - there[:, None])[..., :2], axis=2)
        foot = np.nan_to_num(away, nan=np.inf).argmin(axis=1)
        rows = np.arange(len(foot))
        use = (np.nan_to_num(value[:, 2]) > _PRESSED) & slow[rows, foot] & (away[rows, foot] < 0.3)
        gaps.append(low[rows, foot][use] - plate.height)
    found = np.concatenate(gaps)
    return pose if not found.size else FramePose(pose.delay, pose.yaw, np.array([*pose.shift[:2], np.median(found)]))


def refined(
    body: Body,
    trial: Trial,
    motion: Motion,
    forces: Forces,
    start: FramePose,
    tolerances: Callable[[TrialWindow], Tolerances],
) -> Refined:
    """Return the pose that wrench and feet ask for, beginning at ``start``; ``tolerances`` of what is no fault in a
    look at the placed trial.

    Raises
    ------
    TrialRefused
        Neither the wrench nor the feet tell anything: no fully measured contact, no step.
    """
    pose, why = start, ""
    weak = PoseEvidence(np.diag(_ALIGNED**-2.0), np.zeros(4), 0.0, 0)
    for turn in range(_ROUNDS):
        window, soles, about = _look(body, trial, motion, forces, pose)
        steps = plate_steps(window.trial, window.motion, _contact(body, window, soles), soles, forces, pose)
        feet, wrench = feet_pull(steps, about), None
        try:
            wrench = wrench_pull(body, window, tolerances(window), about)
        except TrialRefused as error:
            why = str(error)
        pulls = [one for one in (_honest(wrench, window) if wrench else None, feet) if one is not None]
        if not pulls:
            raise TrialRefused(
                f"Neither the body's wrench nor a step tells where the plates lie; are these files of one trial? {why}"
            )
        change, covariance = together([*pulls, weak])
        pose = pose.changed(change, about)
        if turn and (np.abs(change) < 0.1 * np.sqrt(np.diag(covariance))).all():
            break
    seconds = float(window.use.sum() / window.motion.rate) if wrench is not None else 0.0
    notes = () if wrench is not None else (f"The wrench of the whole body was not used: {why}",)
    covariance = covariance + np.diag(_INSTALLED**2)
    fit = (wrench.misfit, wrench.rows) if wrench else (float("nan"), 0)
    return Refined(pose, covariance, about, seconds, len(steps), feet.misfit if feet else np.nan, *fit, notes)


def _contact(body: Body, window: TrialWindow, soles: Soles) -> Contact:
    return ground_contact(window.trial, soles, mass=float(body.sip.mass.sum()))


def _look(
    body: Body, trial: Trial, motion: Motion, forces: Forces, pose: FramePose
) -> tuple[TrialWindow, Soles, Array]:
    """Return the trial under a pose, its fully measured frames in use; the soles; the mean centre of pressure."""
    there, cut = with_forces_at(trial, motion, forces, pose)
    soles = soles_from_body(body, cut)
    window = TrialWindow(there, cut, np.zeros(cut.time.size, dtype=bool), 0.0, 1.0)
    measured = _contact(body, window, soles).measured if forces.sized else _carried(body, window)
    use = measured & cut.determined
    about = np.nanmean(there.wrench.cop(height=there.floor, threshold=_PRESSED), axis=0)
    return replace(window, use=use), soles, about


def _carried(body: Body, window: TrialWindow) -> Mask:
    """Return the frames (T,) in which plates of unknown size carry the whole body: the vertical force is the needed one
    within a tenth of the weight, for a while before and after.
    """
    needed, force = predict_wrench(body, window.motion).force[:, 2], window.trial.wrench.force[:, 2]
    apart = np.abs(force - needed) > _TENTH * abs(float(body.gravity[2])) * float(body.sip.mass.sum())
    return ~dilate(apart | (force < _PRESSED), int(np.ceil(_AROUND * window.motion.rate)))


def _honest(pull: PoseEvidence, window: TrialWindow) -> PoseEvidence:
    """Return the pull of the wrench with what its body does not know: much for real people and short contacts, and more
    where it fits badly.
    """
    with np.errstate(invalid="ignore"):
        away = np.nanquantile(np.sqrt(np.nanmean(window.motion.residual**2, axis=0)), 0.25)
    real = away > _LIKE_MODEL * error_size("marker_distance", "first quartile", state="after")
    longest = max((stop - start for start, stop in runs(window.use)), default=0) / window.motion.rate
    worse = max(1.0, pull.misfit)
    scaled = replace(pull, information=pull.information / worse, vector=pull.vector / worse)
    if real or longest < SHORTEST_RUN:
        few = np.array([1.0, 1.0, max(1.0, _FEW / pull.rows), 1.0])
        return scaled.less_sure(worse * np.diag((few * _REAL) ** 2))
    ahead = quaternion_matrix(window.motion.q[:, 3:7])[:, :2, 0].mean(axis=0)
    forwards = np.array([*ahead / max(float(np.linalg.norm(ahead)), 1e-9), 0.0, 0.0])
    return scaled.less_sure(_AHEAD**2 * np.outer(forwards, forwards))

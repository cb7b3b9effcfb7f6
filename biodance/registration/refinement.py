"""From an aligned pose to the pose that all evidence asks for, with its covariance: the wrench that the body needs, and
the feet of ordinary steps, by where the pressure lies in them and when the heel strikes. What steps share is shared in
their covariance: two steps of one foot do not halve it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.problem import TrialWindow, problem
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.effects import Case
from biodance.errors import TrialRefused
from biodance.inference.rows import rows_of
from biodance.inference.scales import nominal
from biodance.inference.sets import Search, at_scales, hypothesis
from biodance.lab.plates.faults import DELAY, POSITION, ROTATION
from biodance.motion.contact import dilate, ground_contact, speeds
from biodance.motion.dynamics import predict_wrench
from biodance.motion.soles import Soles, soles_from_body
from biodance.observations import observe, recording
from biodance.records import Array, Mask, Motion, Trial, runs
from biodance.registration.alignment import Forces, FramePose, registered_plates, with_forces_at
from biodance.spatial import quaternion_matrix, wrench_shift, zero_moment_point
from biodance.uncertainty.tolerances import Tolerances


@dataclass(frozen=True, eq=False)
class PoseEvidence:
    """Information about four unknowns, x, y m, yaw rad about a common vertical, delay s, as changes of a pose:
    ``information`` (4, 4) = J' V^-1 J and ``vector`` (4,) = J' V^-1 y; ``misfit`` the mean square of its whitened rows,
    1 expected; ``rows`` how many.
    """

    information: Array
    vector: Array
    misfit: float
    rows: int

    def less_sure(self, added: Array) -> "PoseEvidence":
        """Return the same with the covariance ``added`` (4, 4) of what its model does not know."""
        # The information may be singular; the change is the least one that it asks for.
        covariance = np.linalg.pinv(self.information)
        change = covariance @ self.vector
        wider = np.linalg.inv(covariance + added)  # the change itself stays as it is
        return PoseEvidence(np.asarray(wider), wider @ change, self.misfit, self.rows)


def wrench_pull(body: Body, window: TrialWindow, tolerances: Tolerances, about: Array) -> PoseEvidence:
    """Return what the wrench of one trial, placed by the pose so far, says of a change of that pose about ``about``
    (3,) m.

    Raises
    ------
    TrialRefused
        No quarter of a second is fully measured and believable.
    """
    # Tolerances of an installed plate that are no tolerances here: they are what is looked for.
    sought = (f"{POSITION.name} x", f"{POSITION.name} y", f"{ROTATION.name} z", DELAY.name)
    known = replace(tolerances, sizes={key: size for key, size in tolerances.sizes.items() if key not in sought})
    # Of walks over two plates no more than 0.3 to 0.9 s are fully measured.
    put = problem(body, (window,), shortest=0.25)
    search = Search.of(rows_of(put, candidates(put), known, None), ())
    base = at_scales(search, hypothesis(search, ()), nominal(search.rows))
    rows = put.spectrum.rows((_columns(put.cases[0], about),)).reshape(-1, 4)
    # The other rows (markers) do not feel where the plates lie.
    rows = np.concatenate([rows, np.zeros((len(put.target) - len(rows), 4))])
    # What parameters and tolerances explain is projected out (Schur complement).
    vector, information = search.score(base, search.rows.white(rows))
    # How far a first alignment can be off (m, m, rad, s) keeps a direction that nothing shows from running away.
    unknown = np.array([0.1, 0.1, np.radians(5.0), 0.05])
    return PoseEvidence(
        information + np.diag(unknown**-2.0),
        # residual + rows @ change is to vanish, hence the minus.
        -vector,
        float(base.left @ base.left) / len(base.left),
        put.wrench_rows,
    )


def _columns(case: Case, about: Array) -> Array:
    """Return (T, 6, 4): what one unit of x, y, yaw and delay adds to the measured wrench about the room's origin."""
    wrench = case.trial.wrench.value
    # A later clock reads at t + delay: the derivative with respect to time.
    late = np.gradient(wrench, case.motion.time, axis=0)[:, :, None]
    return np.concatenate([np.einsum("kij,tj->tik", _changes(about), wrench), late], axis=2)


def _changes(about: Array) -> Array:
    """Return (3, 6, 6): what one unit of x, y (m) and yaw (rad, about the vertical through ``about``) of the frame of
    all plates adds to their wrenches about the room's origin.
    """
    turn = wrench_shift(-about) @ ROTATION.slope("z") @ wrench_shift(about)
    return np.stack([POSITION.slope("x"), POSITION.slope("y"), turn])


def feet_pull(trial: Trial, about: Array) -> tuple[PoseEvidence | None, int]:
    """Return what the feet say of a change of the pose about ``about`` (3,) m, in a trial with the plates as recorded
    where the pose so far puts them, None where they say nothing; and of how many steps.
    """
    found = observe(recording(trial), ("foot_across", "foot_along", "force_onset"))
    if not found:
        return None, 0
    value = np.array([one.value - one.expected for one in found])
    plates = [plate.name for plate in trial.plates]
    # No wrench is added by a constant: the last column of B.
    changes = np.pad(_changes(about), ((0, 0), (0, 0), (0, 1)))
    moved = [[sum(one.sensitivity.to(name, change) for name in plates) for change in changes] for one in found]
    # The contact is at (time of the file - delay): a later clock brings it forward.
    slope = np.column_stack([moved, [-one.sensitivity.delay for one in found]])
    # What observations share, a foot or a laboratory, they share in their covariance.
    norms = dict.fromkeys(name for one in found for name in one.norms)
    shared = np.array([[one.norms.get(name, 0.0) for name in norms] for one in found])
    weight = np.linalg.inv(np.diag([one.sd**2 for one in found]) + shared @ shared.T)
    # Generalised least squares: value + slope @ change is to vanish, with V^-1 as weight.
    information, vector = slope.T @ weight @ slope, -slope.T @ weight @ value
    left = value + slope @ (np.linalg.pinv(information) @ vector)
    # chi² over its degrees of freedom.
    free = max(1, len(found) - np.linalg.matrix_rank(slope))
    misfit = float(left @ weight @ left) / free
    return PoseEvidence(information, vector, misfit, len(found)), len({one.contact for one in found})


_PRESSED = 100.0  # N of a foot that stands on a plate
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
    """Return (T, 2) where a whole foot is as slow (m/s) as one that stands."""
    return np.asarray((speeds(soles) < 0.3).all(axis=2))


def with_height(pose: FramePose, soles: Soles, forces: Forces) -> FramePose:
    """Return the pose with the height that the soles on loaded plates ask for."""
    gaps = []
    low, slow = _lowest(soles), _slow(soles)
    # Shift that lays the surface of the plate under the lowest point of the sole.
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
    # A prior of the change, centred at the present pose in every round: it damps, and holds what nobody sees. An
    # alignment is off by up to 22 mm, 3 degrees and 20 ms (16 real walks, 23 simulated trials).
    weak = np.diag(np.array([0.05, 0.05, np.radians(3.0), 0.03]) ** -2.0)
    for turn in range(3):
        window, about = _look(body, trial, motion, forces, pose)
        placed = replace(window.trial, plates=registered_plates(forces.plates, pose))
        (feet, steps), wrench = feet_pull(placed, about), None
        try:
            wrench = wrench_pull(body, window, tolerances(window), about)
        except TrialRefused as error:
            why = str(error)
        pulls = [one for one in (_honest(wrench, window) if wrench else None, feet) if one is not None]
        if not pulls:
            raise TrialRefused(
                f"Neither the body's wrench nor a step tells where the plates lie; are these files of one trial? {why}"
            )
        # Independent evidence of one change: informations and vectors add up.
        covariance = np.linalg.inv(np.sum([weak, *(one.information for one in pulls)], axis=0))
        change = covariance @ np.sum([one.vector for one in pulls], axis=0)
        pose = pose.changed(change, about)
        # Never after the first round: the linearisation was at the alignment.
        if turn and (np.abs(change) < 0.1 * np.sqrt(np.diag(covariance))).all():
            break
    seconds = float(window.use.sum() / window.motion.rate) if wrench is not None else 0.0
    notes = () if wrench is not None else (f"The wrench of the whole body was not used: {why}",)
    # What no evidence here can see of an installed plate: level, axes, the filter of its amplifier (m, m, rad, s).
    # It is independent of the rest, so covariances add.
    covariance = covariance + np.diag(np.array([0.001, 0.001, np.radians(0.1), 0.001]) ** 2)
    fit = (wrench.misfit, wrench.rows) if wrench else (float("nan"), 0)
    return Refined(pose, covariance, about, seconds, steps, feet.misfit if feet else np.nan, *fit, notes)


def _look(body: Body, trial: Trial, motion: Motion, forces: Forces, pose: FramePose) -> tuple[TrialWindow, Array]:
    """Return the trial under a pose, its fully measured frames in use; and the mean centre of pressure."""
    there, cut = with_forces_at(trial, motion, forces, pose)
    window = TrialWindow(there, cut, np.zeros(cut.time.size, dtype=bool), 0.0, 1.0)
    if forces.sized:
        measured = ground_contact(there, soles_from_body(body, cut), mass=float(body.sip.mass.sum())).measured
    else:
        measured = _carried(body, window)
    use = measured & cut.determined
    about = np.nanmean(there.wrench.cop(height=there.floor, threshold=_PRESSED), axis=0)
    return replace(window, use=use), about


def _carried(body: Body, window: TrialWindow) -> Mask:
    """Return the frames (T,) in which plates of unknown size carry the whole body: the vertical force is the needed one
    within a tenth of the weight, for a while before and after.
    """
    needed, force = predict_wrench(body, window.motion).force[:, 2], window.trial.wrench.force[:, 2]
    apart = np.abs(force - needed) > 0.1 * abs(float(body.gravity[2])) * float(body.sip.mass.sum())
    # Frames within 0.1 s of a wrong one are left out, too.
    return ~dilate(apart | (force < _PRESSED), int(np.ceil(0.1 * window.motion.rate)))


def _honest(pull: PoseEvidence, window: TrialWindow) -> PoseEvidence:
    """Return the pull of the wrench with what its body does not know: much for real people and short contacts, and more
    where it fits badly.
    """
    with np.errstate(invalid="ignore"):
        # Root mean square over time of each marker, then the first quartile over the markers.
        away = np.nanquantile(np.sqrt(np.nanmean(window.motion.residual**2, axis=0)), 0.25)
    # Times the usual distance of markers to the body: simulated recordings have up to 2.3, real ones 2.4 to 4.8.
    real = away > 2.3 * error_size("marker_distance", "first quartile", state="after")
    longest = max((stop - start for start, stop in runs(window.use)), default=0) / window.motion.rate
    worse = max(1.0, pull.misfit)
    # Information over misfit: covariances grow with the mean square of the whitened rows.
    scaled = replace(pull, information=pull.information / worse, vector=pull.vector / worse)
    if real or longest < SHORTEST_RUN:
        # Below 60 rows (some 0.5 s of contact) the yaw errs by more, in proportion.
        few = np.array([1.0, 1.0, max(1.0, 60 / pull.rows), 1.0])
        # m, m, rad, s: the table's centre of mass lies up to 40 mm from a real person's, and flesh lags (ten walks: 13
        # mm and 8 ms root mean square, always late).
        beyond = np.array([0.012, 0.012, np.radians(0.5), 0.008])
        return scaled.less_sure(worse * np.diag((few * beyond) ** 2))
    # Mean horizontal direction of the pelvis' x axis.
    ahead = quaternion_matrix(window.motion.q[:, 3:7])[:, :2, 0].mean(axis=0)
    forwards = np.array([*ahead / max(float(np.linalg.norm(ahead)), 1e-9), 0.0, 0.0])
    # A table's centre of mass lies 3.5 mm beyond its sd wrong along the direction in which a person faces, and only
    # along that: a matrix of rank one.
    return scaled.less_sure(0.0035**2 * np.outer(forwards, forwards))

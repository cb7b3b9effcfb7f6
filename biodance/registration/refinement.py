"""From an aligned pose to the pose that all evidence asks for, with its covariance: the wrench that the body needs, and
the feet of ordinary steps, by where the pressure lies in them and when the heel strikes. What steps share is shared in
their covariance: two steps of one foot do not halve it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.model import model
from biodance.diagnosis.problem import TrialWindow, problem
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.effects import Case
from biodance.errors import TrialRefused
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.lab.plates.faults import DELAY, POSITION, ROTATION
from biodance.motion.contact import Contact, dilate, ground_contact, speeds
from biodance.motion.dynamics import predict_wrench
from biodance.motion.soles import Soles, inside, soles_from_body
from biodance.observations import ONSET, FootPath
from biodance.observations.foot_across import ACROSS_PHASES
from biodance.observations.foot_along import ALONG_PHASES
from biodance.observations.force_onset import ONSET_AFTER_STRIKE, heel_strike
from biodance.records import SIDES, Array, Mask, Motion, Trial, Wrench, runs
from biodance.registration.alignment import Forces, FramePose, with_forces_at
from biodance.spatial import cross, quaternion_matrix, wrench_about_origin, wrench_about_point, zero_moment_point
from biodance.uncertainty.tolerances import Tolerances

_SHORTEST_STEP, _LONGEST_STEP = 0.3, 1.6
"""s: a walking step."""
_OVERHANG = 0.02
"""m by which a sole may reach beyond the edge of its plate."""
_FORTH = 0.45
"""Where the pressure of a foot that lands on its heel begins, in lengths from heel to toe marker, at most."""


@dataclass(frozen=True, eq=False)
class PlateStep:
    """One step on plate number ``plate`` with the foot of ``side``: ``phase`` (n,) 0 at the first contact to 1 at the
    last; centre of pressure ``place`` (n, 3) m in the room; the foot's ``forwards`` and ``outwards`` (n, 3) unit
    vectors; the pressure ``ahead`` of the heel marker and ``beside`` (n,) m, outwards positive, of its line to the toe
    marker; ``length`` m between the two; ``onset`` s after the heel's strike (NaN = not seen).
    """

    plate: int
    side: str
    phase: Array
    place: Array
    forwards: Array
    outwards: Array
    ahead: Array
    beside: Array
    length: float
    onset: float

    @property
    def heel_first(self) -> bool:
        """Whether the foot lands on its heel."""
        return bool(np.mean(self.ahead[(self.phase > 0.04) & (self.phase < 0.1)]) < _FORTH * self.length)


def plate_steps(
    trial: Trial, motion: Motion, contact: Contact, soles: Soles, forces: Forces, pose: FramePose
) -> tuple[PlateStep, ...]:
    """Return the steps of a trial that is placed by ``pose``; none without heel and toe markers."""
    if trial.markers is None or not trial.marker_set:
        return ()
    known = read_marker_set(trial.marker_set)
    found = []
    for number, plate in enumerate(forces.plates):
        recorded = plate.wrench
        for start, stop in runs(recorded.force[:, 2] > ONSET):
            # Clock of the markers.
            time = recorded.time[start:stop] - pose.delay
            cut_off = start == 0 or stop == len(recorded.time)
            covered = time[0] - 0.1 > motion.time[0] and time[-1] < motion.time[-1]
            if cut_off or not covered or not _SHORTEST_STEP <= time[-1] - time[0] <= _LONGEST_STEP:
                continue
            foot = _foot(trial, contact, soles, number, time)
            if foot is None:
                continue
            heel, toe = (landmark(trial.markers, known, f"{SIDES[foot]}_{name}") for name in ("heel", "toe"))
            if heel is not None and toe is not None:
                part = Wrench(time, pose.wrench(recorded.value[start:stop]))
                one = _step(number, foot, part, trial.plates[number].height, trial.markers.time, heel, toe)
                found += [one] if one is not None else []
    return tuple(found)


def _foot(trial: Trial, contact: Contact, soles: Soles, number: int, time: Array) -> int | None:
    """Return the foot (0 right, 1 left) that stands alone and whole on a plate in the middle of a step, or None."""
    length = time[-1] - time[0]
    middle = (contact.time > time[0] + 0.25 * length) & (contact.time < time[0] + 0.75 * length)
    # Share of the middle half of the contact in which each foot is over this plate.
    over = contact.on_plate[middle, :, number].mean(axis=0)
    alone = [foot for foot in (0, 1) if over[foot] > 0.8 and over[1 - foot] < 0.2]
    if not middle.any() or not alone:
        return None
    whole = np.nanmedian(inside(trial.plates[number], soles.outline[middle, alone[0]]), axis=0)
    return alone[0] if whole.min() > -_OVERHANG else None


def _step(
    number: int, foot: int, part: Wrench, height: float, frames: Array, heel: Array, toe: Array
) -> PlateStep | None:
    """Return one step sample by sample; None where a marker of the foot is not seen."""
    time, place = part.time, part.cop(height=height, threshold=ONSET)
    near = (frames > time[0] - 0.2) & (frames < time[-1] + 0.1)
    if not (np.isfinite(heel[near]).all() and np.isfinite(toe[near]).all()):
        return None
    path = FootPath(SIDES[foot], frames, heel, toe, toe)
    under = path.in_foot(time, place[:, :2])
    ahead, beside = under.place.T
    # (n, 2, 2) axes seen from above, with z = 0, as two (n, 3).
    forwards, outwards = np.moveaxis(np.pad(under.axes, ((0, 0), (0, 0), (0, 1))), 1, 0)
    phase = (time - time[0]) / (time[-1] - time[0])
    onset = time[0] - heel_strike(path, float(time.mean()), time[0])
    known = np.isfinite(ahead)
    phase, place, forwards, outwards, ahead, beside = (
        x[known] for x in (phase, place, forwards, outwards, ahead, beside)
    )
    length = float(np.median(under.length))
    return PlateStep(number, SIDES[foot], phase, place, forwards, outwards, ahead, beside, length, onset)


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


def together(pulls: Iterable[PoseEvidence]) -> tuple[Array, Array]:
    """Return the change (4,) of the pose that all evidence asks for, and its covariance (4, 4)."""
    some = tuple(pulls)
    # independent evidence of one change: informations and vectors add up
    covariance = np.linalg.inv(np.sum([one.information for one in some], axis=0))
    return covariance @ np.sum([one.vector for one in some], axis=0), covariance


_SOUGHT = (f"{POSITION.name} x", f"{POSITION.name} y", f"{ROTATION.name} z", DELAY.name)
"""Tolerances of an installed plate that are no tolerances here: they are what is looked for."""
_SHORTEST = 0.25
"""s: of walks over two plates no more than 0.3 to 0.9 s are fully measured."""
_UNKNOWN = np.array([0.1, 0.1, np.radians(5.0), 0.05])
"""m, m, rad, s: how far a first alignment can be off; keeps a direction that nothing shows from running away."""


def wrench_pull(body: Body, window: TrialWindow, tolerances: Tolerances, about: Array) -> PoseEvidence:
    """Return what the wrench of one trial, placed by the pose so far, says of a change of that pose about ``about``
    (3,) m.

    Raises
    ------
    TrialRefused
        No quarter of a second is fully measured and believable.
    """
    known = replace(tolerances, sizes={key: size for key, size in tolerances.sizes.items() if key not in _SOUGHT})
    put = problem(body, (window,), shortest=_SHORTEST)
    found = model(put, candidates(put), known)
    rows = put.spectrum.rows((_columns(put.cases[0], about),)).reshape(-1, 4)
    # The other rows (markers) do not feel where the plates lie.
    rows = np.concatenate([rows, np.zeros((len(put.target) - len(rows), 4))])
    # What parameters and tolerances explain is projected out (Schur complement).
    vector, information = found.posterior.score(found.white(rows))
    return PoseEvidence(
        information + np.diag(_UNKNOWN**-2.0),
        # residual + rows @ change is to vanish, hence the minus.
        -vector,
        float(found.posterior.residual @ found.posterior.residual) / len(found.posterior.y),
        put.wrench_rows,
    )


def _columns(case: Case, about: Array) -> Array:
    """Return (T, 6, 4): what one unit of x, y, yaw and delay adds to the measured wrench about the room's origin."""
    wrench = case.trial.wrench.value
    force, up = wrench[:, :3], np.array([[0.0, 0.0, 1.0]])
    out = np.zeros((len(wrench), 6, 4))
    # A shift of the plate adds shift x force to the moment.
    out[:, 3:, 0] = cross(np.array([[1.0, 0.0, 0.0]]), force)
    out[:, 3:, 1] = cross(np.array([[0.0, 1.0, 0.0]]), force)
    near = wrench_about_point(wrench, about)
    # a small turn about the vertical through `about`: both vectors change by e_z x themselves
    turned = np.concatenate([cross(up, near[:, :3]), cross(up, near[:, 3:])], axis=1)
    out[:, :, 2] = wrench_about_origin(turned, about)
    # A later clock reads at t + delay: the derivative with respect to time.
    out[:, :, 3] = np.gradient(wrench, case.motion.time, axis=0)
    return out


_ACROSS, _ALONG = tuple(ACROSS_PHASES.values()), tuple(ALONG_PHASES.values())


@dataclass(frozen=True, eq=False)
class _Row:
    """``value`` observed minus expected, its ``slope`` (4,) on the pose's change, and its errors: ``own`` sd and
    ``shared`` sd by what it is shared with.
    """

    value: float
    slope: Array
    own: float
    shared: dict[str, float]


def feet_pull(steps: tuple[PlateStep, ...], about: Array) -> PoseEvidence | None:
    """Return what the feet say of a change of the pose about ``about`` (3,) m; None without a step."""
    rows = [row for step in steps for row in _rows(step, about) if np.isfinite(row.value)]
    if not rows:
        return None
    value, slope = np.array([row.value for row in rows]), np.array([row.slope for row in rows])
    covariance = np.diag([row.own**2 for row in rows])
    for i, one in enumerate(rows):
        for j, other in enumerate(rows):  # two rows covary by the product of the sds that they share
            covariance[i, j] += sum(sd * other.shared.get(key, 0.0) for key, sd in one.shared.items())
    # Generalised least squares: value + slope @ change is to vanish, with V^-1 as weight.
    weight = np.linalg.inv(covariance)
    information, vector = slope.T @ weight @ slope, -slope.T @ weight @ value
    left = value + slope @ (np.linalg.pinv(information) @ vector)
    # chi² over its degrees of freedom.
    free = max(1, len(rows) - np.linalg.matrix_rank(slope))
    return PoseEvidence(information, vector, float(left @ weight @ left) / free, len(rows))


def _rows(step: PlateStep, about: Array) -> list[_Row]:
    """Return the observations of one step."""
    rows, heel_first = [], step.heel_first
    for number, (start, stop, expected, own, foot, laboratory) in enumerate(_ACROSS):
        if number or heel_first:
            shared = {f"{step.side} across {number}": foot, f"across {number}": laboratory}
            rows.append(_mean(step, step.beside, step.outwards, (start, stop), expected, own, shared, about))
    for number, (start, stop, share, *sds) in enumerate(_ALONG if heel_first else ()):
        own, person, laboratory = (sd * step.length for sd in sds)
        # Both parts are shared by the same rows here: one number.
        shared = {f"along {number}": float(np.hypot(person, laboratory))}
        expected = share * step.length
        rows.append(_mean(step, step.ahead, step.forwards, (start, stop), expected, own, shared, about))
    if heel_first:
        expected, own, laboratory = ONSET_AFTER_STRIKE
        # The contact is at (time of the file - delay): a later clock brings it forward.
        rows.append(_Row(step.onset - expected, np.array([0.0, 0.0, 0.0, -1.0]), own, {"onset": laboratory}))
    return rows


def _mean(
    step: PlateStep,
    values: Array,
    axis: Array,
    phase: tuple[float, float],
    expected: float,
    own: float,
    shared: dict[str, float],
    about: Array,
) -> _Row:
    """Return the mean of ``values`` (n,) along ``axis`` (n, 3) over a phase of the stance, as a row."""
    here = (step.phase >= phase[0]) & (step.phase <= phase[1])
    if not here.any():
        return _Row(np.nan, np.zeros(4), own, shared)
    arm = step.place[here] - about
    # e_z x arm: what one radian moves the pressure by.
    turned = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    along = axis[here, :2]
    # Mean displacement along the axis for x, y and yaw; the delay is left out.
    slope = np.array([*along.mean(axis=0), np.einsum("ti,ti->t", along, turned).mean(), 0.0])
    return _Row(float(values[here].mean()) - expected, slope, own, shared)


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
    # A prior of the change, centred at the present pose in every round: it damps, and holds what nobody sees.
    weak = PoseEvidence(np.diag(_ALIGNED**-2.0), np.zeros(4), 0.0, 0)
    for turn in range(3):
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
        # Never after the first round: the linearisation was at the alignment.
        if turn and (np.abs(change) < 0.1 * np.sqrt(np.diag(covariance))).all():
            break
    seconds = float(window.use.sum() / window.motion.rate) if wrench is not None else 0.0
    notes = () if wrench is not None else (f"The wrench of the whole body was not used: {why}",)
    # Beyond what the evidence knows: independent, so covariances add.
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
    # Frames within `_AROUND` of a wrong one are left out, too.
    return ~dilate(apart | (force < _PRESSED), int(np.ceil(_AROUND * window.motion.rate)))


def _honest(pull: PoseEvidence, window: TrialWindow) -> PoseEvidence:
    """Return the pull of the wrench with what its body does not know: much for real people and short contacts, and more
    where it fits badly.
    """
    with np.errstate(invalid="ignore"):
        # Root mean square over time of each marker, then the first quartile over the markers.
        away = np.nanquantile(np.sqrt(np.nanmean(window.motion.residual**2, axis=0)), 0.25)
    real = away > _LIKE_MODEL * error_size("marker_distance", "first quartile", state="after")
    longest = max((stop - start for start, stop in runs(window.use)), default=0) / window.motion.rate
    worse = max(1.0, pull.misfit)
    # Information over misfit: covariances grow with the mean square of the whitened rows.
    scaled = replace(pull, information=pull.information / worse, vector=pull.vector / worse)
    if real or longest < SHORTEST_RUN:
        few = np.array([1.0, 1.0, max(1.0, _FEW / pull.rows), 1.0])
        return scaled.less_sure(worse * np.diag((few * _REAL) ** 2))
    # Mean horizontal direction of the pelvis' x axis.
    ahead = quaternion_matrix(window.motion.q[:, 3:7])[:, :2, 0].mean(axis=0)
    forwards = np.array([*ahead / max(float(np.linalg.norm(ahead)), 1e-9), 0.0, 0.0])
    # Only along that direction: a matrix of rank one.
    return scaled.less_sure(_AHEAD**2 * np.outer(forwards, forwards))

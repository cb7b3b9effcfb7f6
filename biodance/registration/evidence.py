"""What each witness says of a plate's pose: the wrench that the body needs, and the feet, by where the pressure lies in
the foot of an ordinary step and when the heel strikes.

What steps share (a person's foot, a laboratory's way to put its toe marker) is shared in their covariance: two steps of
one foot do not halve it. Norms and standard deviations are those of the observations.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.candidates import candidates
from biodance.diagnosis.model import model
from biodance.diagnosis.problem import TrialWindow, problem
from biodance.effects import Case
from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.lab.plates.faults import DELAY, POSITION, ROTATION
from biodance.motion.contact import Contact
from biodance.motion.soles import Soles, inside
from biodance.observations import ONSET, FootPath
from biodance.observations.foot_across import ACROSS_PHASES
from biodance.observations.foot_along import ALONG_PHASES
from biodance.observations.force_onset import ONSET_AFTER_STRIKE, heel_strike
from biodance.records import SIDES, Array, Motion, Trial, Wrench, runs
from biodance.registration.pose import Forces, FramePose
from biodance.spatial import cross, wrench_about_origin, wrench_about_point
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
        covariance = np.linalg.pinv(self.information)
        change = covariance @ self.vector
        wider = np.linalg.inv(covariance + added)
        return PoseEvidence(np.asarray(wider), wider @ change, self.misfit, self.rows)


def together(pulls: Iterable[PoseEvidence]) -> tuple[Array, Array]:
    """Return the change (4,) of the pose that all evidence asks for, and its covariance (4, 4)."""
    some = tuple(pulls)
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
    rows = np.concatenate([rows, np.zeros((len(put.target) - len(rows), 4))])
    vector, information = found.posterior.score(found.white(rows))
    return PoseEvidence(
        information + np.diag(_UNKNOWN**-2.0),
        -vector,
        float(found.posterior.residual @ found.posterior.residual) / len(found.posterior.y),
        put.wrench_rows,
    )


def _columns(case: Case, about: Array) -> Array:
    """Return (T, 6, 4): what one unit of x, y, yaw and delay adds to the measured wrench about the room's origin."""
    wrench = case.trial.wrench.value
    force, up = wrench[:, :3], np.array([[0.0, 0.0, 1.0]])
    out = np.zeros((len(wrench), 6, 4))
    out[:, 3:, 0] = cross(np.array([[1.0, 0.0, 0.0]]), force)
    out[:, 3:, 1] = cross(np.array([[0.0, 1.0, 0.0]]), force)
    near = wrench_about_point(wrench, about)
    turned = np.concatenate([cross(up, near[:, :3]), cross(up, near[:, 3:])], axis=1)
    out[:, :, 2] = wrench_about_origin(turned, about)
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
        for j, other in enumerate(rows):
            covariance[i, j] += sum(sd * other.shared.get(key, 0.0) for key, sd in one.shared.items())
    weight = np.linalg.inv(covariance)
    information, vector = slope.T @ weight @ slope, -slope.T @ weight @ value
    left = value + slope @ (np.linalg.pinv(information) @ vector)
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
        shared = {f"along {number}": float(np.hypot(person, laboratory))}
        expected = share * step.length
        rows.append(_mean(step, step.ahead, step.forwards, (start, stop), expected, own, shared, about))
    if heel_first:
        expected, own, laboratory = ONSET_AFTER_STRIKE
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
    turned = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    along = axis[here, :2]
    slope = np.array([*along.mean(axis=0), np.einsum("ti,ti->t", along, turned).mean(), 0.0])
    return _Row(float(values[here].mean()) - expected, slope, own, shared)

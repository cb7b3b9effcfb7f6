"""Functional calibration: joint centres and hinge axes from how a person moves, with the static trial's answer as the
prior.

Every choice of the unknowns is a body that meets the static markers exactly. Sought is the most probable one: marker
distances over postures of the moving trials, each at its own best inverse kinematics, plus the squared distance from
the static answer. The postures are eliminated frame by frame (variable projection: Golub and Pereyra 1973, DOI
10.1137/0710036; docs/derivations.md).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.human.scaling import Scaling
from biodance.body.human.skeleton import JOINTS
from biodance.body.parts import JointError
from biodance.body.tables.error_sizes import error_size
from biodance.errors import TrialRefused
from biodance.motion.ik.inverse_kinematics import FrameStatus, solve_ik
from biodance.motion.ik.joint_unknowns import (
    HINGES,
    SIZE,
    JointUnknowns,
    contradicted,
    doubted,
    excited,
    own_centre,
    own_turn,
    own_unknowns,
    spread_postures,
)
from biodance.motion.kinematics import chains, place_jacobian, poses
from biodance.records import Array, Markers
from biodance.threads import one_thread

_ALIKE = 8.0
"""s of movement that count as one independent posture, because skin slides with the posture and neighbours err alike.
On virtual dances the places are the same from 1 to 16 s, their standard deviations are true at 8 s; in real walks of 2
s less than 1 s moves joints by decimetres.
"""
NO_FIXED_POINT = ("shoulder", "trunk")
"""Joints of which no fixed point of the trunk gives the centre: what the table says of that is added to their standard
deviations, which are then those of 12 virtual dances.
"""
_FAR = 4.5
"""Standard deviations from the static trial's place beyond which a joint is not believed (5 sessions without fault: 1.5
at most): a marker has moved since then, and pulls the joint along.
"""
_STEPS, _SMALLEST = 8, 5e-4
"""Most Gauss-Newton steps; m or rad below which a step ends the search."""


@dataclass(frozen=True, eq=False)
class FunctionalJoints:
    """``scaling`` with the joints where the movement puts them; joint -> ``moved`` m; hinge -> ``turned`` rad;
    ``errors`` of the joints that moved; ``kept`` the joints that the movement does not show; ``rms`` m, weighted marker
    distance before and after; ``notes`` say all this in plain sentences.
    """

    scaling: Scaling
    moved: Mapping[str, float]
    turned: Mapping[str, float]
    errors: tuple[JointError, ...]
    kept: tuple[str, ...]
    rms: tuple[float, float]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class CalibrationState:
    """A choice ``theta`` (37,) of the unknowns with its postures ``q`` (T, nq); ``cost``, its ``gradient`` (37,) and
    ``information`` (37, 37), movement and prior together; ``rms`` m, weighted marker distance.
    """

    theta: Array
    q: Array
    cost: float
    gradient: Array
    information: Array
    rms: float


@one_thread()
def functional_joints(scaling: Scaling, trials: Sequence[Markers]) -> FunctionalJoints:
    """Return ``scaling`` with joint centres and hinge axes from the moving ``trials`` (labels as in the marker set).

    Raises
    ------
    TrialRefused
        The trials show no marker of the body, or no frame determines a posture.
    """
    body = scaling.body()[0]
    postures = spread_postures(trials, body.markers.names)
    seconds = sum(one.time.size / one.rate for one in trials if one.time.size > 1)
    placed, (joint, far) = _placed(scaling, postures, seconds)
    if far <= _FAR:
        return placed
    near, left_out, better = _FAR, "", placed
    for name in _beside(body, joint):
        try:
            tried, (_, left) = _placed(scaling, _without(postures, name), seconds)
        except TrialRefused:  # this marker cannot be spared
            continue
        if left <= near:
            near, left_out, better = left, name, tried
    if not left_out:
        return placed
    note = (
        f"Warning: the marker {left_out} does not count in placing the joints: with it the {joint.replace('_', ' ')} "
        f"would lie "
        f"{1e3 * placed.moved[joint]:.0f} mm from the static trial's place. It seems to have moved since that trial."
    )
    errors = tuple(
        one._replace(spared=left_out, moved=placed.moved[joint]) if one.joint == joint else one for one in better.errors
    )
    without = replace(
        better.scaling,
        notes=(*better.scaling.notes, note),
        centres=replace(better.scaling.centres, errors=errors),
    )
    return replace(better, scaling=without, errors=errors, notes=(*better.notes, note))


def _without(postures: Markers, name: str) -> Markers:
    """Return the postures with one marker hidden."""
    xyz = np.array(postures.xyz)
    xyz[:, postures.names.index(name)] = np.nan
    return replace(postures, xyz=xyz)


def _placed(scaling: Scaling, postures: Markers, seconds: float) -> tuple[FunctionalJoints, tuple[str, float]]:
    """Return the joints that ``postures`` from so many ``seconds`` of movement show or contradict, and the joint that
    then lies farthest from its place.
    """
    skin = error_size("soft_tissue", "marker")
    fresh = evaluate_joints(scaling, postures, np.zeros(SIZE), None, noise=skin)
    alike = max(1.0, postures.time.size * _ALIKE / seconds)
    noise = max(skin, fresh.rms / np.sqrt(3)) * np.sqrt(alike)
    start = evaluate_joints(scaling, postures, np.zeros(SIZE), fresh.q, noise=noise)
    shown = excited(scaling.centres, start.theta, start.information)
    found = fit_joints(scaling, postures, start, shown, noise=noise)
    wrong = contradicted(found.information, found.gradient, shown)
    if wrong:
        scaling = replace(scaling, centres=doubted(scaling.centres, wrong))
        for joint in wrong:
            shown[own_unknowns(joint)] = True
        found = fit_joints(
            scaling, postures, evaluate_joints(scaling, postures, found.theta, found.q, noise=noise), shown, noise=noise
        )
    return _told(scaling, start, found, shown), _farthest(scaling, found)


def _farthest(scaling: Scaling, found: CalibrationState) -> tuple[str, float]:
    """Return the joint that lies farthest from the static trial's place, in its standard deviations, and how far."""
    off = JointUnknowns(scaling.centres).prior(found.theta)[0]
    far = {joint: float(np.linalg.norm(off[own_centre(joint)])) for joint in JOINTS}
    return max(far.items(), key=lambda pair: pair[1])


def _beside(body: Body, joint: str) -> tuple[str, ...]:
    """Return the markers on the two segments that meet in a joint."""
    chain = next(one for one in chains(body) if body.joints[one[0]].name.startswith(f"{joint}_"))
    parent = body.joints[chain[0]].parent
    meet = {0 if parent < 0 else body.joints[parent].segment, body.joints[chain[-1]].segment}
    return tuple(
        name for name, segment in zip(body.markers.names, body.markers.segment, strict=True) if segment in meet
    )


def evaluate_joints(
    scaling: Scaling, postures: Markers, theta: Array, guess: Array | None, *, noise: float
) -> CalibrationState:
    """Return the state at ``theta``: the postures of its body that come nearest to the markers, cost and derivatives.

    ``guess`` (T, nq) where to look for the postures; ``noise`` m per axis, standard deviation of a marker of weight 1
    if all postures were independent.
    """
    unknowns = JointUnknowns(scaling.centres)
    body, stand = replace(scaling, centres=unknowns.moved(theta)).body()
    found = solve_ik(body, postures, guess=guess)
    solved = found.status == FrameStatus.SOLVED
    q = found.q[solved]
    pose, segment = poses(body, q), list(body.markers.segment)
    points = pose.points(segment, body.markers.position)
    apart = points - postures.xyz[solved]
    seen = np.isfinite(apart)
    weight = np.sqrt(body.markers.weight)[:, None] * seen / noise
    rows = weight.reshape(len(q), -1)
    residual = rows * np.where(seen, apart, 0.0).reshape(len(q), -1)
    coordinates = rows[..., None] * place_jacobian(body, pose, segment, points) * _free(body, q)[:, None]
    free = _left_open(coordinates, rows[..., None] * unknowns.slope(body, stand, pose, points, theta))
    prior, prior_slope = unknowns.prior(theta)
    gradient = np.einsum("trp,tr->p", free, residual) + prior_slope.T @ prior
    information = np.einsum("trp,trs->ps", free, free, optimize=True) + prior_slope.T @ prior_slope
    cost = 0.5 * float(np.sum(residual**2) + prior @ prior)
    rms = float(np.sqrt(3 * np.sum(residual**2) / np.sum(rows**2)))
    return CalibrationState(theta, found.q, cost, gradient, information, rms)


def _free(body: Body, q: Array) -> NDArray[np.bool_]:
    """Return (T, nv) False where a joint is at a limit."""
    angle = q[:, body.nq - len(body.joints) :]
    inside = (angle > body.limits.lower) & (angle < body.limits.upper)
    return np.concatenate([np.ones((len(q), body.n_root), dtype=bool), inside], axis=1)


def _left_open(coordinates: Array, slope: Array) -> Array:
    """Return what of ``slope`` (T, r, p) no change of the ``coordinates`` (T, r, nv) can undo, frame by frame."""
    transposed = np.swapaxes(coordinates, 1, 2)
    square = transposed @ coordinates
    size = np.einsum("tii->t", square)[:, None, None] / square.shape[1]
    return np.asarray(
        slope - coordinates @ np.linalg.solve(square + 1e-9 * size * np.eye(square.shape[1]), transposed @ slope)
    )


def fit_joints(
    scaling: Scaling, postures: Markers, start: CalibrationState, shown: NDArray[np.bool_], *, noise: float
) -> CalibrationState:
    """Return the minimum over the ``shown`` unknowns: Gauss-Newton, steps halved where the cost would rise."""
    at, chosen = start, np.flatnonzero(shown)
    if not chosen.size:
        return at
    for _ in range(_STEPS):
        step = np.zeros(SIZE)
        step[chosen] = -np.linalg.solve(at.information[np.ix_(chosen, chosen)], at.gradient[chosen])
        while np.abs(step).max() > _SMALLEST:
            new = evaluate_joints(scaling, postures, at.theta + step, at.q, noise=noise)
            if new.cost < at.cost:
                break
            step = step / 2
        else:
            break
        at = new
    return at


def _told(
    scaling: Scaling, start: CalibrationState, found: CalibrationState, shown: NDArray[np.bool_]
) -> FunctionalJoints:
    """Return the result with its notes."""
    deviation = np.sqrt(np.diag(np.linalg.inv(found.information)))
    kept = tuple(joint for joint in JOINTS if not shown[own_centre(joint)].any())
    moved = {joint: float(np.linalg.norm(found.theta[own_centre(joint)])) for joint in JOINTS if joint not in kept}
    axis = {hinge: float(deviation[own_turn(hinge)]) for hinge in HINGES}
    wrong = scaling.centres.contradicted
    errors = tuple(
        JointError(joint, _centre_sd(joint, deviation), axis.get(joint, 0.0), joint in wrong, far)
        for joint, far in moved.items()
    )
    turned = {hinge: float(found.theta[own_turn(hinge)]) for hinge in HINGES if hinge not in kept}
    notes = []
    if moved:
        turns = {hinge: f" and {abs(np.degrees(angle)):.0f} deg" for hinge, angle in turned.items()}
        each = [f"{joint.replace('_', ' ')} {1e3 * far:.0f} mm{turns.get(joint, '')}" for joint, far in moved.items()]
        fits = f"{len(found.q)} postures, marker distance {1e3 * start.rms:.1f} -> {1e3 * found.rms:.1f} mm"
        notes.append(
            f"Joints placed by movement ({fits}), from the static trial's place, axis turned: {', '.join(each)}."
        )
    if kept:
        names = ", ".join(joint.replace("_", " ") for joint in kept)
        notes.append(f"Joints that the movement does not show, kept where the static trial puts them: {names}.")
    notes += [_contradiction(joint, moved[joint]) for joint in wrong]
    centres = replace(JointUnknowns(scaling.centres).moved(found.theta), errors=errors)
    placed = replace(scaling, centres=centres, notes=(*scaling.notes, *notes))
    return FunctionalJoints(placed, moved, turned, errors, kept, (start.rms, found.rms), tuple(notes))


def _contradiction(joint: str, far: float) -> str:
    """Return what is said of a joint that the movement puts ``far`` m away from the static trial's place."""
    return (
        f"Warning: the movement contradicts the static trial about the {joint.replace('_', ' ')}: it turns about a "
        f"point {1e3 * far:.0f} mm away, and is placed there. Check the markers from which the static trial placed it."
    )


def _centre_sd(joint: str, deviation: Array) -> float:
    """Return the standard deviation of a centre per axis, m (root mean square), from those of the unknowns (37,)."""
    return float(np.hypot(np.sqrt(np.mean(deviation[own_centre(joint)] ** 2)), fixed_point(joint)))


def fixed_point(joint: str) -> float:
    """Return what no fixed point can give of a joint's centre, m per axis."""
    kind = joint.split("_")[-1]
    return error_size("fixed_point", kind, state="after") if kind in NO_FIXED_POINT else 0.0

"""The fit behind a functional calibration: the postures nearest to the markers of a movement for every choice of the
unknowns, and what of the markers no posture can undo. The postures are eliminated frame by frame (variable projection:
Golub and Pereyra 1973, DOI 10.1137/0710036; docs/derivations.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.body.human.scaling import Scaling
from biodance.body.human.skeleton import JOINTS
from biodance.body.human.static_centres import Centres
from biodance.body.tables.error_sizes import error_size
from biodance.errors import TrialRefused
from biodance.motion.ik.inverse_kinematics import FrameStatus, solve_ik
from biodance.motion.ik.joint_unknowns import FAULTY, SIZE, JointUnknowns, doubted
from biodance.motion.kinematics import Poses, neighbours, place_jacobian, poses
from biodance.records import Array, Index, Markers


def with_slides(body: Body, products: Array, angles: Array, kept: Index) -> tuple[Array, Array, Array]:
    """Return X'X (p, p), S'X (s, p) and S'S (s, s) of the rows X = [markers, others] of T postures and their slides S.

    Parameters
    ----------
    body : Body
        Whose markers slide.
    products : (T, p, p) array
        X'X of each posture; the first 3 K columns are the K markers along the axes of their segments, 1/m.
    angles : (T, n) array
        Joint angles from the static posture, rad.
    kept : (K,) array
        Which markers of the body these are.

    Returns
    -------
    tuple of arrays
        A slide is a marker's column times an angle beside its segment. Its row of posture t is the marker's own times
        angle(t), so that S'S is the sum over t of products(t) times two angles: block by block of markers that share a
        segment, and so their angles.
    """
    on, beside = np.array(body.markers.segment)[kept], neighbours(body) > 0
    blocks = [(np.flatnonzero(np.repeat(on, 3) == one), angles[:, beside[:, one]]) for one in np.unique(on)]
    # Moments with the angles: sum over t of angle[t, n] X'X[t, own, :].
    shared = [np.tensordot(turn, products[:, own], axes=(0, 0)) for own, turn in blocks]
    square: list[list[Array]] = []
    for k, (own, turn) in enumerate(blocks):
        row = [above[k].T for above in square]  # S'S is symmetric
        for others, other in blocks[k:]:
            pairs = (turn[:, :, None] * other[:, None]).reshape(len(angles), -1)
            block = np.tensordot(pairs, products[:, own][:, :, others], axes=(0, 0))
            block = block.reshape(turn.shape[1], other.shape[1], own.size, others.size)
            # Angles first, then columns, as in `shared`.
            row.append(block.transpose(0, 2, 1, 3).reshape(turn.shape[1] * own.size, -1))
        square.append(row)
    return (
        products.sum(axis=0),
        np.concatenate([one.reshape(-1, products.shape[2]) for one in shared]),
        np.block(square),
    )


def without_slides(square: Array, shared: Array, own: Array, noise: float) -> Array:
    """Return the products ``square`` (p, p) of rows of variance ``noise`` without slides: ``own`` (s, s) of these,
    ``shared`` (s, p) with the rows.
    """
    # Prior N(0, s²) of a slide, in the units of rows with variance `noise`.
    inner = own + noise * error_size("slide", "marker") ** -2 * np.eye(len(own))
    # Schur complement: X'X - X'S (S'S + noise / s²)^-1 S'X.
    return np.asarray((square - shared.T @ np.linalg.solve(inner, shared)) / noise)


# With theta the free unknowns at the found minimum, g and H gradient and information of the cost there, P the
# information of the prior alone, the logarithm of the evidence is (Laplace; Bishop 2006, section 4.4)
#
#     -cost + 1/2 g' H^-1 g - 1/2 log |H| + 1/2 log |P|,
#
# once as everything is believed to be, and once with the prior of a fault about one joint, or with one marker free to
# lie elsewhere on its segment.

_MORE_PROBABLE = 10.0
"""Natural logarithm by which a joint elsewhere, or a marker that has moved, must make the markers of a movement more
probable (34 sessions of an independent laboratory and ten real ones without fault: 3.3 at most; hips, knees and markers
60 to 120 mm off, three people: 11 to 65).
"""


@dataclass(frozen=True, eq=False)
class MarkerSlopes:
    """What the markers of a movement say of their own places: ``names`` (K); per metre along the three axes of its
    segment each, ``gradient`` (3K,) and ``information`` (3K, 3K) of the cost, and ``shared`` (3K, p) with the unknowns
    of the joints.
    """

    names: tuple[str, ...]
    gradient: Array
    information: Array
    shared: Array


@dataclass(frozen=True)
class _Elsewhere:
    """A ``joint`` or a ``marker`` (the other one is "") that lies elsewhere, with its log Bayes factor."""

    log_bayes_factor: float
    joint: str = ""
    marker: str = ""


def elsewhere(
    scaling: Scaling,
    theta: Array,
    cost: tuple[Array, Array],
    markers: MarkerSlopes,
) -> _Elsewhere | None:
    """Return what most probably lies elsewhere; None where nothing is more probable by `_MORE_PROBABLE`.

    ``theta`` (37,) the unknowns found, ``cost`` its gradient (37,) and information (37, 37) there.
    """
    wrong = scaling.centres.contradicted
    found = [_Elsewhere(_joint(scaling.centres, theta, cost, one), joint=one) for one in JOINTS if one not in wrong]
    free = JointUnknowns(scaling.centres).free
    found += [_Elsewhere(value, marker=name) for name, value in _markers(cost, markers, free).items()]
    best = max(found, key=lambda one: one.log_bayes_factor)
    return best if best.log_bayes_factor >= _MORE_PROBABLE else None


def _joint(centres: Centres, theta: Array, cost: tuple[Array, Array], joint: str) -> float:
    """Return the log Bayes factor of a fault at a joint."""
    gradient, information = cost
    sound, wrong = JointUnknowns(centres), JointUnknowns(doubted(centres, (*centres.contradicted, joint)))
    usual, faulty = sound.prior(theta), wrong.prior(theta)
    # Gradient and information with another prior: the old prior's part out, the new one's in.
    moved = (
        gradient + faulty[1].T @ faulty[0] - usual[1].T @ usual[0],
        information + faulty[1].T @ faulty[1] - usual[1].T @ usual[1],
    )
    return _evidence(*moved, faulty, wrong.free) - _evidence(*cost, usual, sound.free)


def _evidence(gradient: Array, information: Array, prior: tuple[Array, Array], free: Index) -> float:
    """Return the logarithm of the evidence up to the part of the cost that no prior changes."""
    own, pull = np.ix_(free, free), gradient[free]
    before = (prior[1].T @ prior[1])[own]
    # log|P| of the prior over log|H| of the posterior, free unknowns alone.
    volume = np.linalg.slogdet(before)[1] - np.linalg.slogdet(information[own])[1]
    # g'H^-1 g / 2: how far the cost would fall in a Newton step of the free unknowns.
    gain = pull @ np.linalg.solve(information[own], pull)
    return float(0.5 * (gain + volume - prior[0] @ prior[0]))


def _markers(cost: tuple[Array, Array], markers: MarkerSlopes, free: Index) -> dict[str, float]:
    """Return the log Bayes factor of every marker that has moved against one that sits as all do on a moving body, the
    ``free`` unknowns of the joints and the places of all other markers adapting: a heel marker that is 5 mm off turns
    the foot, and its toe marker then seems to lie 30 mm off.
    """
    gradient, information = cost
    usual = error_size("marker_misplaced", "other") ** -2
    moved = (FAULTY * error_size("soft_tissue", "marker")) ** -2
    inner = np.linalg.solve(
        information[np.ix_(free, free)], np.column_stack([markers.shared[:, free].T, gradient[free]])
    )
    # Schur complement: the joints' unknowns adapt to markers that lie elsewhere.
    pull = markers.gradient - markers.shared[:, free] @ inner[:, -1]
    left = markers.information - markers.shared[:, free] @ inner[:, :-1]
    covariance: Array = np.linalg.inv(left + usual * np.eye(len(left))).astype(float)
    place = covariance @ pull
    return {
        name: _wider(covariance[own, own], place[own], usual, moved)
        for name, own in ((name, slice(3 * k, 3 * k + 3)) for k, name in enumerate(markers.names))
    }


def _wider(covariance: Array, place: Array, usual: float, moved: float) -> float:
    """Return the log Bayes factor of the prior precision ``moved`` of a marker's place against the ``usual`` one, under
    which it has the posterior mean ``place`` (3,) and ``covariance`` (3, 3).
    """
    precision = np.linalg.inv(covariance)
    # Natural parameter and information of the data alone: the prior's mean is zero.
    pull, told = precision @ place, precision - usual * np.eye(3)

    def evidence(prior: float) -> float:
        whole = told + prior * np.eye(3)
        return 0.5 * float(pull @ np.linalg.solve(whole, pull) + 3 * np.log(prior) - np.linalg.slogdet(whole)[1])

    return evidence(moved) - evidence(usual)


_STEPS, _SMALLEST = 8, 5e-4  # Most Gauss-Newton steps; m or rad below which a step ends the search


@dataclass(frozen=True, eq=False)
class CalibrationState:
    """A choice ``theta`` (37,) of the unknowns with its postures ``q`` (T, nq), of which the ``solved`` (T,) count;
    ``cost``, its ``gradient`` (37,) and ``information`` (37, 37), movement and prior together; ``rms`` m, weighted
    marker distance.
    """

    theta: Array
    q: Array
    solved: NDArray[np.bool_]
    cost: float
    gradient: Array
    information: Array
    rms: float


def spread_postures(trials: Sequence[Markers], names: tuple[str, ...]) -> Markers:
    """Return up to ``POSTURES`` frames, evenly from all trials; NaN where a trial lacks a marker."""
    shown = [one.seen[:, [name in names for name in one.names]].any(axis=1) for one in trials]
    frames = np.flatnonzero(np.concatenate(shown)) if shown else np.empty(0, dtype=int)
    if not frames.size:
        raise TrialRefused(
            "No moving trial shows a marker of the body, so its joints stay where the static trial puts them."
        )
    # At most 150 postures, evenly from all moving trials together.
    frames = frames[np.linspace(0, frames.size, min(150, frames.size), endpoint=False).astype(int)]
    xyz, first = np.full((frames.size, len(names), 3), np.nan), 0
    for one in trials:
        own = (frames >= first) & (frames < first + one.time.size)
        for place, name in enumerate(names):
            if name in one:
                xyz[own, place] = one[name][frames[own] - first]
        first += one.time.size
    return Markers(names, np.arange(frames.size) / 100.0, xyz)


def evaluate_joints(
    scaling: Scaling, postures: Markers, theta: Array, guess: Array | None, *, noise: float
) -> CalibrationState:
    """Return the state at ``theta``: the postures of its body that come nearest to the markers, cost and derivatives.

    ``guess`` (T, nq) where to look for the postures; ``noise`` m per axis, standard deviation of a marker of weight 1
    if all postures were independent.
    """
    unknowns = JointUnknowns(scaling.centres)
    body, stand = scaling.with_centres(unknowns.moved(theta))
    found = solve_ik(body, postures, guess=guess)
    solved = np.asarray(found.status == FrameStatus.SOLVED)
    at = _Linear.of(body, postures, found.q, solved, noise=noise)
    # Variable projection: only what no change of the posture undoes is a slope of the unknowns.
    free = at.left_open(unknowns.slope(body, stand, at.pose, at.points, theta))
    prior, prior_slope = unknowns.prior(theta)
    # sum over frames t and rows r of free[t, r, p] residual[t, r].
    gradient = np.einsum("trp,tr->p", free, at.residual) + prior_slope.T @ prior
    information = np.einsum("trp,trs->ps", free, free, optimize=True) + prior_slope.T @ prior_slope
    cost = 0.5 * float(np.sum(at.residual**2) + prior @ prior)
    # Rows hold sqrt(weight) / noise: the weighted mean square per coordinate, times three axes.
    rms = float(np.sqrt(3 * np.sum(at.residual**2) / np.sum(at.rows**2)))
    return CalibrationState(theta, found.q, solved, cost, gradient, information, rms)


def beside_sliding_skin(
    scaling: Scaling, postures: Markers, found: CalibrationState, *, noise: float, alike: float
) -> tuple[tuple[Array, Array], MarkerSlopes]:
    """Return gradient (37,) and information (37, 37) of the cost at ``found``, and what the ``postures`` say there of
    the place of every marker that counts, both beside skin that slides over bone: whatever goes with the angles beside
    a marker's segment, counted from the static posture, is neither a joint elsewhere nor a marker that has moved. A
    shoulder marker rides up with the arm, by as much in every second of a dance with raised arms.

    With the slides S (whitened, of unknown size with the standard deviation s m/rad of `sizes.csv`) taken out of the
    rows X of everything else, X'X becomes X'X - X'S (S'S + 1/s²)^-1 S'X. The ``noise`` (m per axis) of the joints' fit
    holds the slides as well: what these leave is the noise here, as ``alike`` in neighbouring postures.
    """
    unknowns = JointUnknowns(scaling.centres)
    body, stand = scaling.with_centres(unknowns.moved(found.theta))
    at = _Linear.of(body, postures, found.q, found.solved, noise=noise)
    joints = at.left_open(unknowns.slope(body, stand, at.pose, at.points, found.theta))
    kept = np.flatnonzero(body.markers.weight > 0)
    # Columns: places of the markers, joints, and the residual as the last, so that one product holds all.
    rows = np.concatenate([at.left_open(_places(body, at.pose, kept)), joints, at.residual[..., None]], axis=2)
    angles = (found.q[found.solved] - stand)[:, body.nq - len(body.joints) :]
    every, shared, own = with_slides(body, np.swapaxes(rows, 1, 2) @ rows, angles, kept)
    # Squares left over degrees of freedom: coordinates seen less those of the postures.
    left = without_slides(every, shared, own, 1.0)[-1, -1] / (np.count_nonzero(at.rows) - len(angles) * body.nv)
    square = without_slides(every, shared, own, float(left) * alike)
    each = 3 * len(kept)
    prior, slope = unknowns.prior(found.theta)
    of_joints = slice(each, each + SIZE)
    cost = square[of_joints, -1] + slope.T @ prior, square[of_joints, of_joints] + slope.T @ slope
    names = tuple(body.markers.names[marker] for marker in kept)
    return cost, MarkerSlopes(names, square[:each, -1], square[:each, :each], square[:each, of_joints])


def _places(body: Body, pose: Poses, kept: Index) -> Array:
    """Return (T, 3M, 3K): how the markers move per metre of each of the K ``kept`` along the axes of its segment."""
    own = np.zeros((len(pose.rotation), len(body.markers.names), 3, len(kept), 3))
    for place, marker in enumerate(kept):
        own[:, marker, :, place] = pose.rotation[:, body.markers.segment[marker]]
    return own.reshape(len(own), -1, 3 * len(kept))


@dataclass(frozen=True, eq=False)
class _Linear:
    """The markers of T postures about a body: its ``pose``, ``points`` (T, K, 3) m; whitened ``rows`` (T, 3K) 1/m,
    ``residual`` (T, 3K) and its change with the ``coordinates`` (T, 3K, nv).
    """

    pose: Poses
    points: Array
    rows: Array
    residual: Array
    coordinates: Array

    @classmethod
    def of(cls, body: Body, postures: Markers, q: Array, solved: NDArray[np.bool_], *, noise: float) -> "_Linear":
        """Return the ``solved`` ones of the postures ``q`` (T, nq)."""
        pose, segment = poses(body, q[solved]), list(body.markers.segment)
        points = pose.points(segment, body.markers.position)
        apart = points - postures.xyz[solved]
        seen = np.isfinite(apart)
        rows = (np.sqrt(body.markers.weight)[:, None] * seen / noise).reshape(len(points), -1)
        residual = rows * np.where(seen, apart, 0.0).reshape(len(points), -1)
        place, angle = place_jacobian(body, pose, segment, points), q[solved, body.nq - len(body.joints) :]
        # A joint at its limit cannot undo anything.
        place[..., body.n_root :] *= ((angle > body.limits.lower) & (angle < body.limits.upper))[:, None]
        return cls(pose, points, rows, residual, rows[..., None] * place)

    def left_open(self, slope: Array) -> Array:
        """Return what of ``slope`` (T, 3K, p) of the points no change of the coordinates can undo, whitened."""
        slope, transposed = self.rows[..., None] * slope, np.swapaxes(self.coordinates, 1, 2)
        square = transposed @ self.coordinates
        # Ridge in proportion to the mean square: coordinates that no marker moves.
        size = np.einsum("tii->t", square)[:, None, None] / square.shape[1]
        undone = np.linalg.solve(square + 1e-9 * size * np.eye(square.shape[1]), transposed @ slope)
        return np.asarray(slope - self.coordinates @ undone)


def fit_joints(scaling: Scaling, postures: Markers, start: CalibrationState, *, noise: float) -> CalibrationState:
    """Return the minimum over the free unknowns: Gauss-Newton, steps halved where the cost would rise."""
    at, chosen = start, JointUnknowns(scaling.centres).free
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

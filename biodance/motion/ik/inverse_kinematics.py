"""Multi-body optimisation: the posture of every frame whose markers come nearest to the measured ones, joint limits
respected.

Each frame minimises its weighted squared marker distances by itself (Lu & O'Connor 1999, DOI
10.1016/S0021-9290(98)00158-4), from first guesses by its markers or from its neighbours; the other frames only serve
that guess, and stand in where a frame's own markers leave the posture open.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial, reduce
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.compiled import newton
from biodance.motion.ik.compiled.ball_step import continue_angles
from biodance.motion.ik.compiled.newton import MarkerChain, chain_of
from biodance.motion.kinematics import Chart, chart_of, place_jacobian, poses
from biodance.records import Array, Index, Markers, assign
from biodance.spatial import rigid_fit

_STEPS = 200  # Most Newton steps of a frame


@dataclass(frozen=True, eq=False)
class MarkerProblem:
    """A body against T frames of measured markers: ``segment`` (K) that carries each, ``xyz`` (T, K, 3) m (anything
    finite where hidden), ``weight`` (T, K) >= 0, zero where hidden; ``tolerance`` m, largest slope of a solved frame.
    """

    body: Body
    chain: MarkerChain
    chart: Chart
    segment: list[int]
    xyz: Array
    weight: Array
    tolerance: float

    def __post_init__(self) -> None:
        """Keep ``xyz`` as a view that nothing writes to: one type for the compiled code, whatever was given."""
        view = self.xyz.view()
        view.flags.writeable = False
        assign(self, xyz=view)


class Minimum(NamedTuple):
    """What was reached: ``q`` (B, nq); ``cost`` (B,) m²; largest ``slope`` (B,) m."""

    q: Array
    cost: Array
    slope: Array

    def part(self, frames: Index) -> "Minimum":
        """Return a copy of some frames."""
        return Minimum(self.q[frames], self.cost[frames], self.slope[frames])

    def put(self, frames: Index, part: "Minimum") -> None:
        """Replace some frames."""
        for mine, other in zip(self, part, strict=True):
            mine[frames] = other


def marker_problem(body: Body, columns: list[int], xyz: Array, *, tolerance: float) -> MarkerProblem:
    """Return the problem of the body's markers ``columns`` (K) against ``xyz`` (T, K, 3) m, NaN = hidden."""
    segment = [body.markers.segment[c] for c in columns]
    seen = np.isfinite(xyz.sum(axis=2))
    return MarkerProblem(
        body=body,
        chain=chain_of(body, segment, body.markers.position[columns]),
        chart=chart_of(body),
        segment=segment,
        xyz=np.ascontiguousarray(xyz) if seen.all() else np.where(seen[:, :, None], xyz, 0.0),
        weight=seen * body.markers.weight[columns],
        tolerance=tolerance,
    )


def minimise_markers(problem: MarkerProblem, frames: Index, start: Array, *, steps: int = _STEPS) -> Minimum:
    """Return the minima of ``frames`` (F,) reached from ``start`` (F, nq) in at most ``steps`` steps."""
    count, joints = len(frames), len(problem.chain.lower)
    q = np.array(start, order="C")
    angles = q[:, q.shape[1] - joints :]
    np.clip(angles, problem.chain.lower, problem.chain.upper, out=angles)
    found = Minimum(q, np.zeros(count), np.full(count, np.inf))
    weight = np.ascontiguousarray(problem.weight)  # one type for the compiled code
    newton.minimise_frames(problem.chain, problem.xyz, weight, frames, found, problem.tolerance, steps)
    return found


def marker_distances(problem: MarkerProblem, q: Array) -> Array:
    """Return the distance (T, K) m between every marker and the model at the postures ``q`` (T, nq)."""
    out = np.empty(problem.weight.shape)
    newton.fill_distances(problem.chain, problem.xyz, q, out)
    return out


_EQUAL = 1e-9  # Share by which the costs of one posture may differ: what the tolerance of the descent leaves


def better(one: Minimum, other: Minimum) -> Minimum:
    """Return frame by frame the minimum of lower cost; of equal ones, ``one``."""
    first = one.cost <= other.cost * (1 + _EQUAL)
    return Minimum(
        np.where(first[:, None], one.q, other.q),
        np.where(first, one.cost, other.cost),
        np.where(first, one.slope, other.slope),
    )


_OTHERS = 0.01  # Weight of other segments' markers in the root's rigid fit, for where its own are hidden


def _guess_postures(problem: MarkerProblem, frames: Index, *, share: float | None) -> Array:
    """Return q (F, nq): angles at a ``share`` of their range (None: zero), the root where its markers say."""
    lower, upper = problem.chain.lower, problem.chain.upper
    angles = np.clip(np.zeros(len(lower)), lower, upper)
    if share is not None:
        with np.errstate(invalid="ignore"):  # of joints without limits
            within = (1 - share) * lower + share * upper
        angles = np.where(np.isfinite(within), within, angles)
    return _place_root(problem, frames, np.tile(angles, (len(frames), 1)))


def _place_root(problem: MarkerProblem, frames: Index, angles: Array) -> Array:
    """Return q (F, nq) with ``angles`` (F, n) rad and the root's pose that fits the rigid body best."""
    body, xyz = problem.body, problem.xyz[frames]
    if not body.n_root:
        return angles
    # The body with its root at the origin, unturned.
    root = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(angles), 1))
    model = poses(body, np.concatenate([root, angles], axis=1)).points(problem.segment, problem.chain.local)
    own = np.where(problem.chain.slot == 0, 1.0, _OTHERS) * problem.weight[frames]
    rotation, place = rigid_fit(model, xyz, own)
    return np.concatenate([place, Rotation.from_matrix(rotation).as_quat(), angles], axis=1)


_STRIDES = (64, 16, 4, 1)
"""Every 64th frame is solved from its own markers; then every 16th, 4th and each frame from those around it."""
SHARES = (0.5, None)
"""First guesses of the angles, as shares of their range (None: zero): a bent body finds straight limbs more often
than the reverse.
"""
MORE_SHARES = (0.25, 0.75)
"""Further guesses for doubtful frames, and for all first frames of a short trial."""
_SHORT = 640  # Frames below which a trial has too few neighbours to correct a frame that started wrongly
_DOUBT = (1.5, 0.001)
"""A frame is doubtful where its RMS distance exceeds the neighbours' median times the first number plus the second
(m).
"""


def search(problem: MarkerProblem, frames: Index) -> Minimum:
    """Return the minima (F frames) of ``frames`` (F,), increasing, without any guess."""
    count = len(frames)
    out = Minimum(np.zeros((count, problem.body.nq)), np.zeros(count), np.full(count, np.inf))
    known = np.zeros(0, dtype=np.intp)
    for stride in _STRIDES:
        # Coarse frames first, the last one always; those between start from what is solved around them.
        level = np.setdiff1d(np.append(np.arange(0, count, stride), count - 1), known, assume_unique=True)
        if not known.size:
            found = from_markers(problem, frames[level], SHARES if count > _SHORT else (*SHARES, *MORE_SHARES))
        elif level.size:
            found = minimise_markers(
                problem, frames[level], interpolate_postures(problem, frames[known], out.q[known], frames[level])
            )
        else:
            continue
        out.put(level, found)
        known = np.union1d(known, level)
        if stride in (_STRIDES[0], _STRIDES[-1]):
            out.put(known, _retry(problem, frames[known], out.part(known)))
    return out


def from_markers(problem: MarkerProblem, frames: Index, shares: tuple[float | None, ...]) -> Minimum:
    """Return the best of the minima reached from the first guesses at the given ``shares`` of the joint ranges."""
    return reduce(
        better, [minimise_markers(problem, frames, _guess_postures(problem, frames, share=share)) for share in shares]
    )


def from_guess(problem: MarkerProblem, frames: Index, guess: Array) -> Minimum:
    """Return the minima reached from ``guess`` (F, nq), roots first put where markers say if nearer."""
    moved = _place_root(problem, frames, guess[:, guess.shape[1] - len(problem.chain.lower) :])
    own, other = (minimise_markers(problem, frames, q, steps=0) for q in (guess, moved))
    return _retry(problem, frames, minimise_markers(problem, frames, better(own, other).q))


def _retry(problem: MarkerProblem, frames: Index, found: Minimum) -> Minimum:
    """Return ``found`` with doubtful frames tried again, from their markers and from sound frames beside."""
    # cost = 1/2 sum w r².
    rms = np.sqrt(np.maximum(2 * found.cost, 0.0) / problem.weight[frames].sum(axis=1))
    # Frames whose median fit a frame is compared with
    doubtful = rms > _DOUBT[0] * median_filter(rms, min(11, len(rms)), mode="mirror") + _DOUBT[1]
    sound, bad = np.flatnonzero(~doubtful), np.flatnonzero(doubtful)
    if not (bad.size and sound.size):
        return found
    best = better(found.part(bad), from_markers(problem, frames[bad], (*SHARES, *MORE_SHARES)))
    after = np.searchsorted(sound, bad)
    for neighbour in (sound[np.maximum(after - 1, 0)], sound[np.minimum(after, len(sound) - 1)]):
        best = better(best, minimise_markers(problem, frames[bad], found.q[neighbour]))
    out = found.part(np.arange(len(frames)))
    out.put(bad, best)
    return out


def interpolate_postures(problem: MarkerProblem, known: Index, q: Array, wanted: Index) -> Array:
    """Return postures (F, nq) at the frames ``wanted`` (F,) between the postures ``q`` (M, nq) at the frames ``known``
    (M,), increasing.

    Monotone cubics in smooth coordinates (Fritsch & Butland 1984, DOI 10.1137/0905021), the ends kept outside.
    """
    after = np.searchsorted(known, wanted, side="right")
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(known) - 1)
    near = np.where(wanted - known[before] < known[after] - wanted, before, after)
    out, inside = q[near], (wanted >= known[0]) & (wanted < known[-1])
    if inside.any():
        smooth = problem.chart.smooth(q.T).stacked()
        # One more point straight on at either end: the slope there is that of the first and of the last piece.
        time, values = (
            np.concatenate([2 * one[..., :1] - one[..., 1:2], one, 2 * one[..., -1:] - one[..., -2:-1]], axis=-1)
            for one in (known, smooth)
        )
        at = problem.chart.split(PchipInterpolator(time, values, axis=1)(wanted[inside]))
        limits = problem.chain.lower[:, None], problem.chain.upper[:, None]
        out[inside] = problem.chart.posture(at, out[inside, q.shape[1] - len(limits[0]) :].T, *limits).T
    return out


_LEVER = 0.1  # m, what one radian is compared with: one metre of root translation counts as 10 rad
_LEAST_MOTION = 0.02
"""Least share of its lever by which any unit change of posture must move the markers that it carries, for the
posture to be determined.
"""


@dataclass(frozen=True, eq=False)
class _Determination:
    """Per frame: ``determined`` (T,); ``open_coordinates`` what the best-seen frame leaves open."""

    determined: NDArray[np.bool_]
    open_coordinates: tuple[str, ...]


def determination(body: Body, columns: list[int], seen: NDArray[np.bool_]) -> _Determination:
    """Tell for every frame whether the markers seen fix every coordinate of ``body`` that is free to move.

    ``columns`` (K) indices of the markers in ``body.markers``; ``seen`` (T, K). Judged by the marker Jacobian at one
    general posture, so that the answer depends on the markers and not on the pose: with the weighted Jacobian's columns
    in units of moved weight and ``LEVER``, its smallest singular value must reach ``_LEAST_MOTION``.
    """
    free = np.concatenate([np.ones(body.n_root, dtype=bool), body.free])
    jacobian = general_jacobian(body, columns)[:, :, free]
    # Columns of rotations per `_LEVER` of arc, comparable with a translation.
    jacobian[:, :, body.n_root // 2 :] /= _LEVER
    useful = seen & (body.markers.weight[columns] > 0)
    # Long runs of frames see the same markers: one decision per pattern.
    first = np.concatenate([[True], (useful[1:] != useful[:-1]).any(axis=1)])[: len(useful)]
    patterns, which = np.unique(useful[first], axis=0, return_inverse=True)
    which = which.ravel()[np.cumsum(first) - 1]
    weight = body.markers.weight[columns] * patterns
    value = np.concatenate(
        [np.linalg.eigvalsh(_normal(jacobian, weight[i : i + 256]))[:, 0] for i in range(0, len(weight), 256)]
    )
    best = patterns.sum(axis=1).argmax()
    names = ("root x", "root y", "root z", "root rotation x", "root rotation y", "root rotation z")[: body.n_root]
    names += tuple(joint.name for joint, moves in zip(body.joints, body.free, strict=True) if moves)
    # Eigenvectors of small eigenvalues: changes of posture that the markers hardly see.
    least, vector = np.linalg.eigh(_normal(jacobian, weight[best : best + 1])[0])
    vague = (np.abs(vector[:, least < _LEAST_MOTION**2]) > 0.2).any(axis=1)
    return _Determination(
        value[which] >= _LEAST_MOTION**2, tuple(name for name, is_open in zip(names, vague, strict=True) if is_open)
    )


def _normal(jacobian: Array, weight: Array) -> Array:
    """Return (P, nv, nv) scaled normal matrices of P patterns of marker weights (P, K)."""
    # Markers that a coordinate moves at all, with their weights: its scale.
    moves = np.abs(jacobian).max(axis=1) > 0
    moved = weight @ moves
    scale = 1 / np.sqrt(np.where(moved > 0, moved, 1.0))
    # sum over markers k of weight[p, k] J_k'J_k, then scaled on both sides.
    pairs = np.swapaxes(jacobian, 1, 2) @ jacobian
    return np.asarray(np.tensordot(weight, pairs, axes=1) * scale[:, :, None] * scale[:, None])


def general_jacobian(body: Body, columns: list[int]) -> Array:
    """Return (K, 3, nv) at a general posture: how the markers of ``columns`` move, m per m and per rad."""
    angles = np.clip(0.4 + 0.2 * np.cos(1.7 * np.arange(len(body.joints))), body.limits.lower, body.limits.upper)
    pose = poses(body, np.concatenate([body.neutral[: body.nq - len(angles)], angles]))
    segment = [body.markers.segment[c] for c in columns]
    places = pose.points(segment, body.markers.position[columns])
    return np.asarray(place_jacobian(body, pose, segment, places)).reshape(len(columns), 3, body.nv)


_LEAN = 1e-3
"""Weight, per unit marker weight, of the interpolated posture in a frame whose own markers do not determine it."""


class FrameStatus(IntEnum):
    """How the posture of a frame was found."""

    SOLVED = 0
    """At the minimum, from the frame's own markers."""
    LEANING = 1
    """The frame's markers do not determine the posture: what they leave open comes from the frames before and after."""
    STOPPED = 2
    """Not at a minimum after all steps: markers and body do not fit together; look at the residuals."""


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Postures of T frames: ``q`` (T, nq); ``residual`` (T, K) m distance of marker and model, NaN = not seen;
    ``status`` (T,) ``FrameStatus``.
    """

    q: Array
    residual: Array
    status: NDArray[np.int8]
    marker_names: tuple[str, ...]


def solve_ik(body: Body, markers: Markers, *, guess: Array | None = None, tolerance: float = 1e-7) -> InverseKinematics:
    """Return the posture of ``body`` in every frame of ``markers``, matched by name; a hidden marker (NaN) has no
    weight in its frame.

    ``guess`` (T, nq) replaces the search for a start (a root that is far off is put right first); ``tolerance`` (m) is
    the largest mean marker displacement that a coordinate of a solved frame could still gain.

    Raises
    ------
    TrialRefused
        No frame shows enough markers to determine the posture; the message names the open coordinates and the missing
        markers.
    """
    names = tuple(name for name in body.markers.names if name in markers)
    columns = [body.markers.names.index(name) for name in names]
    chosen = markers.select(names)
    verdict = determination(body, columns, chosen.seen)
    if not verdict.determined.any():
        raise TrialRefused(_too_few(body, chosen, verdict.open_coordinates))
    problem = marker_problem(body, columns, chosen.xyz, tolerance=tolerance)
    own, open_frames = np.flatnonzero(verdict.determined), np.flatnonzero(~verdict.determined)
    found = search(problem, own) if guess is None else from_guess(problem, own, _checked(guess, body, chosen)[own])
    leaning = _lean(problem, own, found, open_frames)
    order = np.argsort(np.concatenate([own, open_frames]), kind="stable")
    q, slope = (np.concatenate(two)[order] for two in ((found.q, leaning.q), (found.slope, leaning.slope)))
    continue_angles(problem.chain, q)
    status = np.where(verdict.determined, FrameStatus.SOLVED, FrameStatus.LEANING).astype(np.int8)
    status[slope > tolerance] = FrameStatus.STOPPED
    residual = np.where(chosen.seen, marker_distances(problem, q), np.nan)
    residual.setflags(write=False)  # the records keep it without a copy
    return InverseKinematics(q, residual, status, names)


def _lean(problem: MarkerProblem, own: Index, found: Minimum, frames: Index) -> Minimum:
    """Solve ``frames`` with their markers and, at ``_LEAN``, all those of the posture between the ``own`` frames."""
    start = interpolate_postures(problem, own, found.q, frames)
    if not frames.size:
        return Minimum(start, np.zeros(0), np.zeros(0))
    hidden = problem.weight[frames] == 0
    stand_in = poses(problem.body, start).points(problem.segment, problem.chain.local)
    xyz, weight = problem.xyz.copy(), problem.weight.copy()
    xyz[frames] = np.where(hidden[:, :, None], stand_in, xyz[frames])
    # Hidden markers pull so weakly that they decide only what no other marker tells.
    weight[frames] = np.where(hidden, _LEAN, weight[frames])
    return minimise_markers(replace(problem, xyz=xyz, weight=weight), frames, start)


def _checked(guess: Array, body: Body, markers: Markers) -> Array:
    guess = np.asarray(guess, dtype=float)
    if guess.shape != (markers.time.size, body.nq) or not np.isfinite(guess).all():
        raise BiodanceError(
            f"The guess has shape {guess.shape}; expected ({markers.time.size}, {body.nq}), all finite. Leave it out."
        )
    return guess


def _too_few(body: Body, markers: Markers, open_coordinates: tuple[str, ...]) -> str:
    best = markers.seen.sum(axis=1).max(initial=0)
    never = [
        name
        for name in body.markers.names
        if name not in markers or not markers.seen[:, markers.names.index(name)].any()
    ]
    return (
        f"No frame shows enough markers for the posture of {body.name}: at best {best} of its "
        f"{len(body.markers.names)} markers are seen, "
        f"which leaves open: {', '.join(open_coordinates)}. Never seen: {', '.join(never) or 'none'}. "
        "Label them, or use a body without those joints."
    )


_PATIENCE = 100  # Frames between two searches from the markers alone, where the fit has become bad
_ONE = np.arange(1)


class Follower:
    """Follows one body. ``names`` (K) of its markers; ``q`` (nq,) the last posture, NaN before the first one."""

    def __init__(self, body: Body, labels: Sequence[str]) -> None:
        self.body = body
        self.names = tuple(name for name in body.markers.names if name in labels)
        self._columns = [body.markers.names.index(name) for name in self.names]
        # 1e-7 m, largest slope of a solved frame, as in `solve_ik`
        self._empty = marker_problem(body, self._columns, np.zeros((1, len(self.names), 3)), tolerance=1e-7)
        self._weight = np.asarray(body.markers.weight)[self._columns]
        self._determined: dict[bytes, bool] = {}
        self._searched = -_PATIENCE
        self._frame = 0
        self.q = np.full(body.nq, np.nan)

    def follow(self, xyz: Array) -> tuple[Array, Array, bool]:
        """Return posture (nq,), distances (K,) m (NaN = hidden) and whether the markers fix the posture, from the
        markers ``xyz`` (K, 3) m of the next frame, NaN = hidden; where they do not, the last posture stays.

        Raises
        ------
        TrialRefused
            The very first frame does not fix the posture, so that there is nothing to stay with.
        """
        problem, seen = self._problem(xyz)
        self._frame += 1
        determined = self._fixes(seen)
        if not determined:
            if np.isnan(self.q).any():
                raise TrialRefused(
                    f"The first frame shows {int(seen.sum())} of {seen.size} markers, too few to find the posture. "
                    f"Begin the stream with all markers in view."
                )
        else:
            self.q = self._descend(problem).q[0]
        return self.q, np.where(seen, marker_distances(problem, self.q[None])[0], np.nan), determined

    def warm_up(self) -> None:
        """Load what the first frame would wait for, by following the body in its neutral posture."""
        at = poses(self.body, self.body.neutral).points(self._empty.segment, self._empty.chain.local)
        if self._fixes(np.ones(len(self.names), dtype=bool)):
            self.follow(at[0])
        self.q = np.full(self.body.nq, np.nan)

    def exchange(self, xyz: Array, suspects: Sequence[str], start: Array) -> tuple[str, str, float] | None:
        """Return the pair among ``suspects`` whose exchange brings the markers ``xyz`` (K, 3) m nearest to the body,
        descending from ``start`` (nq,), and the share of squared distance that is left; None with fewer than two.
        """
        plain = minimise_markers(self._problem(xyz)[0], _ONE, start[None]).cost[0]
        best: tuple[str, str, float] | None = None
        for one, other in combinations(suspects, 2):
            i, k = self.names.index(one), self.names.index(other)
            turned = np.array(xyz)
            turned[[i, k]] = turned[[k, i]]
            # Share of the squared distance: below 1 where the exchange brings the markers nearer.
            left = float(minimise_markers(self._problem(turned)[0], _ONE, start[None]).cost[0] / plain)
            best = (one, other, left) if best is None or left < best[2] else best
        return best

    def _problem(self, xyz: Array) -> tuple[MarkerProblem, NDArray[np.bool_]]:
        seen = np.asarray(np.isfinite(xyz).all(axis=1))
        at = np.ascontiguousarray(np.where(seen[:, None], xyz, 0.0))[None]
        return replace(self._empty, xyz=at, weight=(seen * self._weight)[None]), seen

    def _fixes(self, seen: NDArray[np.bool_]) -> bool:
        key = seen.tobytes()
        if key not in self._determined:
            self._determined[key] = bool(determination(self.body, self._columns, seen[None]).determined[0])
        return self._determined[key]

    def _descend(self, problem: MarkerProblem) -> Minimum:
        """Return the minimum from the last posture, or from the markers alone where that is bad or missing."""
        anew = partial(from_markers, problem, _ONE, (*SHARES, *MORE_SHARES))
        if np.isnan(self.q).any():
            return anew()
        found = minimise_markers(problem, _ONE, self.q[None])
        # cost = 1/2 sum w d², so the weighted mean square is 2 cost / sum w.
        rms = np.sqrt(2 * found.cost[0] / problem.weight.sum())
        # 0.05 m: RMS distance beyond which the descent from the last frame is distrusted
        if rms > 0.05 and self._frame - self._searched > _PATIENCE:
            self._searched = self._frame
            other = anew()
            return other if other.cost[0] < 0.8 * found.cost[0] else found
        return found

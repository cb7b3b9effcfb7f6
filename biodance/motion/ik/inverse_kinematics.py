"""Multi-body optimisation: the posture of every frame whose markers come nearest to the measured ones, joint limits
respected.

Each frame minimises its weighted squared marker distances by itself (Lu & O'Connor 1999, DOI
10.1016/S0021-9290(98)00158-4); the other frames only serve the first guess, and stand in where a frame's own markers
leave the posture open.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError, TrialRefused
from biodance.motion.ik.compiled.ball_step import continue_angles
from biodance.motion.ik.search import (
    MORE_SHARES,
    SHARES,
    MarkerProblem,
    Minimum,
    from_guess,
    from_markers,
    interpolate_postures,
    marker_distances,
    marker_problem,
    minimise_markers,
    search,
)
from biodance.motion.kinematics import place_jacobian, poses
from biodance.records import Array, Index, Markers

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
    vague = _open(_normal(jacobian, weight[best : best + 1])[0])
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


def _open(normal: Array) -> NDArray[np.bool_]:
    """Return (nv,) the coordinates that take part in a change of posture that the markers hardly see."""
    # Eigenvectors of small eigenvalues: changes that hardly move a marker.
    value, vector = np.linalg.eigh(normal)
    return (np.abs(vector[:, value < _LEAST_MOTION**2]) > 0.2).any(axis=1)


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
    ``status`` (T,) ``FrameStatus``; ``slope`` (T,) m, mean marker displacement that some coordinate could still gain;
    ``steps`` (T,) Newton steps.
    """

    q: Array
    residual: Array
    status: NDArray[np.int8]
    slope: Array
    steps: NDArray[np.intp]
    marker_names: tuple[str, ...]


def solve_ik(body: Body, markers: Markers, *, guess: Array | None = None, tolerance: float = 1e-7) -> InverseKinematics:
    """Return the posture of ``body`` in every frame of ``markers``, matched by name; a hidden marker (NaN) has no
    weight in its frame.

    ``guess`` (T, nq) replaces the search for a start (a root that is far off is put right first); ``tolerance`` (m) is
    the largest ``slope`` of a solved frame.

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
    q, slope, steps = (
        np.concatenate([a, b])[order]
        for a, b in ((found.q, leaning.q), (found.slope, leaning.slope), (found.steps, leaning.steps))
    )
    continue_angles(problem.chain, q)
    status = np.where(verdict.determined, FrameStatus.SOLVED, FrameStatus.LEANING).astype(np.int8)
    status[slope > tolerance] = FrameStatus.STOPPED
    residual = np.where(chosen.seen, marker_distances(problem, q), np.nan)
    residual.setflags(write=False)  # the records keep it without a copy
    return InverseKinematics(q, residual, status, slope, steps, names)


def _lean(problem: MarkerProblem, own: Index, found: Minimum, frames: Index) -> Minimum:
    """Solve ``frames`` with their markers and, at ``_LEAN``, all those of the posture between the ``own`` frames."""
    start = interpolate_postures(problem, own, found.q, frames)
    if not frames.size:
        return Minimum(start, np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.intp))
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


_TOLERANCE = 1e-7  # m, largest slope of a solved frame, as in `solve_ik`
_PATIENCE = 100  # Frames between two searches from the markers alone, where the fit has become bad
_BAD = 0.05  # m: RMS distance beyond which the descent from the last frame is distrusted
_ONE = np.arange(1)


class Follower:
    """Follows one body. ``names`` (K) of its markers; ``q`` (nq,) the last posture, NaN before the first one."""

    def __init__(self, body: Body, labels: Sequence[str]) -> None:
        self.body = body
        self.names = tuple(name for name in body.markers.names if name in labels)
        self._columns = [body.markers.names.index(name) for name in self.names]
        self._empty = marker_problem(body, self._columns, np.zeros((1, len(self.names), 3)), tolerance=_TOLERANCE)
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
        if rms > _BAD and self._frame - self._searched > _PATIENCE:
            self._searched = self._frame
            other = anew()
            return other if other.cost[0] < 0.8 * found.cost[0] else found
        return found

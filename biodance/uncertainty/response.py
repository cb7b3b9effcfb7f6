"""How a trial answers small displacements: of its markers, of its centres of mass, of its segments - and the same
backwards; and what one kind of elementary error must be able to say of itself.

Markers moved by x (m) are followed by the coordinates, dq = -(J'DJ)^-1 J'D x with D the marker weights (first order
of the inverse kinematics). A displacement u (m, lab) of a segment's CoM and a turn r (rad, lab) of the segment change
the wrench that the motion needs by

    d2/dt2 (F2 y) + d/dt (F1 y) + F0 y,    y = (u, r),

from the rate of momentum and angular momentum (docs/derivations.md, section 16). F1 makes no force, and F0 y is the
moment g x (m u) of the displaced weight, whose m u are the forces of F2 y: nine functionals a frame, F2 y and the
moments of F1 y, say all. All of it is linear: `Response.wrench` goes forward, `Response.back` is its exact transpose.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.sparse import csr_array, diags_array, hstack, vstack

from biodance.body.body import Body
from biodance.body.parts import rigid_inertia
from biodance.motion.kinematics import (
    Poses,
    SegmentMotion,
    chart_of,
    place_jacobian,
    poses,
    segment_motion,
    tangent_of,
)
from biodance.records import Array, Index, Motion
from biodance.spatial import skew

TRACKING_RIDGE = 1e-6
"""Share of the mean curvature of the tracking that is added to it, so that coordinates without markers stay where
they are."""
_REACH = 100
"""Samples from an end beyond which a spline does not feel it: 2.3^-100 is 1e-36."""
_TOGETHER = 64
"""Frames worked on at once where every frame stands alone."""
_ROWS = 96
"""Rows of the derivatives taken together: as many again lie beside them."""
_NOTHING = 1e-17
"""Share of the largest coefficient below which a double cannot show what is left out."""


@dataclass(frozen=True, eq=False)
class Response:
    """How ``body`` in ``motion`` (F frames at an even rate) with its ``pose`` answers.

    ``place``, ``turn`` (F, N, 9, 3) the functionals of a segment's CoM moved and of the segment turned; ``joints``
    (F, n) how far every axis is turned (`Chart.turns`).
    """

    body: Body
    motion: Motion
    pose: Poses
    place: Array
    turn: Array
    joints: Array

    @classmethod
    def of(cls, body: Body, motion: Motion) -> "Response":
        """Return the response of ``body`` in ``motion``."""
        return cls(body, motion, poses(body, motion.q), *functionals(body, motion), chart_of(body).turns(motion.q.T).T)

    def at(self, some: slice) -> "Response":
        """Return the response in some of the frames; its `wrench` and `back` are those of a run of its own."""
        where = self.place[some], self.turn[some], self.joints[some]
        return Response(self.body, self.motion.at(some), self.pose.at(some), *where)

    def parts(self) -> Iterator[tuple[slice, "Response"]]:
        """Yield the response frame by frame, so many together that what they need stays in the cache."""
        for start in range(0, self.motion.time.size, _TOGETHER):
            some = slice(start, start + _TOGETHER)
            yield some, self.at(some)

    @cached_property
    def markers(self) -> Array:
        """(F, M, 3) m: where the model has its markers, lab."""
        return self.pose.points(self.body.markers.segment, self.body.markers.position)

    @cached_property
    def com(self) -> Array:
        """(F, N, 3) m: centres of mass of the segments, lab."""
        return self.pose.points(list(range(len(self.body.segments))), self.body.sip.com)

    @cached_property
    def J(self) -> Array:
        """(F, 3M, nv): markers per coordinate."""
        return place_jacobian(self.body, self.pose, list(self.body.markers.segment), self.markers)

    @cached_property
    def tangent(self) -> Array:
        """(F, 9, nv): the functionals of the coordinates."""
        return tangent_of(self.body, self.pose, self.com, self.place, self.turn)

    @cached_property
    def follow(self) -> Array:
        """(F, nv, 3M): coordinates per marker displacement, least squares weighted by the body's marker weights."""
        root, half = self._tracking
        return np.asarray(-np.swapaxes(root, 1, 2) @ half)

    @cached_property
    def answer(self) -> Array:
        """(F, 9, 3M): functionals per marker displacement, ``tangent @ follow`` without `follow`."""
        root, half = self._tracking
        return np.asarray(-(self.tangent @ np.swapaxes(root, 1, 2)) @ half)

    @cached_property
    def _tracking(self) -> tuple[Array, Array]:
        """Return L^-1 (F, nv, nv) of the tracking's normal matrices L L', with a ridge, and L^-1 J' D (F, nv, 3M)."""
        weighted = np.swapaxes(np.repeat(self.body.markers.weight, 3)[:, None] * self.J, 1, 2)
        normal, nv = weighted @ self.J, self.body.nv
        ridge = TRACKING_RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None, None] / nv
        root = np.linalg.inv(np.linalg.cholesky(normal + ridge * np.eye(nv)))
        return root, root @ weighted

    @cached_property
    def segments(self) -> SegmentMotion:
        """How the segments move."""
        return segment_motion(self.body, self.motion)

    def of_markers(self, moved: Array, rows: Index | slice = slice(None)) -> Array:
        """Return the functionals (F, 9, K) of model markers ``rows`` that ``moved`` (F, R, K) m."""
        return np.asarray(self.answer[:, :, rows] @ moved)

    def left(self, *moves: tuple[Array, Index]) -> Array:
        """Return what is left of all markers (F, 3M, K) m in turn where each of ``moves`` (F, R, k) m moved so many of
        the model's markers, with their rows (R,) among 3M.
        """
        follow = [self.follow[:, :, rows] @ moved for moved, rows in moves]
        left = self.J @ np.concatenate(follow or [np.empty((*self.follow.shape[:2], 0))], axis=2)
        end = 0
        for moved, rows in moves:
            end += moved.shape[2]
            left[:, rows, end - moved.shape[2] : end] += moved
        return np.asarray(left)

    def wrench(self, functional: Array) -> Array:
        """Return the wrench (F, 6, K) about the lab origin from functionals (F, 9, K)."""
        second, first = derivatives(self.motion.time.size)
        frames, _, size = functional.shape
        flat, value = functional.reshape(frames, -1), np.zeros((frames, 6 * size))
        second.add(self.motion.rate**2, flat[:, : 6 * size], value)
        first.add(self.motion.rate, flat[:, 6 * size :], value[:, 3 * size :])
        wrench = value.reshape(frames, 6, size)
        # The forces of F2 y are m u: moment g x m u, not differentiated.
        wrench[:, 3:] += skew(self.body.gravity) @ functional[:, :3]
        return wrench

    def back(self, weight: Array) -> Array:
        """Return what ``weight`` (F, 6, p) on the wrench weighs on functionals (F, 9, p): the transpose of `wrench`."""
        second, first = derivatives(self.motion.time.size)
        frames, _, size = weight.shape
        flat, value = weight.reshape(frames, -1), np.zeros((frames, 9 * size))
        second.add_transposed(self.motion.rate**2, flat, value[:, : 6 * size])  # transposes of F2, then F1
        first.add_transposed(self.motion.rate, flat[:, 3 * size :], value[:, 6 * size :])
        back = value.reshape(frames, 9, size)
        back[:, :3] += skew(self.body.gravity).T @ weight[:, 3:]
        return back


@dataclass(frozen=True, eq=False)
class Banded:
    """A matrix (n, n) that is zero far from its diagonal, as ``blocks`` of some rows together: which rows, which
    columns, and what stands there.
    """

    blocks: tuple[tuple[slice, slice, Array], ...]

    @classmethod
    def of(cls, matrix: csr_array) -> "Banded":
        """Return a sparse matrix (n, n) as such."""
        found: list[tuple[slice, slice, Array]] = []
        for start in range(0, count := matrix.shape[0], _ROWS):
            rows = slice(start, min(start + _ROWS, count))
            at = matrix.indices[matrix.indptr[rows.start] : matrix.indptr[rows.stop]]
            columns = slice(int(at.min(initial=rows.start)), int(at.max(initial=rows.start)) + 1)
            block = matrix[rows, columns].toarray()
            same = bool(found) and np.array_equal(block, found[-1][2])  # the middle rows are one, moved along
            found.append((rows, columns, found[-1][2] if same else block))
        return cls(tuple(found))

    def add(self, size: float, values: Array, out: Array) -> None:
        """Add ``size`` times the matrix times ``values`` (n, m) to ``out`` (n, m)."""
        for rows, columns, block in self.blocks:
            out[rows] += (size * block) @ values[columns]

    def add_transposed(self, size: float, values: Array, out: Array) -> None:
        """Add ``size`` times the transposed matrix times ``values`` (n, m) to ``out`` (n, m)."""
        for rows, columns, block in self.blocks:
            out[columns] += (size * block.T) @ values[rows]


@lru_cache(maxsize=32)
def derivatives(count: int) -> tuple[Banded, Banded]:
    """Return (n, n) twice: second and first derivative, at ``count`` samples one unit apart, of the quintic spline
    through them.

    A sample's influence on the spline falls by a factor of 2.3 per sample: rows farther than `_REACH` from both ends
    are one row, moved along.
    """
    some = min(count, 2 * _REACH + 1)
    time = np.arange(some, dtype=float)
    spline = make_interp_spline(time, np.eye(some), k=min(5, some - 1))
    second, first = (Banded.of(_lengthened(spline.derivative(order)(time), count)) for order in (2, 1))
    return second, first


def _lengthened(rows: Array, count: int) -> csr_array:
    """Return the rows (m, m) of a short series for ``count`` samples: the middle one moves along."""
    rows = np.where(np.abs(rows) > _NOTHING * np.abs(rows).max(), rows, 0.0)
    more = count - len(rows)
    if not more:
        return csr_array(rows)
    first, last = csr_array(rows[:_REACH]), csr_array(rows[_REACH + 1 :])
    # Row j of the middle has the same numbers from column j on (Toeplitz).
    middle = diags_array(list(rows[_REACH]), offsets=range(len(rows)), shape=(more + 1, count))
    first.resize((_REACH, count))
    last = hstack([csr_array((_REACH, more)), last])
    return csr_array(vstack([first, middle, last]))


def functionals(body: Body, motion: Motion) -> tuple[Array, Array]:
    """Return (F, N, 9, 3) twice: F2 and the moments of F1 of a displacement of a segment's CoM (m, lab) and of a turn
    of the segment (rad, lab).
    """
    move = segment_motion(body, motion)
    frames, count = motion.time.size, len(body.segments)
    mass = body.sip.mass[:, None, None]
    com = (move.rotation @ body.sip.com[..., None])[..., 0] + move.position
    central = np.array([rigid_inertia(one).inertia for one in body.sip.phi.reshape(-1, 10)])
    inertia = move.rotation @ central @ np.swapaxes(move.rotation, -1, -2)
    spin = (inertia @ move.angular_velocity[..., None])[..., 0]
    whirl = skew(move.angular_velocity)
    place, turn = np.zeros((2, frames, count, 9, 3))
    place[:, :, :3] = mass * np.eye(3)
    place[:, :, 3:6] = mass * skew(com)
    place[:, :, 6:] = -2 * mass * skew(np.gradient(com, 1.0 / motion.rate, axis=0))
    turn[:, :, 3:6] = inertia
    # -L x r - I' r with I' = [w]x I - I [w]x, the rate of the inertia in lab axes.
    turn[:, :, 6:] = -skew(spin) - (whirl @ inertia - inertia @ whirl)
    return place, turn


@dataclass(frozen=True, eq=False)
class ErrorSource(ABC):
    """One kind of error of ``body``: K elementary errors of unit size."""

    body: Body

    @property
    @abstractmethod
    def groups(self) -> tuple[str, ...]:
        """(K,) kind and place of every error, sides alike, as in the table of sizes: ``slide thigh``."""

    @property
    def joints(self) -> tuple[str, ...]:
        """(K,) the joint of the body that every error belongs to, ``right_hip``; "" for errors of skin and flesh."""
        return ("",) * len(self.groups)

    @abstractmethod
    def functional(self, trial: Response) -> Array:
        """Return the functionals (F, 9, K) of the wrench of every error in a trial."""

    @abstractmethod
    def residual(self, trial: Response) -> Array:
        """Return the mean residual (M, 3, K) m of every marker, model less measured, in segment axes."""

    def transpose(self, trial: Response, back: Array) -> Array:
        """Return (K, p): sum over time of what ``back`` (F, 9, p) weighs on functionals, times those of every
        error.
        """
        # sum over frames and functionals: [f, i, k] with [f, i, p] to [k, p].
        return np.tensordot(self.functional(trial), back, axes=((0, 1), (0, 1)))

    @abstractmethod
    def squares(self, trial: Response) -> Array:
        """Return (K,) mean square distance (m²) between markers and model that every error leaves."""


def in_segments(trial: Response, residual: Array) -> Array:
    """Return residuals (F, 3M, K) of the markers in the axes of their segments, (F, M, 3, K)."""
    worn = list(trial.body.markers.segment)
    back = np.swapaxes(trial.pose.rotation[:, worn], -1, -2)
    return np.asarray(back @ residual.reshape(*back.shape[:3], -1))

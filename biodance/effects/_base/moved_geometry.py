"""What a small change of the body's geometry does: to the tracked posture, exactly to first order and without tracking
again, and by it to the wrench.

Posture: the tracked one makes the cost C = 1/2 sum w |p - m|² stationary. When the geometry changes by a parameter, so
does the gradient g, and the posture follows by dq = -H^-1 dg (implicit function theorem), with H the exact second
derivatives (docs/derivations.md, "Sensitivity of the posture"). The coordinates are the lab-frame tangent of
`kinematics.jacobian`: root place, root turn, angles. H is inverted once per frame and serves every cause.

Wrench: with places c, velocities c', spins w, inertias I and masses m of the segments, and their displacements d and
turns r (lab frame), the ground wrench changes by

    force = P'',   moment = Q'' + S' - P x g,
    P = sum m d,   Q = sum m c x d + I r,   S = sum 2 m d x c' + r x (I w) - (w x I - I w x) r,

so that nine numbers per frame carry everything, and only they are filtered and differentiated (docs/derivations.md,
"Moved matter").
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from biodance.body.body import Body
from biodance.body.parts import TENSOR
from biodance.lab.prepare import LowPass, low_pass
from biodance.motion.kinematics import Poses, SegmentMotion, below, place_jacobian
from biodance.records import Array
from biodance.spatial import cross, skew

AT_LIMIT = 5e-3
"""rad: a joint so near to a limit that its markers push it against is held there."""
_FRAMES = 32
"""Frames whose answers to every marker are found together: little memory."""
RIDGE = 1e-7
"""Added to H's diagonal in units of the marker weight (angles: times 0.01 m²), so that open coordinates stay where
they are.
"""


@dataclass(frozen=True, eq=False)
class PostureSensitivity:
    """F frames of a tracked body: ``pose``; ``angles`` (F, n) rad; ``segment`` (K) and ``markers`` (F, K, 3) m of the
    model; ``apart`` (F, K, 3) m weight times (model less measured), zero where hidden; ``weight`` (F, K).
    """

    body: Body
    pose: Poses
    angles: Array
    segment: tuple[int, ...]
    markers: Array
    apart: Array
    weight: Array

    @cached_property
    def distal(self) -> Array:
        """(n, K) 1 where a marker is distal to a joint."""
        return below(self.body)[:, list(self.segment)]

    @cached_property
    def axes(self) -> Array:
        """(F, 3 + n, 3) axes of all turns, lab frame: those of the root (if it is free), then the joints."""
        joints = np.stack(
            [self.pose.joint_rotation[:, j] @ joint.axis for j, joint in enumerate(self.body.joints)], axis=1
        )
        root = np.broadcast_to(np.eye(3)[: self.body.n_root // 2], (len(joints), self.body.n_root // 2, 3))
        return np.concatenate([root, joints], axis=1)

    @cached_property
    def tangent(self) -> Array:
        """(F, K, 3, nv) m per unit of every coordinate, of the model markers."""
        place = place_jacobian(self.body, self.pose, list(self.segment), self.markers)
        return place.reshape(*self.markers.shape, self.body.nv)

    @cached_property
    def inverse(self) -> Array:
        """(F, nv, nv) inverse of the second derivatives of the cost; zero rows and columns for what a limit holds."""
        H = np.empty((len(self.weight), self.body.nv, self.body.nv))
        for some in self._parts():
            # J'WJ of each frame without the products of all frames in memory at once.
            wide = self.tangent[some] * self.weight[some, :, None, None]
            flat = (len(wide), -1, self.body.nv)
            np.matmul(np.swapaxes(self.tangent[some].reshape(flat), 1, 2), wide.reshape(flat), out=H[some])
        turns = slice(self.body.n_root // 2, None)
        # The residuals' curvature makes it the exact Hessian of the tracking cost.
        H[:, turns, turns] += self._curvature()
        size = np.maximum(self.weight.sum(axis=1), 1e-3)[:, None] * np.where(
            np.arange(self.body.nv) < self.body.n_root // 2, 1.0, 0.01
        )
        held = self._held()
        # A held coordinate: row and column zero, one on the diagonal, and zero again in the inverse.
        H[:, held] = H[:, :, held] = 0.0
        diagonal = np.einsum("fii->fi", H)
        diagonal += np.where(held, 1.0, RIDGE * size)
        inverse = np.linalg.inv(H)
        inverse[:, held] = 0.0
        return np.asarray(inverse)

    def _curvature(self) -> Array:
        """Return (F, 3 + n, 3 + n): the part of H by which residuals bend the cost: a_i . (X_j - tr X_j) a_j for i
        above j, with X_j the sum of w (p - o_j) (p - m)' over what is distal to j.
        """
        root = self.body.n_root // 2
        distal = np.concatenate([np.ones((root, len(self.segment))), self.distal])
        origin = np.concatenate(
            [np.repeat(self.pose.root_position[:, None], root, axis=1), self.pose.joint_position], axis=1
        )
        # Sums over what is distal to each turn: of w (p - m), then of w p (p - m)', about the turn's origin.
        pull = distal @ self.apart
        outer = (self.markers[..., :, None] * self.apart[..., None, :]).reshape(*self.apart.shape[:2], 9)
        X = (distal @ outer).reshape(*pull.shape[:2], 3, 3) - origin[..., :, None] * pull[..., None, :]
        # (X - tr X) a for every turn, then a_i . that for all pairs.
        bent = (X @ self.axes[..., None])[..., 0] - np.einsum("fjii->fj", X)[..., None] * self.axes
        table = self.axes @ np.swapaxes(bent, 1, 2)
        above = np.triu(self._above())
        # Valid for i above j only: the lower half is the mirror of the upper.
        upper = np.where(above, table, 0.0)
        whole = upper + np.swapaxes(np.where(np.eye(len(above), dtype=bool), 0.0, upper), 1, 2)
        # Turns of a free root about one point do not commute: the rotation vector has the mean of both orders.
        whole[:, :root, :root] = 0.5 * (table + np.swapaxes(table, 1, 2))[:, :root, :root]
        return whole

    def _above(self) -> NDArray[np.bool_]:
        """Return (3 + n, 3 + n) True where the first turn carries the second one, or is it."""
        root, n = self.body.n_root // 2, len(self.body.joints)
        table = np.zeros((root + n, root + n), dtype=bool)
        table[:root] = True
        for j in range(n):
            i = j
            while i >= 0:
                table[root + i, root + j] = True
                i = self.body.joints[i].parent
        return table

    def _held(self) -> NDArray[np.bool_]:
        """Return (nv,) True where a joint rests against a limit for most of the trial, not in single frames."""
        # Gradient of the cost by each angle: J' w (p - m).
        slope = np.einsum("fkiv,fki->fv", self.tangent, self.apart)[:, self.body.n_root :]
        low, high = self.angles <= self.body.limits.lower + AT_LIMIT, self.angles >= self.body.limits.upper - AT_LIMIT
        # Pushed against: the cost would fall beyond the limit.
        pressed = (low & (slope > 0)) | (high & (slope < 0))
        return np.concatenate([np.zeros(self.body.n_root, dtype=bool), pressed.mean(axis=0) > 0.5])

    def _parts(self) -> Iterator[slice]:
        """Yield all frames, some at a time."""
        return (slice(start, start + _FRAMES) for start in range(0, len(self.weight), _FRAMES))

    def follow(self, slope: Array) -> Array:
        """Return dq (F, nv, P) of the changes ``slope`` (F, nv, P) of the cost's gradient at fixed posture."""
        # Implicit function theorem: dq = -H^-1 dg.
        return -self.inverse @ slope

    def follow_markers(self) -> Array:
        """Return dq (F, nv, 3K) per metre of every model marker's place in the axes of its segment."""
        out = np.empty((len(self.weight), self.body.nv, 3 * len(self.segment)))
        for some in self._parts():
            np.matmul(-self.inverse[some], self.marker_slopes(some), out=out[some])
        return out

    def marker_slopes(self, some: slice) -> Array:
        """Return (F, nv, 3K) of some frames: the gradient's change per metre of every model marker's place in the axes
        of its segment.
        """
        turn = self.pose.rotation[some][:, list(self.segment)]
        pushed = np.moveaxis(self.tangent[some] * self.weight[some, :, None, None], 3, 1)
        turning = np.concatenate([np.ones((self.body.n_root // 2, len(self.segment))), self.distal])
        lever = cross(self.axes[some, :, None], self.apart[some, None])  # a' [x] = (a x x)'
        # (p - m) . (a x dp) = -dp . (a x (p - m)).
        pushed[:, self.body.n_root // 2 :] -= lever * turning[:, :, None]
        return np.asarray(np.einsum("fvki,fkij->fvkj", pushed, turn, optimize=True).reshape(*pushed.shape[:2], -1))

    def joint_slopes(self, chain: tuple[int, ...], centre: Array, carried: Array) -> Array:
        """Return (F, nv, P): the gradient's change when the common origin of the joints ``chain`` moves by ``centre``
        and all that is distal to them by ``carried`` (F, 3, P) m, lab frame.
        """
        on, root = self.distal[chain[-1]] > 0, self.body.n_root // 2
        pushed = np.swapaxes((self.tangent[:, on] * self.weight[:, on, None, None]).sum(axis=1), 1, 2) @ carried
        pull = skew(self.apart[:, on].sum(axis=1))
        # x . (a x d) = -a . (x x d) with x the sum of w (p - m): for turns above the joint.
        turns = np.where(self._above()[:, root + chain[0], None], self.axes, 0.0) @ -pull @ carried
        own = [root + j for j in chain]
        # The joint's own axes move with its centre: only how far distal points move beside it counts.
        turns[:, own] = self.axes[:, own] @ -pull @ (carried - centre)
        pushed[:, root:] += turns
        return np.asarray(pushed)


_DEGREE = 5
_TOGETHER = 24
"""Changes of the geometry that are filtered and differentiated together: little memory, however many there are."""


def moved_matter(move: SegmentMotion, phi: Array, speed: Array) -> tuple[Array, Array]:
    """Return P, Q, S (F, 9, N, 3) per metre and per radian of each of N segments that move as ``move`` with the
    parameters ``phi`` (10N,); ``speed`` (F, N, 3) m/s of their CoM.
    """
    table = phi.reshape(-1, 10)
    mass = table[:, 0]
    arm = (move.rotation @ centres_of(phi)[..., None])[..., 0]
    tensor = np.empty((len(table), 3, 3))
    for column, (i, j) in enumerate(TENSOR, start=4):
        tensor[:, i, j] = tensor[:, j, i] = table[:, column]
    spin_of = move.rotation @ tensor @ np.swapaxes(move.rotation, -1, -2)
    heavy = mass[:, None, None]
    # Parallel axes from the joint to the centre of mass, in lab axes.
    central = spin_of - heavy * (
        np.sum(arm**2, axis=-1)[..., None, None] * np.eye(3) - arm[..., :, None] * arm[..., None, :]
    )
    spin = (central @ move.angular_velocity[..., None])[..., 0]
    wheel = skew(move.angular_velocity)
    unit = np.broadcast_to(heavy * np.eye(3), central.shape)
    # Rows P, Q, S per displacement d: m d, m c x d, -2 m c' x d.
    place = np.stack([unit, heavy * skew(move.position + arm), -2 * heavy * skew(speed)], axis=1)
    # Rows P, Q, S per turn r: 0, I r, -(I w) x r - (w x I - I w x) r.
    turn = np.stack([np.zeros_like(central), central, -skew(spin) - (wheel @ central - central @ wheel)], axis=1)
    by_place, by_turn = (np.moveaxis(part, 2, 3).reshape(len(part), 9, len(table), 3) for part in (place, turn))
    return by_place, by_turn


def centres_of(phi: Array) -> Array:
    """Return the centres of mass (N, 3) m in the segment frames; the origin for a segment without mass."""
    table = phi.reshape(-1, 10)
    # Infinite divisor: a segment without mass has its centre at the origin.
    return np.asarray(table[:, 1:4] / np.where(table[:, :1] != 0, table[:, :1], np.inf))


def wrench_of(nine: Array, time: Array, wanted: Array, *, smoothed: LowPass, gravity: Array) -> NDArray[np.float32]:
    """Return the change (T, 6, P) of the ground wrench about the lab origin at the even times ``wanted`` (T,) s from P,
    Q, S ``nine`` (F, 9, P) at some ``time`` (F,) s, low-passed and differentiated as the motion was (``smoothed``, see
    `biodance.motion.track`); in single precision, because they are many and large.
    """
    parts = range(0, nine.shape[2], _TOGETHER)
    out = np.empty((len(wanted), 6, nine.shape[2]), dtype=np.float32)
    for k in parts:
        out[..., k : k + _TOGETHER] = _wrench_of(nine[..., k : k + _TOGETHER], time, wanted, smoothed, gravity)
    return out


def _wrench_of(nine: Array, time: Array, wanted: Array, smoothed: LowPass, gravity: Array) -> Array:
    rough = make_interp_spline(time, nine.reshape(len(nine), -1), k=_DEGREE)(wanted)
    smooth = low_pass(rough, (len(wanted) - 1) / (wanted[-1] - wanted[0]), smoothed)
    ends = [(order, np.zeros(smooth.shape[1])) for order in (3, 4)]
    spline = make_interp_spline(wanted, smooth, k=_DEGREE, bc_type=(ends, ends))
    first, second = (spline(wanted, nu=order).reshape(len(wanted), 9, -1) for order in (1, 2))
    # Q'' + S' - P x g, written with g x P.
    moment = second[:, 3:6] + first[:, 6:] + skew(gravity) @ smooth.reshape(first.shape)[:, :3]
    return np.concatenate([second[:, :3], moment], axis=1)

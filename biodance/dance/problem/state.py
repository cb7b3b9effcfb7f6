"""What the limits judge: positions, forces and torques of samples of a motion, with their exact derivatives.

Notation: J_i (6,) is the twist of coordinate i in the lab frame (linear part at the lab origin first), V_k and A_k the
spatial velocity and acceleration of link k, x the spatial cross product. For link n and a coordinate i that moves it

    dV_n/dx_i = J_i x (V_n - V_i)                       dA_n/dx_i  = J_i x (A_n - A_i) + (V_i x J_i) x (V_n - V_i)
    dV_n/dv_i = J_i                                     dA_n/dv_i  = V_i x J_i + J_i x (V_n - V_i)

(derivation: docs/derivations.md section 12). Forces come from pinocchio's RNEA derivatives.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import load_pinocchio
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance, foot_forces
from biodance.records import Array
from biodance.spatial import spatial_cross, wrench_of_force

_Index = list[int] | NDArray[np.intp]
_OF_MOTION = ("_frames", "velocity", "acceleration", "_dynamics", "wrench", "wrench_slopes", "zmp", "zmp_slopes")
"""What of a state does not depend on which feet bear it."""


@dataclass(frozen=True, eq=False)
class State:
    """``x``, ``v``, ``a`` (T, n) coordinates of the chain and their derivatives; ``stance`` the feet, the same in all
    samples. All slopes are zero where it is not ``sloped``: a motion that is only judged needs none.
    """

    chain: Chain
    stance: Stance
    x: Array
    v: Array
    a: Array
    sloped: bool = True

    @cached_property
    def _frames(self) -> tuple[Array, Array, Array]:
        pin = load_pinocchio()
        model, data, count = self.chain.model, self.chain.data, self.chain.size
        twists = np.empty((len(self.x), count, 6))
        rotation, position = np.empty((len(self.x), count, 3, 3)), np.empty((len(self.x), count, 3))
        links, places = sorted({*self.chain.carriers}), data.oMi
        for t, x in enumerate(self.x):
            twists[t] = pin.computeJointJacobians(model, data, x).T
            for k in links:
                place = places[k + 1]
                rotation[t, k], position[t, k] = place.rotation, place.translation
        return twists, rotation, position

    @property
    def twists(self) -> Array:
        """(T, n, 6) J_i."""
        return self._frames[0]

    @cached_property
    def rotation(self) -> Array:
        """(T, N, 3, 3) lab_R_segment."""
        return self._frames[1][:, list(self.chain.carriers)]

    @cached_property
    def position(self) -> Array:
        """(T, N, 3) m origins of the segments."""
        return self._frames[2][:, list(self.chain.carriers)]

    @cached_property
    def velocity(self) -> Array:
        """(T, n, 6) V_k of every link."""
        # V_k = sum over the coordinates that move k of J_i v_i.
        return self.chain.ancestors @ (self.twists * self.v[:, :, None])

    @cached_property
    def acceleration(self) -> Array:
        """(T, n, 6) A_k of every link."""
        # dJ_i/dt = V_i x J_i.
        return self.chain.ancestors @ (
            self.twists * self.a[:, :, None] + spatial_cross(self.velocity, self.twists) * self.v[:, :, None]
        )

    def placed(self, segment: _Index, local: Array) -> Array:
        """Return positions (T, K, 3) m of points ``local`` (K, 3) of the segments (K)."""
        return np.asarray((self.rotation[:, segment] @ local[:, :, None])[..., 0] + self.position[:, segment])

    def along(self, segment: _Index, place: Array, direction: Array) -> Array:
        """Return (T, K, n) derivative by x of the places (T, K, 3) m, fixed in the segments (K), along directions (T,
        K, 3).
        """
        if not self.sloped:
            return np.zeros((*place.shape[:2], self.chain.size))
        # Dual: d · (velocity of p) = (d, p x d) · J_i.
        wrench = wrench_of_force(direction, place)
        return (wrench @ np.swapaxes(self.twists, 1, 2)) * self.chain.ancestors[np.array(self.chain.carriers)[segment]]

    def points(self, segment: list[int], local: Array) -> tuple[Array, Array]:
        """Return positions (T, K, 3) m of points ``local`` (K, 3) of the segments, and their slopes (T, K, 3, n)."""
        place = self.placed(segment, local)
        axes = np.broadcast_to(np.eye(3)[:, None, None], (3, *place.shape))
        return place, np.stack([self.along(segment, place, axis) for axis in axes], axis=2)

    @cached_property
    def _dynamics(self) -> tuple[Array, Array]:
        pin = load_pinocchio()
        model, data, n = self.chain.model, self.chain.data, self.chain.size
        force, slopes = np.empty((len(self.x), n)), np.zeros((3, len(self.x), n, n))
        for t, (x, v, a) in enumerate(zip(self.x, self.v, self.a, strict=True)):
            if not self.sloped:
                force[t] = pin.rnea(model, data, x, v, a)
                continue
            slopes[0, t], slopes[1, t], slopes[2, t] = pin.computeRNEADerivatives(model, data, x, v, a)
            force[t] = data.tau
        return force, slopes

    @property
    def force(self) -> Array:
        """(T, n) N, N·m generalised force on every coordinate without the ground."""
        return self._dynamics[0]

    @cached_property
    def still(self) -> bool:
        """True where nothing moves: a posture."""
        return not (self.v.any() or self.a.any())

    @cached_property
    def wrench(self) -> Array:
        """(T, 6) N, N·m needed from the ground, about the lab origin, force first."""
        # The ground alone holds the root: J_i'W = force_i for its six coordinates.
        return np.asarray(np.linalg.solve(self.twists[:, :ROOT], self.force[:, :ROOT, None])[..., 0])

    @cached_property
    def wrench_slopes(self) -> Array:
        """(3, T, 6, n) derivative of the wrench with respect to x, v, a."""
        if not self.sloped:
            return self._dynamics[1][:, :, :ROOT]
        inner = self._dynamics[1][:, :, :ROOT].copy()
        # J'dW = d(force) - d(J')W.
        inner[0, :, :, :ROOT] -= self.moved_twists(list(range(ROOT)), self.wrench)[:, :, :ROOT]
        return np.asarray(np.linalg.solve(self.twists[None, :, :ROOT], inner))

    @cached_property
    def zmp(self) -> Array:
        """(T, 2) m zero-moment point on the ground; at rest the projected centre of mass."""
        wrench = self.wrench
        return np.asarray(np.stack([-wrench[:, 4], wrench[:, 3]], axis=1) / wrench[:, 2:3])

    @cached_property
    def zmp_slopes(self) -> Array:
        """(3, T, 2, n) derivative of the zero-moment point with respect to x, v, a."""
        slopes = self.wrench_slopes
        turned = np.stack([-slopes[:, :, 4], slopes[:, :, 3]], axis=2)
        # Quotient rule.
        return np.asarray((turned - self.zmp[:, :, None] * slopes[:, :, None, 2]) / self.wrench[:, 2, None, None])

    def moved_twists(self, columns: list[int], wrench: Array) -> Array:
        """Return (T, k, n) derivative by x of J_k' F for the coordinates ``columns`` and a fixed wrench (T, 6)."""
        # dJ_k/dx_i = J_i x J_k for every i before k in the chain.
        swept = self.chain.ancestors[columns] - np.eye(self.chain.size)[columns]
        pairs = spatial_cross(self.twists[:, None], self.twists[:, columns, None])
        return np.einsum("tkic,tc->tki", pairs, wrench) * swept

    @property
    def alone(self) -> "State":
        """The same motion with everything on the foot over which the weight is."""
        assert self.stance.over is not None
        return self._sharing(replace(self, stance=self.stance.on(self.stance.over)), _OF_MOTION)

    @property
    def judged(self) -> "State":
        """The same motion without slopes."""
        return self._sharing(replace(self, sloped=False), ("_frames",))

    def _sharing(self, other: "State", names: tuple[str, ...]) -> "State":
        """Return the ``other`` state with what is worked out here already under these ``names``."""
        other.__dict__.update({name: self.__dict__[name] for name in names if name in self.__dict__})
        return other

    @cached_property
    def feet(self) -> tuple[Array, Array]:
        """Wrenches (T, 2, 6) of the ground on each foot about the lab origin, and their derivative (T, 2, 6, 6) by the
        total.
        """
        return foot_forces(self.wrench, self.stance)

    @cached_property
    def torque(self) -> Array:
        """(T, n - 6) N·m of the joints."""
        out = self.force.copy()
        for side in self.stance.planted:
            columns = self.chain.leg_columns[side]
            # J_k'F of its foot: what the ground takes over.
            out[:, columns] -= np.einsum("tkc,tc->tk", self.twists[:, columns], self.feet[0][:, side])
        return out[:, ROOT:]

    @cached_property
    def torque_slopes(self) -> Array:
        """(3, T, n - 6, n) derivative of the joint torques with respect to x, v, a."""
        if not self.sloped:
            return self._dynamics[1][:, :, ROOT:]
        slopes = self._dynamics[1].copy()
        for side in self.stance.planted:
            columns = self.chain.leg_columns[side]
            # Chain rule: foot by total, total by motion.
            share = self.feet[1][:, side] @ self.wrench_slopes
            slopes[:, :, columns] -= self.twists[:, columns] @ share
            slopes[0][:, columns] -= self.moved_twists(columns, self.feet[0][:, side])
        return slopes[:, :, ROOT:]


def close_legs(chain: Chain, stance: Stance, x: Array, v: Array, a: Array) -> State:
    """Return the state whose planted legs hold their feet still: angles, velocities and accelerations."""
    x, v, a = chain.plant(x, stance.planted, stance.ankle), v.copy(), a.copy()
    legs = [chain.leg_columns[side] for side in stance.planted]
    for columns in legs:
        # Zero until they are solved for below.
        v[:, columns] = a[:, columns] = 0.0
    still = State(chain, stance, x, v, a)
    if still.still:
        return still
    twists = still.twists
    for columns in legs:
        # The foot's twist is zero: J_leg v_leg = -J_root v_root.
        v[:, columns] = _solve(twists[:, columns], -np.einsum("tic,ti->tc", twists[:, :ROOT], v[:, :ROOT]))
    moving = still._sharing(State(chain, stance, x, v.copy(), a), ("_frames",))
    for columns in legs:
        # With a_leg = 0 the foot still has the acceleration A: J_leg a_leg = -A.
        a[:, columns] = _solve(twists[:, columns], -moving.acceleration[:, columns[-1]])
    return still._sharing(State(chain, stance, x, v, a), ("_frames",))


def _solve(twists: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(np.swapaxes(twists, 1, 2), right[..., None])[..., 0])


class Closure:
    """How planted legs follow the pelvis: slopes of their angles, rates and accelerations by those of the root, when
    the feet stay still.

    For each planted leg its columns and ``x`` (dx/dx, dv/dv and da/da), ``v`` (dv/dx), ``ax`` (da/dx), ``av`` (da/dv),
    each (T, 6, 6); at rest only ``x``, the others are zero.
    """

    def __init__(self, state: State) -> None:
        J = np.swapaxes(state.twists, 1, 2)
        legs = [state.chain.leg_columns[side] for side in state.stance.planted]
        inverse = [-np.linalg.inv(J[:, :, leg]) for leg in legs]
        root = slice(0, ROOT)
        self.legs = [(leg, {"x": inv @ J[:, :, root]}) for leg, inv in zip(legs, inverse, strict=True)]
        if state.still:
            return
        V, A = state.velocity, state.acceleration
        # V x J, the change of J in time.
        turned = spatial_cross(V, state.twists)
        # The foot is still, V_n = A_n = 0, in the formulas above.
        by_v, by_ax = -spatial_cross(state.twists, V), -spatial_cross(state.twists, A) - spatial_cross(turned, V)
        # V_i x J_i - J_i x V_i = 2 V_i x J_i.
        rows_v, rows_ax, rows_av = (np.swapaxes(rows, 1, 2) for rows in (by_v, by_ax, 2 * turned))
        for (leg, blocks), inv in zip(self.legs, inverse, strict=True):
            # Implicit functions: J_leg d(leg) = -(what the root does and, through x and v, the leg itself).
            x = blocks["x"]
            blocks["v"] = v = inv @ (rows_v[:, :, root] + rows_v[:, :, leg] @ x)
            blocks["ax"] = inv @ (rows_ax[:, :, root] + rows_ax[:, :, leg] @ x + rows_av[:, :, leg] @ v)
            blocks["av"] = inv @ (rows_av[:, :, root] + rows_av[:, :, leg] @ x)

    def followed(self, slopes: Array, time: NDArray[np.intp]) -> Array:
        """Return slopes (R, n) by coordinates (or rates, or accelerations), each at its instant ``time`` (R,), with
        those of the planted legs handed on to the root.
        """
        return self._handed(slopes.copy(), slopes, "x", time)

    def turned(self, slopes: Array, kind: str, time: NDArray[np.intp]) -> Array:
        """Return what slopes (R, n) by rates ("v") or accelerations ("ax", "av") become by x or, last, by rates."""
        return self._handed(np.zeros_like(slopes), slopes, kind, time)

    def _handed(self, out: Array, slopes: Array, kind: str, time: NDArray[np.intp]) -> Array:
        for leg, blocks in self.legs:
            if kind in blocks:
                # Row vector times (6, 6): slope by the leg times d(leg) / d(root).
                out[:, :ROOT] += (slopes[:, None, leg] @ blocks[kind][time])[:, 0]
        return out

"""One small design problem: the points of some coordinates, through a spline, to limits and objective with exact slopes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.dance.chain import ROOT, Chain
from biodance.dance.limits import Limit
from biodance.dance.stance import Stance
from biodance.dance.state import State, cross
from biodance.records import Array

Objective = Callable[[State], tuple[float, Array]]
"""Returns f and its slopes (3, T, n) by x, v, a; f may be judged without the slopes only at the price of computing them."""


def closed(chain: Chain, stance: Stance, x: Array, v: Array, a: Array) -> State:
    """Return the state whose planted legs hold their feet still: angles, velocities and accelerations."""
    x, v, a = chain.plant(x, stance.planted, stance.ankle), v.copy(), a.copy()
    legs = [chain.leg_columns[side] for side in stance.planted]
    for columns in legs:
        v[:, columns] = a[:, columns] = 0.0
    still = State(chain, stance, x, v, a)
    if still.still:
        return still
    twists = still.twists
    for columns in legs:
        v[:, columns] = _solve(twists[:, columns], -np.einsum("tic,ti->tc", twists[:, :ROOT], v[:, :ROOT]))
    moving = State(chain, stance, x, v.copy(), a)
    moving.__dict__["_frames"] = still._frames
    for columns in legs:
        a[:, columns] = _solve(twists[:, columns], -moving.acceleration[:, columns[-1]])
    state = State(chain, stance, x, v, a)
    state.__dict__["_frames"] = still._frames
    return state


def _solve(twists: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(np.swapaxes(twists, 1, 2), right[..., None])[..., 0])


class Closure:
    """How planted legs follow the pelvis: slopes of their angles, rates and accelerations by those of the root, when the feet stay still.

    For each planted leg its columns and ``x`` (dx/dx, dv/dv and da/da), ``v`` (dv/dx), ``ax`` (da/dx), ``av`` (da/dv), each (T, 6, 6);
    at rest only ``x``, the others are zero.
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
        turned = cross(V, state.twists)
        by_v, by_ax = -cross(state.twists, V), -cross(state.twists, A) - cross(turned, V)
        rows_v, rows_ax, rows_av = (np.swapaxes(rows, 1, 2) for rows in (by_v, by_ax, 2 * turned))
        for (leg, blocks), inv in zip(self.legs, inverse, strict=True):
            x = blocks["x"]
            blocks["v"] = v = inv @ (rows_v[:, :, root] + rows_v[:, :, leg] @ x)
            blocks["ax"] = inv @ (rows_ax[:, :, root] + rows_ax[:, :, leg] @ x + rows_av[:, :, leg] @ v)
            blocks["av"] = inv @ (rows_av[:, :, root] + rows_av[:, :, leg] @ x)

    def followed(self, slopes: Array, time: NDArray[np.intp]) -> Array:
        """Return slopes (R, n) by coordinates (or rates, or accelerations), each at its instant ``time`` (R,), with those of the planted
        legs handed on to the root.
        """
        return self._handed(slopes.copy(), slopes, "x", time)

    def turned(self, slopes: Array, kind: str, time: NDArray[np.intp]) -> Array:
        """Return what slopes (R, n) by rates ("v") or accelerations ("ax", "av") become by coordinates or, last, by rates of the root."""
        return self._handed(np.zeros_like(slopes), slopes, kind, time)

    def _handed(self, out: Array, slopes: Array, kind: str, time: NDArray[np.intp]) -> Array:
        for leg, blocks in self.legs:
            if kind in blocks:
                out[:, :ROOT] += (slopes[:, None, leg] @ blocks[kind][time])[:, 0]
        return out


@dataclass(frozen=True, eq=False)
class Programme:
    """``base`` (3, T, n) coordinates, rates and accelerations to which the points of the ``free`` coordinates add through ``basis``
    (3, T, K); ``limits`` to keep, each by its column of ``reserve`` (T, limits) in its scale.
    """

    chain: Chain
    stance: Stance
    base: Array
    basis: Array
    free: list[int]
    limits: tuple[Limit, ...]
    objective: Objective
    reserve: Array

    def state(self, y: Array) -> State:
        """Return the motion of the points y (K * free,)."""
        samples = self.base.copy()
        samples[:, :, self.free] += self.basis @ y.reshape(self.basis.shape[2], -1)
        return closed(self.chain, self.stance, *samples)

    def judge(self, y: Array) -> "Judged":
        """Return objective and margins at y."""
        return Judged(self, self.state(y))


class Judged:
    """A point of a programme, slopes on demand (``sqp.Point``)."""

    def __init__(self, programme: Programme, state: State) -> None:
        self.programme, self.state = programme, state
        self.value, self._slope = programme.objective(state)
        self._found = [(limit.margins(state), limit.scale) for limit in programme.limits]
        spare = programme.reserve.T[:, :, None]
        self._spare = [m.value / scale - r for (m, scale), r in zip(self._found, spare, strict=True)]
        self.margins = np.concatenate([np.empty(0), *(spare.ravel() for spare in self._spare)])

    @property
    def worst(self) -> tuple[float, str]:
        """The largest violation in the scale of its limit (negative: room left), and the name of the limit."""
        least = [float(spare.min(initial=np.inf)) for spare in self._spare]
        k = int(np.argmin(least))
        return -least[k], self.programme.limits[k].name

    @property
    def least(self) -> Array:
        """(T,) what is left in each sample, in the scales of the limits."""
        return np.min([spare.min(axis=1, initial=np.inf) for spare in self._spare], axis=0)

    def slopes(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return the gradient and the chosen rows of the Jacobian."""
        closure = Closure(self.state)
        frames, first, parts = len(self.state.x), 0, []
        for margin, scale in self._found:
            size = margin.value.size
            inside = rows[(rows >= first) & (rows < first + size)] - first
            time, which = np.unravel_index(inside, margin.value.shape)
            parts.append(self._chain([s[time, which] / scale for s in margin.slopes], time, closure))
            first += size
        gradient = self._chain(list(self._slope), np.arange(frames), closure).sum(axis=0)
        return gradient, np.concatenate([np.empty((0, gradient.size)), *parts])

    def _chain(self, slopes: list[Array], time: NDArray[np.intp], closure: Closure) -> Array:
        """Return slopes (R, K * free) by the points of slopes (R, n) by coordinates, rates and accelerations at instants ``time`` (R,)."""
        free, basis = self.programme.free, self.programme.basis
        by = [closure.followed(slopes[0], time)]
        if len(slopes) > 1 and basis[1].any():
            by[0] += closure.turned(slopes[1], "v", time)
            by.append(closure.followed(slopes[1], time))
        if len(slopes) > 2 and basis[2].any():
            by[0] += closure.turned(slopes[2], "ax", time)
            by[1] += closure.turned(slopes[2], "av", time)
            by.append(closure.followed(slopes[2], time))
        out = sum(basis[k][time][:, :, None] * part[:, None, free] for k, part in enumerate(by))
        return np.asarray(out).reshape(len(time), basis.shape[2] * len(free))

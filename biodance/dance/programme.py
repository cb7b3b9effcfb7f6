"""One small design problem: the points of some coordinates, through a spline, to limits and objective with exact slopes."""

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from biodance.dance.chain import ROOT, Chain
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


def closure_slopes(state: State) -> Array:
    """Return (4, T, n, n): dx/dx, dv/dx, da/dx and da/dv of all coordinates by the free ones, when planted feet stay still."""
    n, J, V, A = state.chain.size, state.twists, state.velocity, state.acceleration
    out = np.zeros((4, len(state.x), n, n))
    out[0] = np.eye(n)
    turned = cross(V, J)
    rows = {"v": -cross(J, V), "ax": -cross(J, A) - cross(turned, V), "av": 2 * turned}
    rows = {key: np.swapaxes(value, 1, 2) for key, value in rows.items()}
    twist, root = np.swapaxes(J, 1, 2), slice(0, ROOT)
    for side in state.stance.planted:
        leg = state.chain.leg_columns[side]
        inverse = -np.linalg.inv(twist[:, :, leg])
        x = inverse @ twist[:, :, root]
        v = inverse @ (rows["v"][:, :, root] + rows["v"][:, :, leg] @ x)
        ax = inverse @ (rows["ax"][:, :, root] + rows["ax"][:, :, leg] @ x + rows["av"][:, :, leg] @ v)
        av = inverse @ (rows["av"][:, :, root] + rows["av"][:, :, leg] @ x)
        for k, block in enumerate((x, v, ax, av)):
            out[k][:, leg] = 0.0
            out[k][:, leg, root] = block
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
    limits: tuple[ModuleType, ...]
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
        self._found = [(limit.margins(state), limit.SCALE) for limit in programme.limits]
        spare = programme.reserve.T[:, :, None]
        self._spare = [m.value / scale - r for (m, scale), r in zip(self._found, spare, strict=True)]
        self.margins = np.concatenate([np.empty(0), *(spare.ravel() for spare in self._spare)])

    @property
    def worst(self) -> tuple[float, str]:
        """The largest violation in the scale of its limit (negative: room left), and the name of the limit."""
        least = [float(spare.min(initial=np.inf)) for spare in self._spare]
        k = int(np.argmin(least))
        return -least[k], str(self.programme.limits[k].NAME)

    @property
    def least(self) -> Array:
        """(T,) what is left in each sample, in the scales of the limits."""
        return np.min([spare.min(axis=1, initial=np.inf) for spare in self._spare], axis=0)

    def slopes(self, rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return the gradient and the chosen rows of the Jacobian."""
        closure = closure_slopes(self.state)
        frames, first, parts = len(self.state.x), 0, []
        for margin, scale in self._found:
            size = margin.value.size
            inside = rows[(rows >= first) & (rows < first + size)] - first
            time, which = np.unravel_index(inside, margin.value.shape)
            parts.append(self._chain([s[time, which] / scale for s in margin.slopes], time, closure))
            first += size
        gradient = self._chain(list(self._slope), np.arange(frames), closure).sum(axis=0)
        return gradient, np.concatenate([np.empty((0, gradient.size)), *parts])

    def _chain(self, slopes: list[Array], time: NDArray[np.intp], closure: Array) -> Array:
        free, basis = self.programme.free, self.programme.basis
        table = closure[:, :, :, free]
        by = [np.einsum("rn,rnf->rf", slopes[0], table[0, time]), None, None]
        if len(slopes) > 1 and basis[1].any():
            by[0] = by[0] + np.einsum("rn,rnf->rf", slopes[1], table[1, time])
            by[1] = np.einsum("rn,rnf->rf", slopes[1], table[0, time])
        if len(slopes) > 2 and basis[2].any():
            by[0] = by[0] + np.einsum("rn,rnf->rf", slopes[2], table[2, time])
            by[1] = by[1] + np.einsum("rn,rnf->rf", slopes[2], table[3, time])
            by[2] = np.einsum("rn,rnf->rf", slopes[2], table[0, time])
        total = sum(basis[k][time][:, :, None] * part[:, None] for k, part in enumerate(by) if part is not None)
        return np.asarray(total).reshape(len(time), basis.shape[2] * len(free))

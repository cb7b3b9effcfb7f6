"""How planted legs follow the pelvis: their angles, rates and accelerations, and the slopes by those of the root."""

import numpy as np
from numpy.typing import NDArray

from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.stance import Stance
from biodance.dance.problem.state import State, cross
from biodance.records import Array


def close_legs(chain: Chain, stance: Stance, x: Array, v: Array, a: Array) -> State:
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

"""Planted feet stay where they are: the legs, solved in closed form, must reach them with the knee not quite straight."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "foot_placement", "m", 0.03
STRAIGHT = np.radians(9.0)
"""Least knee flexion: the closed-form legs bend reach smoothly over the last 2 mm, and nobody is asked to lock the knees."""


def margins(state: State) -> Margins:
    """Return how much longer each planted leg could be, (T, planted feet) m; none for hanging legs."""
    if not state.stance.planted:
        return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
    hips = [state.chain.legs[side] for side in state.stance.planted]
    place, slope = state.points([0] * len(hips), np.array([leg.hip for leg in hips]))
    away = place - state.stance.ankle[list(state.stance.planted)]
    distance = np.linalg.norm(away, axis=2)
    longest = np.array([float(leg.length(STRAIGHT)) for leg in hips])
    return Margins(longest - distance, -np.einsum("tkc,tkcn->tkn", away / distance[..., None], slope)[None])

"""A hand that holds on to a frame stays on its grip. The frame is for safety: the base of support remains that of the feet."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.shapes import palm
from biodance.dance.state import State

NAME, UNIT, SCALE = "grip", "m", 0.05
LOOSE = 0.04
"""m by which the palm may move about the middle of the grip: the hand slides and the wrist gives."""
ROUND = 1e-3
"""m: the distance is smooth at the grip itself."""


def margins(state: State) -> Margins:
    """Return how much further each holding palm may be from its grip, (T, holding hands) m; none where nothing is held."""
    holding = [side for side in (0, 1) if np.isfinite(state.stance.hands[side, 0])]
    if not holding:
        return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
    palms = [palm(state.chain.body, ("right", "left")[side]) for side in holding]
    place, slope = state.points([segment for segment, _ in palms], np.array([local for _, local in palms]))
    away = place - state.stance.hands[holding]
    distance = np.sqrt(np.sum(away**2, axis=2) + ROUND**2)
    return Margins(LOOSE - distance, -np.einsum("tkc,tkcn->tkn", away / distance[..., None], slope)[None])

"""Thighs on a stool do not sink into its seat: no knee comes lower than the hips, but for the softness of the thigh."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "seat", "m", 0.05
SOFT = 0.03
"""m by which a knee may hang below the hips."""


def margins(state: State) -> Margins:
    """Return the heights of the knees over the lowest that the seat allows, (T, 2) m; none for a standing person."""
    if not state.stance.seat:
        return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
    shanks = [state.chain.body.segment_index(f"{side}_shank") for side in ("right", "left")]
    place, slope = state.points(shanks, np.zeros((2, 3)))
    return Margins(place[:, :, 2] - state.stance.seat + SOFT, slope[None, :, :, 2])

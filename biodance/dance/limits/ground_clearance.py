"""A foot that is not planted stays above the ground."""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.state import State

NAME, UNIT, SCALE = "ground_clearance", "m", 0.05


def margins(state: State) -> Margins:
    """Return the heights of the corners of the free soles, (T, corners) m; none with both feet down."""
    feet = [state.chain.body.feet[side] for k, side in enumerate(("right", "left")) if k not in state.stance.planted]
    if not feet:
        return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
    segments = [foot.segment for foot in feet for _ in foot.outline]
    place, slope = state.points(segments, np.concatenate([foot.outline for foot in feet]))
    return Margins(place[:, :, 2], slope[None, :, :, 2])

"""A foot that is not planted stays above the ground."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.state import State
from biodance.records import SIDES


@dataclass(frozen=True)
class GroundClearance(Limit):
    """``height`` m that every corner of a free sole is above the ground at least."""

    height: float = bounded(0.0, 0.0, 0.1, "m")
    name, unit, scale, suspicion = "ground_clearance", "m", 0.05, 70
    rounding = 1e-9  # of a sole that has just left the ground
    move_reserve, tapers = 1.0, True  # 5 cm half-way: whose foot drags over the floor stumbles

    def margins(self, state: State) -> Margins:
        """Return the room under the corners of the free soles, (T, corners) m; none with both feet down."""
        feet = [state.chain.body.feet[side] for k, side in enumerate(SIDES) if k not in state.stance.planted]
        if not feet:
            return unconcerned(state)
        segments = [foot.segment for foot in feet for _ in foot.outline]
        place, slope = state.points(segments, np.concatenate([foot.outline for foot in feet]))
        return Margins(place[:, :, 2] - self.height, slope[None, :, :, 2])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the room under the lowest corner of every free sole, (T, free feet) m."""
        sides = [side for side in (0, 1) if side not in motion.stance.planted]
        if not sides:
            return NOTHING
        lowest = np.stack([motion.soles[side][:, :, 2].min(axis=1) for side in sides], axis=1)
        return Remaining(lowest - self.height, tuple(SIDES[side] for side in sides))


LIMIT = GroundClearance

"""Thighs on a stool do not sink into its seat: no knee comes lower than the hips, but for the softness of the thigh."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.state import State
from biodance.records import SIDES


@dataclass(frozen=True)
class Seat(Limit):
    """``soft`` m by which a knee may hang below the hips."""

    soft: float = bounded(0.03, 0.0, 0.1, "m")
    name, unit, scale, suspicion = "seat", "m", 0.05, 60

    def margins(self, state: State) -> Margins:
        """Return the heights of the knees over the lowest that the seat allows, (T, 2) m; none when standing."""
        if not state.stance.seat:
            return unconcerned(state)
        shanks = [state.chain.body.segment_index(f"{side}_shank") for side in SIDES]
        place, slope = state.points(shanks, np.zeros((2, 3)))
        return Margins(place[:, :, 2] - state.stance.seat + self.soft, slope[None, :, :, 2])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the heights of the knees over the lowest that the seat allows, (T, 2) m."""
        if not motion.stance.seat:
            return NOTHING
        shanks = [motion.body.segment_index(f"{side}_shank") for side in SIDES]
        knees = motion.pose.position[:, shanks, 2]
        return Remaining(knees - motion.stance.seat + self.soft, tuple(f"{side}_knee" for side in SIDES))


LIMIT = Seat

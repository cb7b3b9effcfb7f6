"""No foot bears more of the weight than a person may put on it: a limit that comes with the person (`problem.person`),
no member of the family.
"""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.state import State
from biodance.motion.dynamics import distribute
from biodance.records import SIDES


@dataclass(frozen=True)
class FootLoad(Limit):
    """Share of the vertical ground force that the ``right`` and the ``left`` foot bear at most, both on the ground."""

    right: float = bounded(1.0, 0.0, 1.0)
    left: float = bounded(1.0, 0.0, 1.0)
    name, unit, scale, suspicion = "foot_load", "N", 50.0, 15

    def margins(self, state: State) -> Margins:
        """Return how much more each foot may bear, (T, 2) N; none on a stool."""
        if not state.stance.planted:
            return unconcerned(state)
        share, (force, by) = np.array([self.right, self.left]), state.feet
        value = share * state.wrench[:, 2:3] - force[:, :, 2]
        slopes = share[:, None] * state.wrench_slopes[:, :, 2:3] - by[None, :, :, 2] @ state.wrench_slopes
        return Margins(value, slopes)

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return how much more each foot may bear, (T, 2) N, from where the soles really are; nothing on a stool."""
        if not motion.stance.planted:
            return NOTHING
        right, left = (sole.mean(axis=1) for sole in motion.soles)
        touching = np.tile([side in motion.stance.planted for side in (0, 1)], (motion.motion.time.size, 1))
        borne = [part.force[:, 2] for part in distribute(motion.wrench, right, left, touching)]
        value = np.array([self.right, self.left]) * motion.wrench.force[:, 2:] - np.stack(borne, axis=1)
        return Remaining(value, tuple(f"{side}_foot" for side in SIDES))

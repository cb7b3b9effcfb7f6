"""A hand that holds on to a frame stays on its grip. The frame is for safety: the support remains that of the feet."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import NOTHING, CheckedMotion, Limit, Margins, Remaining, bounded, unconcerned
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.state import State
from biodance.records import SIDES


@dataclass(frozen=True)
class Grip(Limit):
    """``loose`` m by which the palm may move about the middle of the grip: the hand slides and the wrist gives."""

    loose: float = bounded(0.04, 0.005, 0.15, "m")
    name, unit, scale, suspicion = "grip", "m", 0.05, 40

    def margins(self, state: State) -> Margins:
        """Return how much further each holding palm may be from its grip, (T, holding hands) m; none without a grip."""
        holding = [*state.stance.holding]
        if not holding:
            return unconcerned(state)
        palms = [palm(state.chain.body, SIDES[side]) for side in holding]
        place, slope = state.points([segment for segment, _ in palms], np.array([local for _, local in palms]))
        away = place - state.stance.hands[holding]
        distance = np.linalg.norm(away, axis=2)
        # Direction of |r|'s slope.
        direction = away / np.maximum(distance, 1e-9)[..., None]  # zero at the grip itself
        return Margins(self.loose - distance, -np.einsum("tkc,tkcn->tkn", direction, slope)[None])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return how much further each holding palm may be from its grip, (T, holding hands) m."""
        held = motion.stance.hands
        holding = np.flatnonzero(np.isfinite(held[:, 0]))
        if not holding.size:
            return NOTHING
        palms = [palm(motion.body, SIDES[side]) for side in holding]
        place = motion.pose.points([segment for segment, _ in palms], np.array([local for _, local in palms]))
        return Remaining(
            self.loose - np.linalg.norm(place - held[holding], axis=2), tuple(f"{SIDES[side]}_hand" for side in holding)
        )


LIMIT = Grip

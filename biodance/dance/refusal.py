"""In words: where the feet are, and which limit a posture breaks, in which joint, by how much."""

import math
from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.records import Array

FEET = {
    "parallel": "with both feet side by side",
    "right_forward": "with the right foot in front",
    "single_right": "on the right leg alone",
    "single_left": "on the left leg alone",
    "seated": "on the stool",
}


def told(stance: Stance) -> str:
    """Return where the feet are, in words."""
    return FEET[stance.name]


def describe(state: State, limit: Limit) -> str:
    """Return in words how much a ``state`` (one sample) breaks a ``limit``, and where: in which joint, on which side, between what."""
    motion = state.chain.motion(np.zeros(len(state.x)), state.x, state.v, state.a)
    left = limit.check(CheckedMotion(state.chain.body, motion, state.stance))
    column = int(np.argmin(left.value[0]))
    missing, unit = -float(left.value[0, column]), limit.unit
    if unit == "rad":
        missing, unit = math.degrees(missing), "degrees"
    elif unit == "m":
        missing, unit = 100 * missing, "cm"
    what = f"{limit.name} of {left.of[column]}".replace("_", " ")
    return f"{what} (short by about {missing:.0f} {unit})"


@dataclass(frozen=True)
class Excess:
    """Objective of a posture that breaks one ``limit`` as little as it can: sum of squares of what is missing, in its scale."""

    limit: Limit

    def __call__(self, state: State) -> tuple[float, Array]:
        """Return the objective and its slopes (3, T, n) by x, v, a."""
        margins, slopes = self.limit.margins(state), np.zeros((3, *state.x.shape))
        missing = np.minimum(margins.value / self.limit.scale, 0.0)
        slopes[0] = 2 * np.einsum("tm,tmn->tn", missing, margins.slopes[0]) / self.limit.scale
        return float(np.sum(missing**2)), slopes

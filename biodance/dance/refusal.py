"""In words: where the feet are, and which limit a posture breaks, in which joint, by how much."""

import math
from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import limits
from biodance.dance.stance import Stance
from biodance.dance.state import State
from biodance.records import Array

PERSONAL = ("joint_torque", "joint_range", "balance", "grip", "self_collision", "seat", "ground_clearance", "foot_placement")
"""The limits of a posture in the order in which they are suspected: first those in which persons differ."""
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


def describe(state: State, name: str) -> str:
    """Return in words how much a ``state`` (one sample) breaks the limit ``name``, and in which joint where it is one of joints."""
    limit = next(limit for limit in limits() if name == limit.NAME)
    value = limit.margins(state).value[0]
    column = int(np.argmin(value))
    missing, unit = -float(value[column]), limit.UNIT
    if unit == "rad":
        missing, unit = math.degrees(missing), "degrees"
    elif unit == "m":
        missing, unit = 100 * missing, "cm"
    joints = [joint.name.replace("_", " ") for joint in state.chain.body.joints]
    where = f" of {joints[column % len(joints)]}" if name.startswith("joint_") else ""
    return f"{name.replace('_', ' ')}{where} (short by about {missing:.0f} {unit})"


@dataclass(frozen=True)
class Excess:
    """Objective of a posture that breaks one limit as little as it can: sum of squares of what is missing, in its scale."""

    name: str

    def __call__(self, state: State) -> tuple[float, Array]:
        """Return the objective and its slopes (3, T, n) by x, v, a."""
        limit = next(limit for limit in limits() if self.name == limit.NAME)
        margins, slopes = limit.margins(state), np.zeros((3, *state.x.shape))
        missing = np.minimum(margins.value / limit.SCALE, 0.0)
        slopes[0] = 2 * np.einsum("tm,tmn->tn", missing, margins.slopes[0]) / limit.SCALE
        return float(np.sum(missing**2)), slopes

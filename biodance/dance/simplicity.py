"""How hard a posture is to take and to remember: joints away from standing, sides that differ, joints near their stops.

Three terms over the joints, angles in units of half the joint's range:
- few joints at once: mean of sqrt(r² + e²) - e, r the angle from standing (a smooth absolute value: what need not move stays);
- symmetric pairs: mean of (right - left)² over the pairs of joints, the same movement on both sides being one thing to do;
- no discomfort: mean of c⁸, c the angle from standing over the way to the stop on that side.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.dance.chain import ROOT
from biodance.dance.state import State
from biodance.records import Array

SOFT = 0.05
"""e: angles below a twentieth of half the range are not worth saving."""
SIDE, STOP = 0.25, 1.0
"""Worth of the second and the third term beside the first."""


def hardness(state: State) -> tuple[float, Array]:
    """Return the mean over the samples, about 0 standing and 1 for a contortion, and its slopes (3, T, n) by x, v, a.

    Planted legs are not counted: they follow from the pelvis.
    """
    scale, slopes = _Scale.of(state.chain.body), np.zeros((3, *state.x.shape))
    planted = [c - ROOT for side in state.stance.planted for c in state.chain.leg_columns[side]]
    counts = np.ones(len(scale.half))
    counts[planted] = 0.0
    angle = state.x[:, ROOT:]
    away = (angle - scale.rest) / scale.half
    way = np.where(angle > scale.rest, scale.upward, scale.downward)
    near = (angle - scale.rest) / way
    root = np.sqrt(away**2 + SOFT**2)
    value = (root - SOFT + STOP * near**8) @ counts
    by = counts * (away / root / scale.half + 8 * STOP * near**7 / way)
    for right, left in scale.pairs:
        if counts[right] and counts[left]:
            gap = (angle[:, right] - angle[:, left]) / scale.half[right]
            value = value + 2 * SIDE * gap**2
            by[:, right] += 4 * SIDE * gap / scale.half[right]
            by[:, left] -= 4 * SIDE * gap / scale.half[right]
    share = 1.0 / (max(1.0, counts.sum()) * len(angle))
    slopes[0][:, ROOT:] = share * by
    return float(share * value.sum()), slopes


@dataclass(frozen=True, eq=False)
class _Scale:
    """Angles (n,) rad of every joint: ``rest`` standing, ``half`` of the range, ``upward``, ``downward`` from standing to the stops (at
    least 0.2); ``pairs`` of right and left joints.
    """

    rest: Array
    half: Array
    upward: Array
    downward: Array
    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, body: Body) -> "_Scale":
        low, high = body.limits.lower, body.limits.upper
        names, rest = [joint.name for joint in body.joints], np.clip(0.0, low, high)
        others = [name.replace("right_", "left_", 1) for name in names]
        pairs = [(j, names.index(other)) for j, other in enumerate(others) if other != names[j] and other in names]
        upward, downward = np.maximum(high - rest, 0.2), np.maximum(rest - low, 0.2)
        return cls(rest, np.maximum((high - low) / 2, 1e-3), upward, downward, tuple(pairs))

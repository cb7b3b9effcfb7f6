"""When the force comes: its onset against the instant in which the ground stops the heel.

The heel marker's upward acceleration peaks where the heel strikes. A larger peak lies before it, at the end of the
swing: only the peaks near the ground count, and of these the one that is highest.
"""

import numpy as np

from biodance.effects.time_delay import TimeDelay
from biodance.observations import FootPath, Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity
from biodance.observations._stance import crossing, steps
from biodance.records import Array

_AROUND = 0.08
"""s before and after the onset in which the heel strikes."""
_NEAR = 0.02
"""m above its lowest place from which a heel strikes the ground."""
ONSET_AFTER_STRIKE = (-0.002, 0.005, 0.007)
"""s: onset less peak, its sd of one step and of one laboratory (filters of markers, thresholds of forces: filtered
forces come up to 20 ms early; medians of thirteen laboratories, of which one, 40 ms early, is left out)."""


class ForceOnset(Observer):
    """Onset of the vertical force (20 N) less the peak of the heel marker's upward acceleration, s."""

    name = "force_onset"
    responds_to = (TimeDelay.name,)
    needs = "Steps that begin with the heel, on an empty plate; markers at 100 Hz or more."
    source = "42 heel strikes of 10 persons of 5 public laboratories (docs/benchmarks/diagnosis.md)"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each heel strike."""
        found, (expected, step_sd, laboratory) = [], ONSET_AFTER_STRIKE
        for step in (one for one in seen.steps if one.heel_first and not one.mixed and steps(seen, one)):
            part, foot = seen.stance(step), seen.foot(step.side)
            if part is None or part.start == 0:
                continue
            onset, slope = crossing(seen.plate(step.plate).wrench, part.start)
            value = onset - heel_strike(foot, step.middle, onset)
            own = float(np.hypot(step_sd, 0.25 / foot.rate))
            found.append(
                Observation(
                    self.name, step.name, seen.trial.name, value, own, expected, "s", step.plate,
                    {"laboratory onset": laboratory}, sensitivity=Sensitivity({step.plate: slope}, delay=1.0),
                )
            )  # fmt: skip
        return tuple(found)


def heel_strike(foot: FootPath, middle: float, near: float) -> float:
    """Return the time s at which a heel strikes within 0.08 s of ``near``; ``middle`` s the foot stands. NaN where
    no peak shows it.
    """
    height = foot.heel[:, 2]
    rise = np.full(height.size, np.nan)
    # Second central difference: vertical acceleration.
    rise[1:-1] = (height[2:] - 2 * height[1:-1] + height[:-2]) * foot.rate**2
    stands = height[np.abs(foot.time - middle) < 0.05]
    if not np.isfinite(stands).any():
        return float("nan")
    low = height < np.nanmedian(stands) + _NEAR
    peaks = [
        int(i)
        for i in np.flatnonzero((np.abs(foot.time - near) < _AROUND) & low)
        if 2 <= i < height.size - 2 and rise[i] >= max(rise[i - 1], rise[i + 1]) and rise[i] > 0
    ]
    return _vertex(foot.time, rise, max(peaks, key=lambda i: rise[i])) if peaks else float("nan")


def _vertex(time: Array, value: Array, i: int) -> float:
    """Return the time of the top of the parabola through three samples around ``i``."""
    before, top, after = value[i - 1 : i + 2]
    bend = before - 2 * top + after
    # Vertex of a parabola: half the first difference over the second one.
    return float(time[i] + (0.5 * (before - after) / bend if bend < 0 else 0.0) * (time[i + 1] - time[i]))


OBSERVER = ForceOnset

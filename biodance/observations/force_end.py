"""When the force goes: its end against the instant in which the toe is pulled forwards.

Coarser than the heel strike, but every walking step has it: stairs and toes first, too. A foot that is only lifted, or
that runs, has no such instant: its largest acceleration is anywhere (40 ms apart from step to step in ten runners).
"""

import numpy as np

from biodance.effects.time_delay import TimeDelay
from biodance.observations import FootPath, Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity
from biodance.observations._stance import crossing, steps, walks
from biodance.records import Array

_AROUND = 0.1
"""s before and after the end of the force in which the toe leaves; what half as much more on either side shows larger
is no instant: a value at the bound of its search is no value."""
_EXPECTED, _STEP, _PERSON = -0.024, 0.010, 0.009
"""s: end less peak, its sd of one step and of one person."""


class ForceEnd(Observer):
    """End of the vertical force (20 N) less the peak of the toe marker's horizontal acceleration away from where it
    stood, s.
    """

    name = "force_end"
    responds_to = (TimeDelay.name,)
    needs = "Walking steps that leave an empty plate and swing off; markers at 100 Hz or more."
    source = "42 steps of 11 persons of 6 public laboratories (docs/benchmarks/diagnosis.md)"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one observation of each step that ends within the recording."""
        found = []
        for step in (one for one in seen.steps if not one.mixed and walks(seen, one) and steps(seen, one)):
            part, wrench = seen.stance(step), seen.plate(step.plate).wrench
            if part is None or part.stop >= wrench.time.size:
                continue
            end = float(wrench.time[part.stop - 1])
            value = end - toe_pulled(seen.foot(step.side), step.middle, end)
            _, slope = crossing(wrench, part.stop)
            found.append(
                Observation(
                    self.name, step.name, seen.trial.name, value, _STEP, _EXPECTED, "s", step.plate,
                    {"person toe off": _PERSON}, sensitivity=Sensitivity({step.plate: slope}, delay=1.0),
                )
            )  # fmt: skip
        return tuple(found)


def toe_pulled(foot: FootPath, middle: float, near: float) -> float:
    """Return the time s at which a toe is accelerated most away from its place at ``middle`` s, within 0.1 s of
    ``near``; NaN where the peak is not seen whole, or a larger one lies just outside.
    """
    place: Array = foot.toe[np.argmin(np.abs(foot.time - middle)), :2]
    away = np.linalg.norm(foot.toe[:, :2] - place, axis=1)
    pull = np.full(away.size, np.nan)
    # Second difference of the distance from where the toe stood.
    pull[1:-1] = (away[2:] - 2 * away[1:-1] + away[:-2]) * foot.rate**2
    here = np.flatnonzero(np.abs(foot.time - near) < 1.5 * _AROUND)
    if not here.size or not np.isfinite(pull[here]).all():
        return float("nan")
    best = foot.time[here[np.argmax(pull[here])]]
    return float(best) if abs(best - near) < _AROUND else float("nan")


OBSERVER = ForceEnd

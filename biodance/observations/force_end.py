"""When the force goes: its end against the instant in which the toe is pulled forwards.

Coarser than the heel strike, but every walking step has it: stairs and toes first, too. A foot that is only lifted, or
that runs, has no such instant: its largest acceleration is anywhere (40 ms apart from step to step in ten runners).
"""

import numpy as np

from biodance.effects.time_delay import TimeDelay
from biodance.observations import FootPath, FootStep, Observation, Observer, SeenTrial
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
        return tuple(one for step in seen.steps if not step.mixed for one in self._of_step(seen, step))

    def _of_step(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part, wrench = seen.stance(step), seen.plate(step.plate).wrench
        time = wrench.time
        if part is None or part.stop >= time.size or not (walks(seen, step) and steps(seen, step)):
            return []
        end, foot = float(time[part.stop - 1]), seen.foot(step.side)
        value, norms = end - toe_pulled(foot, step.middle, end), {"person toe off": _PERSON}
        _, slope = crossing(wrench, part.stop)
        responds = Sensitivity({step.plate: slope}, delay=1.0)
        return [
            Observation(
                self.name, step.name, seen.trial.name, value, _STEP, _EXPECTED, "s", step.plate, norms,
                sensitivity=responds,
            )
        ]  # fmt: skip


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

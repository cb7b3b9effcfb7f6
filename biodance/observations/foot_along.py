"""Where the pressure lies along the foot that stands there: ahead of the heel marker early, under the toes late.

Coarser than across the foot, and it scales with the foot; steps in different directions, and the same foot on two
plates, tell plate from foot.
"""

from collections.abc import Iterator
from dataclasses import replace

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_position import PlatePosition
from biodance.observations import FootStep, Observation, Observer, SeenTrial
from biodance.observations._stance import StepCourse, landmark_along, step_course

ALONG_PHASES = {
    "early": (0.04, 0.10, 0.23, 0.030, 0.030, 0.02),
    "late": (0.80, 0.92, 0.95, 0.030, 0.030, 0.05),
}
"""Start and stop of the phase as shares of stance; expected distance ahead of the heel marker in units of the distance
from heel to toe marker; sd of one step, of one person, of one laboratory's markers in the same unit."""
_MIDDLE = (0.30, 0.60, 0.75, 0.063, 0.11, 0.08)
"""The same of the middle of stance, where people differ most: asked only where a foot stands on two plates edge to
edge, which early and late hold the other foot, too (48 steps of 12 persons)."""


class FootAlong(Observer):
    """Centre of pressure ahead of the heel marker along the foot, m, early and late in stance."""

    name = "foot_along"
    responds_to = (PlatePosition.name, PlateCrosstalk.name, AxisError.name)
    needs = "A step from heel to toe with one whole foot on one plate; heel and toe markers, not at one edge only."
    source = "45 steps of 10 persons of 5 public laboratories (docs/benchmarks/diagnosis.md)"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return two observations of each step in which the heel came down first, one of a foot on two plates."""
        found: list[Observation] = []
        for step in seen.steps:
            part = step_course(seen, step) if step.heel_first else None
            found += self._phases(seen, step, part) if part is not None else ()
        return tuple(found)

    def _phases(self, seen: SeenTrial, step: FootStep, part: StepCourse) -> Iterator[Observation]:
        path, trial = seen.foot(step.side), seen.trial.name
        phases = {"middle": _MIDDLE} if step.beside else ALONG_PHASES
        for phase, (start, stop, share, sd, person, laboratory) in phases.items():
            norms = {
                f"person foot along, {phase}": person * part.length,
                f"laboratory along, {phase}": laboratory * part.length,
                **landmark_along(path),
            }
            value, responds = part.place(0, start, stop)
            own, beside = ((sd * part.length) ** 2 + step.overhang**2) ** 0.5, part.place(1, start, stop)[0]
            # A heel marker e backwards adds e to the distance and share * e to what is expected of a longer foot;
            # a toe marker e inwards turns the axis by e / length: the distance ahead loses beside * e / length.
            levers = {(step.side, "backwards"): 1 - share, (step.side, "inwards"): -beside / part.length}
            what, expected = f"{step.name}, {phase}", share * part.length
            yield Observation(
                self.name, what, trial, value, own, expected, "m", step.plate, norms, path.centred,
                replace(responds, landmarks=levers),
            )  # fmt: skip


OBSERVER = FootAlong

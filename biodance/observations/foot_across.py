"""Where the pressure lies across the foot that stands there: under the heel early, near the foot's line in the middle.

One ordinary step shows the plate's place across the foot; the same foot on two plates, and steps in other directions,
tell it from where the laboratory puts its toe marker. A turned plate shows as a slant of the pressure's path.
"""

from collections.abc import Mapping
from dataclasses import replace

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_crosstalk import PlateCrosstalk
from biodance.effects.plate_position import PlatePosition
from biodance.effects.plate_rotation import PlateRotation
from biodance.observations import FootStep, Observation, Observer, SeenTrial
from biodance.observations._stance import landmark_across, step_course

ACROSS_PHASES: Mapping[str, tuple[float, ...]] = {
    "early": (0.04, 0.20, 0.000, 0.0030, 0.0025, 0.0020),
    "middle": (0.20, 0.60, -0.001, 0.0040, 0.0045, 0.0025),
    "late": (0.60, 0.80, -0.006, 0.0055, 0.0070, 0.0040),
}
"""Start and stop of the phase as shares of stance; expected m outwards; m sd of one step, of one foot of one person, of
one laboratory's people beside its markers (`landmark_across`)."""
_RUNNING: Mapping[str, tuple[float, ...]] = {"running": (0.30, 0.60, -0.001, 0.0080, 0.0090, 0.0050)}
"""The same of a foot that runs: the pressure stays near the foot's line, too (De Cock et al. 2008,
doi:10.1016/j.gaitpost.2007.08.013); no public running was there to learn from, so all is twice as uncertain.
"""


class FootAcross(Observer):
    """Centre of pressure outwards of the line from the heel marker to the front of the foot, m, by phase of stance."""

    name = "foot_across"
    responds_to = (PlatePosition.name, PlateRotation.name, PlateCrosstalk.name, AxisError.name)
    needs = "A step with one whole foot on one plate; heel and toe markers, not at one edge only."
    source = "49 steps of 10 persons of 5 public laboratories (docs/benchmarks/diagnosis.md)"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return three observations of each walking step, the early one only where the heel came down first, on one
        plate alone; one of each running step.
        """
        ways = ((ACROSS_PHASES, False), (_RUNNING, True))
        return tuple(one for step in seen.steps for way in ways for one in self._phases(seen, step, *way))

    def _phases(
        self, seen: SeenTrial, step: FootStep, phases: Mapping[str, tuple[float, ...]], running: bool
    ) -> list[Observation]:
        part, found = step_course(seen, step, running=running), []
        if part is None:
            return []
        path, trial = seen.foot(step.side), seen.trial.name
        for phase, (start, stop, expected, sd, foot, laboratory) in phases.items():
            if phase == "early" and (step.beside or not step.heel_first):
                continue
            norms = {f"person {step.side} foot across, {phase}": foot, f"laboratory across, {phase}": laboratory}
            norms |= landmark_across(path, phase)
            value, responds = part.place(1, start, stop)
            # A toe marker e inwards turns the foot's line by e / length: a pressure so far
            # ahead moves out by ahead / length.
            own, lever = (sd**2 + step.overhang**2) ** 0.5, part.place(0, start, stop)[0] / part.length
            what = f"{step.name}, {phase}"
            found.append(
                Observation(
                    self.name, what, trial, value, own, expected, "m", step.plate, norms, path.centred,
                    replace(responds, landmarks={(step.side, "inwards"): lever}),
                )
            )  # fmt: skip
        return found


OBSERVER = FootAcross

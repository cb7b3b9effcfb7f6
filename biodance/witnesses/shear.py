"""Which way the shear points: a step brakes first and pushes then, and it turns with the plate.

The direction of walking is that of the pelvis over the standing foot, so that it holds on a treadmill, too.
"""

import numpy as np

from biodance.records import Array
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._stance import StepCourse, step_course

_PARTS = {
    "braking": (0.08, 0.35, 0, -0.145, 0.030),
    "pushing": (0.65, 0.92, 0, 0.150, 0.035),
    "inwards": (0.20, 0.80, 1, -0.045, 0.025),
}
"""Start and stop as shares of stance, direction (0 ahead, 1 outwards), expected share of the mean vertical force, sd of
one person."""
_STEP = 0.015
_STRAIGHT = 0.2
"""rad between the ways of the first and the second half of a stance: in a turn the shear points to its middle."""
_SLANT = 0.075
"""rad: sd of the direction in which shear goes from braking to pushing, of one step."""


class Shear(Witness):
    """Mean shear as a share of the mean vertical force: braking, pushing, inwards; and the slant (rad) of the line on
    which it goes from braking to pushing, to the left of the way.
    """

    name = "shear"
    sees = ("plate_rotation", "axis_error")
    needs = "A walking step with one whole foot on one plate; foot and pelvis markers."
    source = "45 steps of 10 persons of 5 public laboratories; Winter 2009, chapter 5"

    def look(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return four observations of each step that begins with the heel."""
        if seen.pelvis is None:
            return ()
        whole = (step for step in seen.steps if step.heel_first and not step.beside)
        return tuple(one for step in whole for one in self._of_step(seen, step))

    def _of_step(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = step_course(seen, step)
        ahead = way(seen, step, part) if part is not None else None
        if part is None or ahead is None:
            return []
        left = np.array([-ahead[1], ahead[0]])
        along = np.stack([part.force[:, :2] @ ahead, part.force[:, :2] @ left * (1 if step.side == "left" else -1)])
        weight = float(part.force[:, 2].mean())
        found = []
        for what, (start, stop, axis, expected, person) in _PARTS.items():
            value = part.mean(along[axis], start, stop) / weight
            norms = {f"person {what}": person}
            found.append(self._observation(seen, step, what, value, _STEP, expected, "1", norms))
        slant = float(np.arctan(_slope(part.force[:, :2] @ left, along[0], part.force[:, 2])))
        norms = {f"person {step.side} slant": _SLANT / 2}
        return [*found, self._observation(seen, step, "slant", slant, _SLANT, 0.02, "rad", norms)]

    def _observation(
        self, seen: SeenTrial, step: FootStep, what: str, value: float, sd: float, expected: float, unit: str,
        norms: dict[str, float],
    ) -> Observation:  # fmt: skip
        return Observation(
            self.name, f"{step.name}, {what}", seen.trial.name, value, sd, expected, unit, step.plate, norms
        )


def _slope(left: Array, ahead: Array, vertical: Array) -> float:
    """Return how the shear to the left follows the one ahead, beside what follows the vertical force."""
    return float(np.linalg.lstsq(np.stack([ahead, vertical], axis=1), left, rcond=None)[0][0])


def way(seen: SeenTrial, step: FootStep, part: StepCourse) -> Array | None:
    """Return the unit vector (2,) along which the pelvis goes over the foot in the middle of a stance; None where it
    hardly goes, or turns.
    """
    time = part.time[(part.phase > 0.2) & (part.phase < 0.8)]
    assert seen.trial.markers is not None
    here = (seen.trial.markers.time >= time[0]) & (seen.trial.markers.time <= time[-1])
    foot = seen.foot(step.side)
    path = (seen.pelvis - foot.heel)[here, :2] if seen.pelvis is not None else np.empty((0, 2))
    path = path[np.isfinite(path).all(axis=1)]
    if len(path) < 5:
        return None
    moved, halves = path[-1] - path[0], np.array([path[len(path) // 2] - path[0], path[-1] - path[len(path) // 2]])
    length = float(np.linalg.norm(moved))
    bent = abs(np.arctan2(halves[0, 0] * halves[1, 1] - halves[0, 1] * halves[1, 0], np.sum(halves[0] * halves[1])))
    return moved / length if length > 0.1 and bent < _STRAIGHT else None


WITNESS = Shear

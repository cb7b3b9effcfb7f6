"""Which way the shear points: a step brakes first and pushes then, and it turns with the plate.

The direction of walking is that of the pelvis over the ground or belt under the standing foot, at each instant: in a
turn the shear turns with it. What the pelvis is accelerated by over the step is taken off: it bends the way, and who
slows down brakes more.
"""

import numpy as np

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_rotation import PlateRotation
from biodance.records import Array
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._stance import StepCourse, by_step, step_course

_PARTS = {
    "braking": (0.08, 0.35, 0, -0.177, 0.022, 0.030),
    "pushing": (0.65, 0.92, 0, 0.136, 0.022, 0.030),
    "inwards": (0.20, 0.80, 1, 0.010, 0.012, 0.012),
}
"""Start and stop as shares of stance, direction (0 ahead, 1 inwards), expected share of the mean vertical force beyond
the pelvis' acceleration, sd of one step and of one person."""
_SLANT = (0.025, 0.055, 0.025)
"""rad: expected direction in which shear goes from braking to pushing, its sd of one step and of one person's foot."""
_GOES = 0.2
"""m/s of the pelvis over the ground from which somebody walks."""
_FRAMES = 8
"""Frames of a stance that show how the pelvis goes."""


class Shear(Witness):
    """Mean shear as a share of the mean vertical force: braking, pushing, inwards; and the slant (rad) of the line on
    which it goes from braking to pushing, to the left of the way.
    """

    name = "shear"
    sees = (PlateRotation.name, AxisError.name)
    needs = "A walking step with one whole foot on one plate; foot and pelvis markers."
    source = "65 steps of 20 persons of 12 public laboratories; Winter 2009, chapter 5"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return four observations of each step that begins with the heel."""
        if seen.pelvis is None:
            return ()
        whole = (step for step in seen.steps if step.heel_first and not step.beside)
        return tuple(one for step in whole for one in self._of_step(seen, step))

    @by_step
    def _of_step(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = step_course(seen, step)
        path = way(seen, step, part) if part is not None else None
        if part is None or path is None:
            return []
        velocity, bending = path
        ahead = velocity / np.linalg.norm(velocity, axis=1)[:, None]
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        inwards, weight = (1 if step.side == "left" else -1), float(part.force[:, 2].mean())
        along = np.stack([np.sum(part.force[:, :2] * one, axis=1) for one in (ahead, left)])
        gained = np.array([bending @ one[len(one) // 2] for one in (ahead, left)]) / seen.trial.settings.gravity
        found = []
        for what, (start, stop, axis, expected, sd, person) in _PARTS.items():
            value = (part.mean(along[axis], start, stop) / weight - gained[axis]) * (inwards if axis else 1)
            found.append(self._observation(seen, step, what, value, sd, expected, "1", {f"person {what}": person}))
        slant, (expected, sd, person) = float(np.arctan(_slope(along[1], along[0], part.force[:, 2]))), _SLANT
        norms = {f"person {step.side} slant": person}
        return [*found, self._observation(seen, step, "slant", slant, sd, expected, "rad", norms)]

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


def way(seen: SeenTrial, step: FootStep, part: StepCourse) -> tuple[Array, Array] | None:
    """Return the horizontal velocity (n, 2) m/s of the pelvis over the ground or belt during a stance, evenly
    accelerated, and that acceleration (2,) m/s²; None where the pelvis is not seen or hardly goes.
    """
    assert seen.trial.markers is not None
    known, middle = seen.trial.markers.time, float(np.mean(part.time[[0, -1]]))
    here = (known >= part.time[0]) & (known <= part.time[-1])
    path = seen.pelvis[here, :2] if seen.pelvis is not None else np.empty((0, 2))
    told = np.isfinite(path).all(axis=1)
    if told.sum() < _FRAMES:
        return None
    bend, speed, _ = np.linalg.lstsq(np.vander(known[here][told] - middle, 3), path[told], rcond=None)[0]
    belt = seen.belt(step)
    velocity = speed - (np.zeros(2) if belt is None else belt) + 2 * bend * (part.time - middle)[:, None]
    return (velocity, 2 * bend) if np.linalg.norm(velocity, axis=1).min() > _GOES else None


WITNESS = Shear

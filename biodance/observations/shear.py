"""Which way the shear points: a step brakes first and pushes then, and it turns with the plate.

The direction of walking is that of the pelvis over the ground or belt under the standing foot, at each instant: in a
turn the shear turns with it. What the pelvis is accelerated by over the step is taken off: it bends the way, and who
slows down brakes more.
"""

from dataclasses import dataclass

import numpy as np

from biodance.effects.axis_error import AxisError
from biodance.effects.plate_rotation import PlateRotation
from biodance.observations import FootStep, Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, by_plate
from biodance.observations._stance import StepCourse, step_course
from biodance.records import Array

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


class Shear(Observer):
    """Mean shear as a share of the mean vertical force: braking, pushing, inwards; and the slant (rad) of the line on
    which it goes from braking to pushing, to the left of the way.
    """

    name = "shear"
    responds_to = (PlateRotation.name, AxisError.name)
    needs = "A walking step with one whole foot on one plate; foot and pelvis markers."
    source = "65 steps of 20 persons of 12 public laboratories; Winter 2009, chapter 5"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return four observations of each step that begins with the heel."""
        if seen.pelvis is None:
            return ()
        whole = (step for step in seen.steps if step.heel_first and not step.beside)
        return tuple(one for step in whole for one in self._of_step(seen, step))

    def _of_step(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        course = step_course(seen, step)
        path = way(seen, step, course) if course is not None else None
        if course is None or path is None:
            return []
        parts = [self._part(seen, step, course, path, what) for what in _PARTS]
        return [*parts, self._slant(seen, step, course, path)]

    def _part(
        self, seen: SeenTrial, step: FootStep, course: StepCourse, path: "PelvisCourse", what: str
    ) -> Observation:
        """Return the mean shear in a part of the stance, beyond what accelerates the pelvis in its middle."""
        start, stop, axis, expected, sd, person = _PARTS[what]
        inwards, turns = (-1 if axis and step.side == "right" else 1), (-1 if axis else 1) * path.turns
        part, middle, weight = course.part(start, stop), len(path.turns) // 2, float(course.force[:, 2].mean())
        share = np.zeros(len(path.turns))
        # Mean over the part, in units of the weight over the whole stance.
        share[part] = inwards / max(part.stop - part.start, 1) / weight
        along = path.along(course.force)
        # Force over weight: acceleration over g.
        per = inwards / seen.trial.settings.gravity
        gained, late = path.axes[middle] @ path.bending * per, path.axes[middle] @ path.bending_late * per
        value = float(share @ along[axis])
        gradient = np.zeros_like(course.wrench)
        gradient[:, :2] = share[:, None] * path.axes[:, axis]
        # The weight in the denominator is a mean over all samples.
        gradient[:, 2] = -value / weight / len(gradient)
        # Late forces meet axes that have turned on (ahead' = w left, left' = -w ahead), and a later bend of the way.
        delay = share @ (turns * along[1 - axis]) - late[axis] - turns[middle] * gained[1 - axis]
        responds = Sensitivity(by_plate(gradient, course.plates), delay=float(delay))
        return self._observation(seen, step, what, value - float(gained[axis]), (expected, sd, person), responds)

    def _slant(self, seen: SeenTrial, step: FootStep, course: StepCourse, path: "PelvisCourse") -> Observation:
        """Return how the shear to the left follows the one ahead, beside what follows the vertical force."""
        ahead, left = path.along(course.force)
        X = np.stack([ahead, course.force[:, 2]], axis=1)
        beta, *_ = np.linalg.lstsq(X, left, rcond=None)
        # d arctan(b) = db / (1 + b²), with db = e_0'(X'X)^-1 X' dy.
        first = np.linalg.pinv(X.T @ X)[0] / (1 + beta[0] ** 2)
        of_left = X @ first
        # d beta = (X'X)^-1 (dX' r - X' dX beta), r the residual: the derivative with respect to both columns of X.
        of_ahead, of_vertical = (np.outer(left - X @ beta, first) - np.outer(of_left, beta)).T
        gradient = np.zeros_like(course.wrench)
        gradient[:, :2] = of_left[:, None] * path.axes[:, 1] + of_ahead[:, None] * path.axes[:, 0]
        gradient[:, 2] = of_vertical
        # As the axes turn: ahead' = w left, left' = -w ahead.
        late = float(np.sum(path.turns * (of_ahead * left - of_left * ahead)))
        responds = Sensitivity(by_plate(gradient, course.plates), delay=late, linear=False)
        return self._observation(seen, step, "slant", float(np.arctan(beta[0])), _SLANT, responds)

    def _observation(
        self, seen: SeenTrial, step: FootStep, what: str, value: float, norm: tuple[float, float, float],
        responds: Sensitivity,
    ) -> Observation:  # fmt: skip
        """Return one observation; ``norm`` what is expected, sd of one step, sd of one person."""
        expected, sd, person = norm
        unit, norms = ("rad", f"person {step.side} slant") if what == "slant" else ("1", f"person {what}")
        return Observation(
            self.name, f"{step.name}, {what}", seen.trial.name, value, sd, expected, unit, step.plate, {norms: person},
            sensitivity=responds,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class PelvisCourse:
    """How the pelvis goes over the ground or belt in a stance: ``axes`` (n, 2, 2) unit vectors ahead and to the left,
    which turn to the left by ``turns`` (n,) rad/s; ``bending`` (2,) m/s² its even acceleration; ``bending_late`` (2,)
    m/s³: how that changes where the stance is late.
    """

    axes: Array
    turns: Array
    bending: Array
    bending_late: Array

    def along(self, force: Array) -> Array:
        """Return forces (n, 3) N ahead and to the left (2, n)."""
        # e_i f of every sample.
        return np.asarray(np.einsum("nij,nj->in", self.axes, force[:, :2]))


def way(seen: SeenTrial, step: FootStep, course: StepCourse) -> PelvisCourse | None:
    """Return how the pelvis goes during a stance; None where it is not seen or hardly goes."""
    path, middle = seen.pelvis_track, float(np.mean(course.time[[0, -1]]))
    here = (path.time >= course.time[0]) & (path.time <= course.time[-1])
    if np.count_nonzero(here) < _FRAMES:
        return None
    known = np.hstack([path.place[:2, here].T, path.speed[:2, here].T])
    # Parabolas of the place and of the velocity, each fitted on its own: the second one tells how the first bends.
    bend, speed, _ = np.linalg.lstsq(np.vander(path.time[here] - middle, 3), known, rcond=None)[0]
    # Derivative of b t² + s t + c.
    both = speed + 2 * bend * (course.time - middle)[:, None]
    belt = seen.belt(step)
    velocity, late = both[:, :2] - (np.zeros(2) if belt is None else belt), both[:, 2:]
    goes = np.linalg.norm(velocity, axis=1)
    if not goes.min() > _GOES:
        return None
    ahead = velocity / goes[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    # left · ahead' = left · a / v: the rate at which the way turns.
    return PelvisCourse(np.stack([ahead, left], axis=1), np.sum(left * late, axis=1) / goes, 2 * bend[:2], 2 * bend[2:])


OBSERVER = Shear

"""Which way the shear points: a step brakes first and pushes then, and it turns with the plate.

The direction of walking is that of the pelvis over the ground or belt under the standing foot, at each instant: in a
turn the shear turns with it. What the pelvis is accelerated by over the step is taken off: it bends the way, and who
slows down brakes more.
"""

from dataclasses import dataclass, replace

import numpy as np

from biodance.records import Array
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._sensitivity import Sensitivity, by_samples
from biodance.witnesses._stance import StepCourse, step_course

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
    sees = ("plate_rotation", "axis_error")
    needs = "A walking step with one whole foot on one plate; foot and pelvis markers."
    source = "65 steps of 20 persons of 12 public laboratories; Winter 2009, chapter 5"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return four observations of each step that begins with the heel."""
        if seen.pelvis is None:
            return ()
        whole = (step for step in seen.steps if step.heel_first and not step.beside)
        return tuple(one for step in whole for one in self._of_step(seen, step))

    def _of_step(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = step_course(seen, step)
        path = way(seen, step, part) if part is not None else None
        if part is None or path is None:
            return []
        speed = np.linalg.norm(path.velocity, axis=1)
        ahead = path.velocity / speed[:, None]
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        axes, turns = np.stack([ahead, left], axis=1), np.sum(left * path.velocity_late, axis=1) / speed
        parts = [self._part(seen, step, part, axes, turns, path, what) for what in _PARTS]
        return [*parts, self._slant(seen, step, part, axes, turns)]

    def _part(
        self, seen: SeenTrial, step: FootStep, course: StepCourse, axes: Array, turns: Array, path: "Way", what: str
    ) -> Observation:
        """Return the mean shear along one of the ``axes`` (n, 2, 2), which turn by ``turns`` (n,) rad/s."""
        start, stop, axis, expected, sd, person = _PARTS[what]
        inwards, part, middle = (-1 if axis and step.side == "right" else 1), course.part(start, stop), len(axes) // 2
        force, weight, g = course.force[part, :2], float(course.force[:, 2].mean()), seen.trial.settings.gravity
        share = float(np.sum(force * axes[part, axis], axis=1).mean()) / weight if force.size else float("nan")
        other = np.sum(force * axes[part, 1 - axis], axis=1) * turns[part] * (-1 if axis else 1)
        gained, other_gained = axes[middle, [axis, 1 - axis]] @ path.bending / g
        late = path.bending_late @ axes[middle, axis] / g + turns[middle] * other_gained * (-1 if axis else 1)
        gradient = np.zeros_like(course.wrench)
        gradient[part, :2] = axes[part, axis] / max(len(force), 1) / weight
        gradient[:, 2] = -share / weight / len(gradient)
        return self._observation(
            seen, step, what, inwards * (share - float(gained)), (expected, sd, person),
            _responds(course, inwards * gradient, inwards * float(other.sum() / max(len(force), 1) / weight - late)),
        )  # fmt: skip

    def _slant(
        self, seen: SeenTrial, step: FootStep, course: StepCourse, axes: Array, turns: Array
    ) -> Observation:
        """Return how the shear to the left follows the one ahead, beside what follows the vertical force."""
        ahead, left = np.einsum("nij,nj->in", axes, course.force[:, :2])
        X = np.stack([ahead, course.force[:, 2]], axis=1)
        beta, *_ = np.linalg.lstsq(X, left, rcond=None)
        first = np.linalg.pinv(X.T @ X)[0]
        of_left, of_others = X @ first, np.outer(left - X @ beta, first) - np.outer(X @ first, beta)
        steep = 1 / (1 + beta[0] ** 2)
        gradient = np.zeros_like(course.wrench)
        gradient[:, :2] = of_left[:, None] * axes[:, 1] + of_others[:, :1] * axes[:, 0]
        gradient[:, 2] = of_others[:, 1]
        late = float(np.sum(turns * (of_others[:, 0] * left - of_left * ahead)))
        responds = replace(_responds(course, steep * gradient, steep * late), linear=False)
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


def _responds(course: StepCourse, gradient: Array, late: float) -> Sensitivity:
    """Return the sensitivity of what has the derivatives (n, 6) with respect to the wrench under the foot."""
    return Sensitivity({name: by_samples(gradient, one) for name, one in course.plates.items()}, delay=late)


@dataclass(frozen=True, eq=False)
class Way:
    """How the pelvis goes over the ground or belt during a stance: ``velocity`` (n, 2) m/s, evenly accelerated, and that
    acceleration ``bending`` (2,) m/s²; ``velocity_late`` (n, 2) m/s² and ``bending_late`` (2,) m/s³: how they change
    where the stance is late.
    """

    velocity: Array
    bending: Array
    velocity_late: Array
    bending_late: Array


def way(seen: SeenTrial, step: FootStep, part: StepCourse) -> Way | None:
    """Return how the pelvis goes during a stance; None where it is not seen or hardly goes."""
    path, middle, since = seen.pelvis_track, float(np.mean(part.time[[0, -1]])), part.time[:, None]
    here = (path.time >= part.time[0]) & (path.time <= part.time[-1])
    if np.count_nonzero(here) < _FRAMES:
        return None
    known = np.hstack([path.place[:2, here].T, path.speed[:2, here].T])
    bend, speed, _ = np.linalg.lstsq(np.vander(path.time[here] - middle, 3), known, rcond=None)[0]
    both = speed + 2 * bend * (since - middle)
    belt = seen.belt(step)
    velocity = both[:, :2] - (np.zeros(2) if belt is None else belt)
    if not np.linalg.norm(velocity, axis=1).min() > _GOES:
        return None
    return Way(velocity, 2 * bend[:2], both[:, 2:], 2 * bend[2:])


WITNESS = Shear

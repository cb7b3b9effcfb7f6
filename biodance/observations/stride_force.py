"""What the plates weigh while somebody walks: the mean vertical force over whole steps, and over one foot alone.

From one single support into the next the mean force is the weight but for the change of velocity, which the pelvis
shows. The mean is taken with weights that begin and end smoothly: then no velocity of one instant is needed. In the
middle of a stance the other foot swings: one plate alone says the same a little coarser, and plates are told from each
other. A foot that reaches over the edge of its plate does not weigh: what it treads on beside it is not measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.effects.body_mass import BodyMass
from biodance.effects.clipping import Clipping
from biodance.effects.plate_gain import PlateGain
from biodance.motion.newton import fading
from biodance.observations import FootStep, Observation, Observer, SeenTrial
from biodance.observations._causes import Sensitivity, of_mean
from biodance.observations._recording import ONSET
from biodance.observations._stance import is_recorded, steps, walks
from biodance.records import Array

_STEP, _ALONE, _HORIZONTAL = (-0.001, 0.003, 0.0045), (0.009, 0.0085, 0.008), 0.012
"""Expected error of the mass as a share of it, its sd of one step and of one person: of a whole step, of one foot
alone; sd of the mean horizontal force over a step as a share of the weight."""
_FLOWN, _SIDE = (0.0, 0.015, 0.04), 0.013
"""The same of one step of a runner, from one flight to the next, and what each foot errs by beside it: six persons of
two laboratories, whose feet differ by 1.9 % root mean square where nothing is wrong with the plates."""
_ON = (0.0, 0.002, 0.003)
"""The same of all strides of somebody who goes on on a belt, walking or running: nothing is trodden on beside it."""
_MANY = 6
"""Steps from which somebody goes on."""
_ONE = (0.2, 0.8)
"""Start and stop, as shares of stance, of the time in which the other foot swings."""
_FLIGHT = 0.02
"""s of a flight, at least."""
_SHORTEST = 0.15
"""s that one foot alone must be seen."""


class StrideForce(Observer):
    """Mass (kg) by the mean vertical force over a step, over one foot alone, over all strides on a belt, and
    mean horizontal force (N) over a step.
    """

    name = "stride_force"
    responds_to = (PlateGain.name, BodyMass.name, Clipping.name)
    needs = "Two steps one after the other on two plates, or one step while the other foot swings; pelvis markers."
    source = "21 whole steps and 40 single supports of 10 persons of 5 public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one mass for each foot alone, in walking and between two flights, one mass and two horizontal forces
        for each whole step, and one mass of all strides on a belt.
        """
        if self.name not in seen.kept:
            seen.kept[self.name] = self._weights(seen)  # `double_support` and `newton` ask, too
        found: tuple[Observation, ...] = seen.kept[self.name]
        return found

    def _weights(self, seen: SeenTrial) -> tuple[Observation, ...]:
        if seen.pelvis is None or not seen.mass > 0:
            return ()
        inside = [step for step in seen.steps if not step.overhang]
        alone = [one for step in inside for one in (*self._alone(seen, step), *self._flown(seen, step))]
        return (*alone, *self.whole(seen))

    def whole(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one mass and two horizontal forces for each whole step, and one mass of all strides on a belt."""
        if seen.pelvis is None or not seen.mass > 0:
            return ()
        swung = pairwise(step for step in seen.steps if steps(seen, step))
        pairs = [(a, b) for a, b in swung if a.side != b.side and a.plate != b.plate and seen.one_clock]
        return (*(one for pair in pairs for one in self._whole(seen, *pair)), *self._lasting(seen))

    def _lasting(self, seen: SeenTrial) -> list[Observation]:
        moving = [step for step in seen.steps if seen.belt(step) is not None]
        if len(moving) < _MANY or len(moving) < len(seen.steps) or not seen.one_clock:
            return []
        time, names = seen.total.time, {step.plate for step in moving}
        here = slice(*np.searchsorted(time, (moving[0].middle, np.nextafter(moving[-1].middle, np.inf))))
        means = _means(seen, time[here], _all_plates(seen, here))
        where = names.pop() if len(names) == 1 else ""
        return [_weighed(self.name, "all strides", seen, means, "going on", _ON, where)]

    def _alone(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = seen.stance(step)
        if part is None or not is_recorded(seen, step) or not walks(seen, step):
            return []
        time, count = seen.plate(step.plate).wrench.time, part.stop - part.start
        span = slice(part.start + round(_ONE[0] * count), part.start + round(_ONE[1] * count))
        if step.beside:
            here = np.flatnonzero(seen.swings(step, time[span])) + span.start
            # From the first to the last sample of the swing, whatever lies between.
            span = slice(here[0], here[-1] + 1) if here.size else slice(0, 0)
        rate = seen.plate(step.plate).wrench.rate
        if span.stop - span.start < _SHORTEST * rate or _elsewhere(seen, span, step.plate, *step.beside).any():
            return []
        means = _means(seen, time[span], seen.under(step, span))
        return [_weighed(self.name, f"{step.name}, alone", seen, means, "on one foot", _ALONE, step.plate)]

    def _flown(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        """Return the mass of one step from the middle of the flight before it to that of the flight after it."""
        span = _between_flights(seen, step)
        if span is None:
            return []
        means = _means(seen, seen.total.time[span], _all_plates(seen, span))
        own = {f"person weighs on {step.side} foot": _SIDE * seen.mass}
        found = _weighed(self.name, f"{step.name}, alone", seen, means, "in flights", _FLOWN, step.plate)
        return [replace(found, norms={**found.norms, **own})]

    def _whole(self, seen: SeenTrial, first: FootStep, last: FootStep) -> list[Observation]:
        span = _both(seen, first, last)
        if span is None:
            return []
        g, name = seen.trial.settings.gravity, f"{first.side} to {last.side} step"
        what = f"{name} from {first.middle:.2f} s"
        means = _means(seen, seen.total.time[span], _all_plates(seen, span))
        found = [_weighed(self.name, what, seen, means, "in a step", _STEP)]
        for axis, channel in enumerate(("Fx", "Fy")):
            # Newton: the force that the pelvis' acceleration does not need.
            value, sd = float(means.force[axis] - seen.mass * means.moved[axis]), _HORIZONTAL * seen.mass * g
            late, heavier = -seen.mass * means.late[axis], float(means.moved[axis])
            responds = Sensitivity(means.plates(axis), delay=float(late), mass=heavier)
            found.append(
                Observation(
                    self.name, f"{what}, mean {channel}", seen.trial.name, value, sd, 0.0, "N", sensitivity=responds
                )
            )
        return found


@dataclass(frozen=True, eq=False)
class _Means:
    """Mean ``force`` (3,) N and mean acceleration ``moved`` (3,) m/s² of the pelvis, with weights that begin and end as
    a cosine does; ``late`` (3,) m/s³: how that grows where the forces come late; the ``share`` (n,) of each sample and
    the wrenches (n, 6) about the lab origin ``by`` plate.
    """

    force: Array
    moved: Array
    late: Array
    share: Array
    by: Mapping[str, Array]

    def plates(self, channel: int) -> dict[str, Array]:
        """Return by plate the derivative (6, 7) of the mean of one channel."""
        return {name: of_mean(wrench, channel, self.share) for name, wrench in self.by.items()}


def _means(seen: SeenTrial, time: Array, by: Mapping[str, Array]) -> _Means:
    """Return the means over times (n,) s; the acceleration is the path, weighed with the weights' second derivative."""
    share, bend = fading(time)
    path, speed = seen.pelvis_track.at(time), seen.pelvis_track.speed_at(time)
    # Twice by parts: the mean of w x'' is that of w'' x; w'' sums to nothing, so a constant place does not count.
    moved, late = bend @ (path - path.mean(axis=0)), bend @ (speed - speed.mean(axis=0))
    force = sum((share @ wrench[:, :3] for wrench in by.values()), np.zeros(3))
    return _Means(force, moved, late, share, by)


def _all_plates(seen: SeenTrial, span: slice) -> dict[str, Array]:
    return {plate.name: plate.wrench.value[span] for plate in seen.trial.plates}


def _weighed(
    name: str, what: str, seen: SeenTrial, means: _Means, way: str, norm: tuple[float, float, float], plate: str = ""
) -> Observation:
    """Return the mass kg whose weight and acceleration need the mean vertical force."""
    bias, sd, person = norm
    norms = {"person declared mass": seen.mass_doubt, f"person weighs {way}": person * seen.mass}
    # F = m (g + a).
    per = float(seen.trial.settings.gravity + means.moved[2])
    value, expected = float(means.force[2]) / per, (1 + bias) * seen.mass
    plates = {one: slope / per for one, slope in means.plates(2).items()}
    # d/dd of F / (g + a): -F / (g + a)² da/dd.
    responds = Sensitivity(plates, delay=-value / per * float(means.late[2]), mass=1 + bias)
    return Observation(
        name, what, seen.trial.name, value, sd * seen.mass, expected, "kg", plate, norms, sensitivity=responds
    )


def _between_flights(seen: SeenTrial, step: FootStep) -> slice | None:
    """Return the samples from the middle of the flight before a step to that of the flight after it; None without."""
    part = seen.stance(step)
    if part is None or not seen.one_clock or not steps(seen, step):
        return None
    loaded = np.any([plate.wrench.force[:, 2] > ONSET for plate in seen.trial.plates], axis=0)
    before = np.flatnonzero(loaded[: part.start])
    after = np.flatnonzero(loaded[part.stop :])
    if not before.size or not after.size or _elsewhere(seen, part, step.plate).any():
        return None
    gaps = part.start - before[-1] - 1, int(after[0])
    if min(gaps) < _FLIGHT * seen.total.rate:
        return None
    return slice(part.start - gaps[0] // 2, part.stop + gaps[1] // 2)


def _elsewhere(seen: SeenTrial, span: slice, *plates: str) -> NDArray[np.bool_]:
    """Return (n,) whether another plate than ``plates`` is loaded at some samples: the other foot stands there."""
    others = [plate for plate in seen.trial.plates if plate.name not in plates] if seen.one_clock else []
    none = np.zeros(span.stop - span.start, dtype=bool)
    return np.any([none, *(plate.wrench.force[span, 2] > ONSET for plate in others)], axis=0)


def _both(seen: SeenTrial, first: FootStep, last: FootStep) -> slice | None:
    """Return the samples from one single support to the end of the next with no other plate loaded; None without."""
    one, two = seen.stance(first), seen.stance(last)
    if one is None or two is None or two.start >= one.stop or first.overhang or last.overhang:
        return None
    # From the middle of one stance to that of the other no third plate may carry anything.
    middle = slice((one.start + one.stop) // 2, (two.start + two.stop) // 2)
    begin = one.start + round(_ONE[0] * (one.stop - one.start))
    end = two.start + round(_ONE[1] * (two.stop - two.start))
    if _elsewhere(seen, middle, first.plate, last.plate).any():
        return None
    before, after = (
        np.flatnonzero(_elsewhere(seen, span, first.plate, last.plate))
        for span in (slice(begin, middle.start), slice(middle.stop, end))
    )
    return slice(begin + before[-1] + 1 if before.size else begin, middle.stop + after[0] if after.size else end)


OBSERVER = StrideForce

"""What the plates weigh while somebody walks: the mean vertical force over whole steps, and over one foot alone.

From one single support into the next the mean force is the weight but for the change of velocity, which the pelvis
shows. The mean is taken with weights that begin and end smoothly: then no velocity of one instant is needed. In the
middle of a stance the other foot swings: one plate alone says the same a little coarser, and plates are told from each
other. A foot that reaches over the edge of its plate does not weigh: what it treads on beside it is not measured.
"""

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.effects.body_mass import BodyMass
from biodance.effects.clipping import Clipping
from biodance.effects.plate_gain import PlateGain
from biodance.motion.newton import fading
from biodance.records import Array
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._recording import ONSET
from biodance.witnesses._stance import is_recorded, steps, walks

DECLARED = 0.01
"""Share of the declared mass by which careful declarations are wrong: clothes, shoes, another day."""
_STEP, _ALONE, _HORIZONTAL = (-0.001, 0.003, 0.0045), (0.009, 0.0085, 0.008), 0.012
"""Expected error of the mass as a share of it, its sd of one step and of one person: of a whole step, of one foot
alone; sd of the mean horizontal force over a step as a share of the weight."""
_ON = (0.0, 0.002, 0.003)
"""The same of all strides of somebody who goes on on a belt, walking or running: nothing is trodden on beside it."""
_MANY = 6
"""Steps from which somebody goes on."""
_ONE = (0.2, 0.8)
"""Start and stop, as shares of stance, of the time in which the other foot swings."""
_SHORTEST = 0.15
"""s that one foot alone must be seen."""
_KEPT = 64
"""Sets of times of which the pelvis' part is kept."""


class StrideForce(Witness):
    """Mass (kg) by the mean vertical force over a step, over one foot alone, over all strides on a belt, and
    mean horizontal force (N) over a step.
    """

    name = "stride_force"
    sees = (PlateGain.name, BodyMass.name, Clipping.name)
    needs = "Two steps one after the other on two plates, or one step while the other foot swings; pelvis markers."
    source = "21 whole steps and 40 single supports of 10 persons of 5 public laboratories"

    def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one mass for each foot alone, one mass and two horizontal forces for each whole step, and one mass of
        all strides on a belt.
        """
        return _weights(seen)

    def weights(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return the same, weighed anew."""
        if seen.pelvis is None or not seen.mass > 0:
            return ()
        alone = [one for step in seen.steps if not step.overhang for one in self._alone(seen, step)]
        return (*alone, *(one for pair in _pairs(seen) for one in self._whole(seen, *pair)), *self._lasting(seen))

    def _lasting(self, seen: SeenTrial) -> list[Observation]:
        moving = [step for step in seen.steps if seen.belt(step) is not None]
        if len(moving) < _MANY or len(moving) < len(seen.steps) or not seen.one_clock:
            return []
        total, names = seen.total, {step.plate for step in moving}
        here = (total.time >= moving[0].middle) & (total.time <= moving[-1].middle)
        value = _mass(seen, _means(seen, total.time[here], total.force[here]))
        return [
            _weighed(self.name, "all strides", seen, value, "going on", _ON, names.pop() if len(names) == 1 else "")
        ]

    def _alone(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = seen.stance(step)
        if part is None or not is_recorded(seen, step) or not walks(seen, step):
            return []
        wrench, count = seen.under(step), part.stop - part.start
        span = slice(part.start + round(_ONE[0] * count), part.start + round(_ONE[1] * count))
        if step.beside:
            here = np.flatnonzero(seen.swings(step, wrench.time[span])) + span.start
            span = slice(here[0], here[-1] + 1) if here.size else slice(0, 0)
        if span.stop - span.start < _SHORTEST * wrench.rate or _elsewhere(seen, step.plate, *step.beside)[span].any():
            return []
        value = _mass(seen, _means(seen, wrench.time[span], wrench.force[span]))
        return [_weighed(self.name, f"{step.name}, alone", seen, value, "on one foot", _ALONE, step.plate)]

    def _whole(self, seen: SeenTrial, first: FootStep, last: FootStep) -> list[Observation]:
        span = _both(seen, first, last)
        if span is None:
            return []
        total, g, name = seen.total, seen.trial.settings.gravity, f"{first.side} to {last.side} step"
        time, force = total.time[span], total.force[span]
        what = f"{name} from {first.middle:.2f} s"
        needed = _means(seen, time, force)
        found = [_weighed(self.name, what, seen, _mass(seen, needed), "in a step", _STEP)]
        for axis, channel in enumerate(("Fx", "Fy")):
            value, sd = float(needed[0, axis] - seen.mass * needed[1, axis]), _HORIZONTAL * seen.mass * g
            found.append(Observation(self.name, f"{what}, mean {channel}", seen.trial.name, value, sd, 0.0, "N"))
        return found


@lru_cache(maxsize=2)
def _weights(seen: SeenTrial) -> tuple[Observation, ...]:
    """Return what a trial weighs; of the last ones it is kept: `double_support` asks, too."""
    return StrideForce().weights(seen)


def _weighed(
    name: str, what: str, seen: SeenTrial, value: float, way: str, norm: tuple[float, float, float], plate: str = ""
) -> Observation:
    bias, sd, person = norm
    norms = {"person declared mass": DECLARED * seen.mass, f"person weighs {way}": person * seen.mass}
    expected = (1 + bias) * seen.mass
    return Observation(name, what, seen.trial.name, value, sd * seen.mass, expected, "kg", plate, norms)


def _means(seen: SeenTrial, time: Array, force: Array) -> Array:
    """Return the mean force (3,) N and the mean acceleration (3,) m/s² of the pelvis, with weights that begin and end
    as a cosine does: the acceleration is that of the path, weighed with the weights' second derivative.
    """
    key = time.tobytes()
    if key not in seen.moments:
        if len(seen.moments) >= _KEPT:
            seen.moments.pop(next(iter(seen.moments)))
        seen.moments[key] = _fading(seen, time)
    share, moved = seen.moments[key]
    return np.stack([share @ force, moved])


def _fading(seen: SeenTrial, time: Array) -> tuple[Array, Array]:
    """Return the share (n,) of each of the times (n,) s in a mean, and the pelvis' mean acceleration (3,) m/s²."""
    share, bend = fading(time)
    path = seen.pelvis_at(time)
    return share, bend @ (path - path.mean(axis=0))


def _mass(seen: SeenTrial, means: Array) -> float:
    """Return the mass kg whose weight and acceleration need the mean vertical force, of the ``means`` (2, 3) of force
    N and acceleration m/s².
    """
    needed, moved = means[:, 2]
    return float(needed / (seen.trial.settings.gravity + moved))


def _pairs(seen: SeenTrial) -> Iterator[tuple[FootStep, FootStep]]:
    """Return steps that follow one another with different feet, the second before the first has ended."""
    swung = [step for step in seen.steps if steps(seen, step)]
    for first, last in pairwise(swung):
        if first.side != last.side and first.plate != last.plate and seen.one_clock:
            yield first, last


def _elsewhere(seen: SeenTrial, *plates: str) -> NDArray[np.bool_]:
    """Return (S,) whether another plate than ``plates`` is loaded: the other foot stands there."""
    others = [plate for plate in seen.trial.plates if plate.name not in plates] if seen.one_clock else []
    none = np.zeros(seen.plate(plates[0]).wrench.time.size, dtype=bool)
    return np.any([none, *(plate.wrench.force[:, 2] > ONSET for plate in others)], axis=0)


def _both(seen: SeenTrial, first: FootStep, last: FootStep) -> slice | None:
    """Return the samples from the single support of one step to the end of that of the next, or less, as long as no
    other plate is loaded; None where a foot is in the air between, reaches beside its plate or stands elsewhere.
    """
    one, two = seen.stance(first), seen.stance(last)
    if one is None or two is None or two.start >= one.stop or first.overhang or last.overhang:
        return None
    middle = slice((one.start + one.stop) // 2, (two.start + two.stop) // 2)
    begin = one.start + round(_ONE[0] * (one.stop - one.start))
    end = two.start + round(_ONE[1] * (two.stop - two.start))
    loaded = _elsewhere(seen, first.plate, last.plate)
    if loaded[middle].any():
        return None
    before, after = np.flatnonzero(loaded[begin : middle.start]), np.flatnonzero(loaded[middle.stop : end])
    return slice(begin + before[-1] + 1 if before.size else begin, middle.stop + after[0] if after.size else end)


WITNESS = StrideForce

"""What the plates weigh while somebody walks: the mean vertical force over whole steps, and over one foot alone.

From the middle of one stance to the middle of the next the body comes back to the same height and speed: the mean force
is its weight but for the change of velocity, which the pelvis shows. In the middle of a stance the other foot swings:
one plate alone says the same a little coarser, and plates are told from each other.
"""

from collections.abc import Iterator

import numpy as np

from biodance.records import Array
from biodance.witnesses import FootStep, Observation, SeenTrial, Witness
from biodance.witnesses._recording import ONSET

DECLARED = 0.01
"""Share of the declared mass by which careful declarations are wrong: clothes, shoes, another day."""
_STEP, _ALONE, _HORIZONTAL = (-0.001, 0.0065), (0.009, 0.013), 0.012
"""Expected error and sd of the mass as shares of it: of a whole step, of one foot alone; sd of the mean horizontal
force over a step as a share of the weight."""
_ONE = (0.2, 0.8)
"""Start and stop, as shares of stance, of the time in which the other foot swings."""
_SHORTEST = 0.15
"""s that one foot alone must be seen."""


class StrideForce(Witness):
    """Mass (kg) by the mean vertical force over a step or over one foot alone, and mean horizontal force (N) over a
    step.
    """

    name = "stride_force"
    sees = ("plate_gain", "body_mass", "clipping")
    needs = "Two steps one after the other on two plates, or one step while the other foot swings; pelvis markers."
    source = "21 whole steps and 40 single supports of 10 persons of 5 public laboratories"

    def look(self, seen: SeenTrial) -> tuple[Observation, ...]:
        """Return one mass for each foot alone, and one mass and two horizontal forces for each whole step."""
        if seen.pelvis is None or not seen.mass > 0:
            return ()
        alone = [one for step in seen.steps for one in self._alone(seen, step)]
        return (*alone, *(one for pair in _pairs(seen) for one in self._whole(seen, *pair)))

    def _alone(self, seen: SeenTrial, step: FootStep) -> list[Observation]:
        part = seen.stance(step)
        if part is None:
            return []
        wrench, count = seen.under(step), part.stop - part.start
        span = slice(part.start + round(_ONE[0] * count), part.start + round(_ONE[1] * count))
        if step.beside:
            here = np.flatnonzero(seen.swings(step, wrench.time[span])) + span.start
            span = slice(here[0], here[-1] + 1) if here.size else slice(0, 0)
        if span.stop - span.start < _SHORTEST * wrench.rate or _beside(seen, step.plate, *step.beside, span=span):
            return []
        value = _mass(seen, wrench.time[span], wrench.force[span, 2])
        bias, sd = _ALONE
        return [_weighed(self.name, f"{step.name}, alone", seen, value, bias, sd, step.plate)]

    def _whole(self, seen: SeenTrial, first: FootStep, last: FootStep) -> list[Observation]:
        span = _middle_to_middle(seen, first, last)
        if span is None:
            return []
        total, g, name = seen.trial.wrench, seen.trial.settings.gravity, f"{first.side} to {last.side} step"
        time, force = total.time[span], total.force[span]
        what = f"{name} from {first.middle:.2f} s"
        found = [_weighed(self.name, what, seen, _mass(seen, time, force[:, 2]), *_STEP)]
        change = seen.mass * _change(seen, time) / (time[-1] - time[0])
        for axis, channel in enumerate(("Fx", "Fy")):
            value = float(force[:, axis].mean() - change[axis])
            sd = _HORIZONTAL * seen.mass * g
            found.append(Observation(self.name, f"{what}, mean {channel}", seen.trial.name, value, sd, 0.0, "N"))
        return found


def _weighed(
    name: str, what: str, seen: SeenTrial, value: float, bias: float, sd: float, plate: str = ""
) -> Observation:
    norms = {"person declared mass": DECLARED * seen.mass}
    expected = (1 + bias) * seen.mass
    return Observation(name, what, seen.trial.name, value, sd * seen.mass, expected, "kg", plate, norms)


def _change(seen: SeenTrial, time: Array) -> Array:
    """Return (3,) m/s: the change of the pelvis's velocity from the first to the last time."""
    velocity = seen.pelvis_velocity(time[[0, -1]])
    return np.asarray(velocity[1] - velocity[0])


def _mass(seen: SeenTrial, time: Array, vertical: Array) -> float:
    """Return the mass kg whose weight and change of velocity need the mean vertical force."""
    change = _change(seen, time)[2] / (time[-1] - time[0])
    return float(vertical.mean() / (seen.trial.settings.gravity + change))


def _pairs(seen: SeenTrial) -> Iterator[tuple[FootStep, FootStep]]:
    """Return steps that follow one another with different feet, the second before the first has ended."""
    for first, last in zip(seen.steps, seen.steps[1:], strict=False):
        if first.side != last.side and first.plate != last.plate and _one_clock(seen):
            yield first, last


def _one_clock(seen: SeenTrial) -> bool:
    """Return whether all plates share one time base, so that their forces add."""
    time = seen.trial.plates[0].wrench.time
    return all(np.array_equal(plate.wrench.time, time) for plate in seen.trial.plates)


def _beside(seen: SeenTrial, *plates: str, span: slice) -> bool:
    """Return whether another plate than ``plates`` is loaded in ``span``: the other foot stands there."""
    others = [plate for plate in seen.trial.plates if plate.name not in plates] if _one_clock(seen) else []
    return any(bool((plate.wrench.force[span, 2] > ONSET).any()) for plate in others)


def _middle_to_middle(seen: SeenTrial, first: FootStep, last: FootStep) -> slice | None:
    """Return the samples from the middle of one stance to that of the next; None where a foot is in the air between
    or a plate without a foot of these steps is loaded.
    """
    parts = [seen.stance(step) for step in (first, last)]
    if parts[0] is None or parts[1] is None or parts[1].start >= parts[0].stop:
        return None
    span = slice((parts[0].start + parts[0].stop) // 2, (parts[1].start + parts[1].stop) // 2)
    return None if _beside(seen, first.plate, last.plate, span=span) else span


WITNESS = StrideForce

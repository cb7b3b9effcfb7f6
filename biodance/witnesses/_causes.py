"""What causes do to a recording: the plates' records are altered as a wrong file, cable or clock would alter them.

Witnesses are asked again about the altered recording; the difference is their sensitivity. Names and parameters are
those of the effects (`biodance.effects`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from biodance.effects.axis_error import AxisError
from biodance.effects.body_mass import BodyMass
from biodance.lab.plates.faults import CROSSTALK, DELAY, GAIN, OFFSET, POSITION, ROTATION, PlateFault
from biodance.records import CHANNELS, Plate, Wrench
from biodance.spatial import wrench_about_origin, wrench_about_point
from biodance.witnesses._recording import SeenTrial


@dataclass(frozen=True, eq=False)
class Alteration:
    """A cause with one size: ``effect`` and ``target`` as in the family of effects, its ``parameter`` and ``unit``, a
    small size ``step`` for differences; ``alter`` returns the recording that a size of it would have produced.
    """

    effect: str
    target: str
    parameter: str
    unit: str
    step: float
    alter: Callable[[SeenTrial, float], SeenTrial]

    @property
    def names(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect, self.target


def possible_causes(seen: SeenTrial, *, single: bool | None = None) -> tuple[Alteration, ...]:
    """Return the causes that witnesses are asked about, in a recording with these plates; ``single`` whether targets
    are named without the plate, because the session has no other (by default: this recording has none).
    """
    single = len(seen.trial.plates) == 1 if single is None else single
    found = [
        _of_plates(DELAY, tuple(plate.name for plate in seen.trial.plates), "", "", "s", 0.004),
        Alteration(BodyMass.name, "", "error", "kg", 0.5, lambda seen, size: replace(seen, mass=seen.mass - size)),
    ]
    for plate in seen.trial.plates:
        name = plate.name
        prefix = "" if single else f"{name}:"
        found += [_of_plates(POSITION, (name,), f"{name}:", axis, "m", 0.004) for axis in "xy"]
        found.append(_of_plates(ROTATION, (name,), f"{name}:", "z", "rad", 0.02))
        found += [_of_plates(OFFSET, (name,), prefix, channel, "N", 2.0) for channel in CHANNELS[:3]]
        found += [_of_plates(OFFSET, (name,), prefix, channel, "N·m", 0.5) for channel in CHANNELS[3:]]
        found += [_of_plates(GAIN, (name,), prefix, channel, "1", 0.02) for channel in CHANNELS[:3]]
        found += [_of_plates(CROSSTALK, (name,), prefix, f"Fz->{moment}", "m", 0.004) for moment in ("Mx", "My")]
    return tuple(found)


def turned_signs(seen: SeenTrial, *, single: bool) -> Mapping[tuple[str, str], Callable[[SeenTrial], SeenTrial]]:
    """Return by effect and target what undoes one channel of one plate that has the wrong sign.

    Where that is the vertical force, the reader has turned the whole plate round to make the weight point up.
    ``single`` as in `possible_causes`.
    """
    prefix = {plate.name: "" if single else f"{plate.name}:" for plate in seen.trial.plates}
    return MappingProxyType(
        {
            (AxisError.name, f"{prefix[plate.name]}{name}"): _mirrored(plate.name, name)
            for plate in seen.trial.plates
            for name in CHANNELS[:5]
        }
    )


def _of_plates(
    fault: PlateFault, plates: tuple[str, ...], prefix: str, place: str, unit: str, step: float
) -> Alteration:
    """Return a fault of some plates; a zero that the reader found and took off is still what the plate reads empty."""

    def recorded(plate: Plate, size: float) -> Plate:
        if fault is OFFSET and was_zeroed(plate):
            return replace(plate, zero=plate.zero + size * fault.zero(place)[:3])
        return fault.done(plate, place, size)

    def alter(seen: SeenTrial, size: float) -> SeenTrial:
        every = (recorded(plate, size) if plate.name in plates else plate for plate in seen.trial.plates)
        return replace(seen, trial=replace(seen.trial, plates=tuple(every)))

    return Alteration(fault.name, f"{prefix}{place}", fault.parameter, unit, step, alter)


def _mirrored(name: str, channel: str) -> Callable[[SeenTrial], SeenTrial]:
    sign = 1.0 - 2.0 * np.eye(6)[CHANNELS.index(channel)]
    sign = -sign if channel == "Fz" else sign

    def mirrored(plate: Plate) -> Plate:
        local = wrench_about_point(plate.wrench.value, plate.centre) * sign
        return replace(plate, wrench=Wrench(plate.wrench.time, wrench_about_origin(local, plate.centre)))

    def undo(seen: SeenTrial) -> SeenTrial:
        every = (mirrored(plate) if plate.name == name else plate for plate in seen.trial.plates)
        return replace(seen, trial=replace(seen.trial, plates=tuple(every)))

    return undo


def was_zeroed(plate: Plate) -> bool:
    """Return whether the reader found the plate empty in this trial and took its reading off."""
    return any("subtracted" in said and "nothing was subtracted" not in said for said in plate.decisions)

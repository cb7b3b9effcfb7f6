"""What causes do to a recording: the plates' records are altered as a wrong file, cable or clock would alter them.

Witnesses are asked again about the altered recording; the difference is their sensitivity. Names and parameters are
those of the effects (`biodance.effects`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from biodance.records import CHANNELS, Array, Plate, Wrench
from biodance.spatial import axis_rotation, wrench_about_origin, wrench_about_point
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
        Alteration("time_delay", "", "delay", "s", 0.004, _late),
        Alteration("body_mass", "", "error", "kg", 0.5, lambda seen, size: replace(seen, mass=seen.mass - size)),
    ]
    for plate in seen.trial.plates:
        prefix = "" if single else f"{plate.name}:"
        found += [
            Alteration("plate_position", f"{plate.name}:{a}", "shift", "m", 0.004, _moved(plate.name, a)) for a in "xy"
        ]
        found.append(Alteration("plate_rotation", f"{plate.name}:z", "angle", "rad", 0.02, _turned(plate.name)))
        for k, name in enumerate(CHANNELS):
            unit = "N" if k < 3 else "N·m"
            found.append(
                Alteration(
                    "plate_offset", f"{prefix}{name}", "offset", unit, 2.0 if k < 3 else 0.5, _offset(plate.name, k)
                )
            )
        for k, name in enumerate(CHANNELS[:3]):
            found.append(Alteration("plate_gain", f"{prefix}{name}", "gain", "1", 0.02, _gained(plate.name, k)))
        for k, name in ((3, "Mx"), (4, "My")):
            found.append(
                Alteration("plate_crosstalk", f"{prefix}Fz->{name}", "ratio", "m", 0.004, _crossed(plate.name, k))
            )
    return tuple(found)


def turned_signs(seen: SeenTrial, *, single: bool) -> Mapping[tuple[str, str], Callable[[SeenTrial], SeenTrial]]:
    """Return by effect and target what undoes one channel of one plate that has the wrong sign.

    Where that is the vertical force, the reader has turned the whole plate round to make the weight point up.
    ``single`` as in `possible_causes`.
    """
    prefix = {plate.name: "" if single else f"{plate.name}:" for plate in seen.trial.plates}
    return MappingProxyType(
        {
            ("axis_error", f"{prefix[plate.name]}{name}"): _mirrored(plate.name, name)
            for plate in seen.trial.plates
            for name in CHANNELS[:5]
        }
    )


def _with(seen: SeenTrial, plate: Plate) -> SeenTrial:
    """Return the recording with one plate replaced by its altered self."""
    plates = tuple(plate if one.name == plate.name else one for one in seen.trial.plates)
    return replace(seen, trial=replace(seen.trial, plates=plates))


def _about_centre(seen: SeenTrial, name: str, change: Callable[[Array], Array]) -> SeenTrial:
    """Return the recording with a change of a plate's wrench (S, 6) about its centre."""
    plate = seen.plate(name)
    value = wrench_about_origin(change(wrench_about_point(plate.wrench.value, plate.centre)), plate.centre)
    return _with(seen, replace(plate, wrench=Wrench(plate.wrench.time, value)))


def _in_channel(seen: SeenTrial, name: str, k: int, added: Array | float) -> SeenTrial:
    """Return the recording with ``added`` (S,) or always the same in channel ``k`` of a plate, about its centre."""
    plate = seen.plate(name)
    unit = wrench_about_origin(np.eye(6)[k], plate.centre)
    value = plate.wrench.value + np.multiply.outer(added, unit)
    value.setflags(write=False)  # the record keeps it without a copy
    return _with(seen, replace(plate, wrench=Wrench(plate.wrench.time, value)))


def _late(seen: SeenTrial, delay: float) -> SeenTrial:
    plates = tuple(replace(p, wrench=Wrench(p.wrench.time + delay, p.wrench.value)) for p in seen.trial.plates)
    return replace(seen, trial=replace(seen.trial, plates=plates))


def _moved(name: str, axis: str) -> Callable[[SeenTrial, float], SeenTrial]:
    def alter(seen: SeenTrial, shift: float) -> SeenTrial:
        plate, vector = seen.plate(name), shift * np.eye(3)["xyz".index(axis)]
        value = wrench_about_origin(plate.wrench.value, vector)
        return _with(seen, replace(plate, wrench=Wrench(plate.wrench.time, value), corners=plate.corners + vector))

    return alter


def _turned(name: str) -> Callable[[SeenTrial, float], SeenTrial]:
    def alter(seen: SeenTrial, angle: float) -> SeenTrial:
        turn = axis_rotation(np.array([0.0, 0.0, 1.0]), np.array([angle]))[0]
        return _about_centre(seen, name, lambda w: np.concatenate([w[:, :3] @ turn.T, w[:, 3:] @ turn.T], axis=1))

    return alter


def _offset(name: str, k: int) -> Callable[[SeenTrial, float], SeenTrial]:
    def alter(seen: SeenTrial, offset: float) -> SeenTrial:
        plate = seen.plate(name)
        if was_zeroed(plate):
            return _with(seen, replace(plate, zero=plate.zero + offset * np.eye(6)[k][:3]))
        return _in_channel(seen, name, k, offset)

    return alter


def _gained(name: str, k: int) -> Callable[[SeenTrial, float], SeenTrial]:
    return lambda seen, gain: _in_channel(seen, name, k, gain * seen.plate(name).wrench.value[:, k])


def _crossed(name: str, k: int) -> Callable[[SeenTrial, float], SeenTrial]:
    return lambda seen, ratio: _in_channel(seen, name, k, ratio * seen.plate(name).wrench.value[:, 2])


def _mirrored(name: str, channel: str) -> Callable[[SeenTrial], SeenTrial]:
    sign = 1.0 - 2.0 * np.eye(6)[CHANNELS.index(channel)]
    sign = -sign if channel == "Fz" else sign
    return lambda seen: _about_centre(seen, name, lambda w: w * sign)


def was_zeroed(plate: Plate) -> bool:
    """Return whether the reader found the plate empty in this trial and took its reading off."""
    return any("subtracted" in said and "nothing was subtracted" not in said for said in plate.decisions)

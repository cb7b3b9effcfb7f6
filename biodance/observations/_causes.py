"""What causes do to a recording: plates' records are changed as a wrong file, cable or clock would change them.

Names and parameters are those of the effects (`biodance.effects`). One table says what a fault of a plate does to its
wrench (`plate_change`): observations' sensitivities and the correction of a recording both come from it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy.linalg import expm

from biodance.observations._recording import SeenTrial
from biodance.observations._sensitivity import Sensitivity
from biodance.records import CHANNELS, Array, Plate, Wrench
from biodance.spatial import skew, wrench_shift


@dataclass(frozen=True)
class ObservableCause:
    """A fault with one size: ``effect``, ``target`` and ``parameter`` as in the family of effects, the parameter's
    ``unit``, and a small size ``step``.
    """

    effect: str
    target: str
    parameter: str
    unit: str
    step: float

    @property
    def names(self) -> tuple[str, str]:
        """Effect and target."""
        return self.effect, self.target


class _Observed(Protocol):
    @property
    def sensitivity(self) -> Sensitivity: ...


def possible_causes(seen: SeenTrial, *, single: bool | None = None) -> tuple[ObservableCause, ...]:
    """Return the causes that are looked for in a recording with these plates; ``single`` whether targets are named
    without the plate, because the session has no other (by default: this recording has none).
    """
    single = len(seen.trial.plates) == 1 if single is None else single
    found = [
        ObservableCause("time_delay", "", "delay", "s", 0.004),
        ObservableCause("body_mass", "", "error", "kg", 0.5),
    ]
    for plate in seen.trial.plates:
        prefix = "" if single else f"{plate.name}:"
        found += [ObservableCause("plate_position", f"{plate.name}:{axis}", "shift", "m", 0.004) for axis in "xy"]
        found.append(ObservableCause("plate_rotation", f"{plate.name}:z", "angle", "rad", 0.02))
        found += [ObservableCause("plate_offset", f"{prefix}{name}", "offset", "N", 2.0) for name in CHANNELS[:3]]
        found += [ObservableCause("plate_offset", f"{prefix}{name}", "offset", "N·m", 0.5) for name in CHANNELS[3:]]
        found += [ObservableCause("plate_gain", f"{prefix}{name}", "gain", "1", 0.02) for name in CHANNELS[:3]]
        found += [
            ObservableCause("plate_crosstalk", f"{prefix}Fz->{name}", "ratio", "m", 0.004) for name in ("Mx", "My")
        ]
    return tuple(found)


def _shifted(_plate: Plate, axis: str) -> Array:
    """Return the moment of the force over a shift of a metre; the height of a plate changes no pressure on it."""
    out = np.zeros((6, 7))
    out[3:, :3] = skew(np.eye(3)["xyz".index(axis)]) if axis != "z" else 0.0
    return out


def _about_centre(plate: Plate, local: Array) -> Array:
    """Return the change B (6, 7) about the lab origin of what is changed by ``local`` (6, 7) about a plate's centre."""
    there = wrench_shift(plate.centre)
    return np.asarray(np.linalg.inv(there) @ np.column_stack([local[:, :6] @ there, local[:, 6]]))


def _turned(plate: Plate, axis: str) -> Array:
    turn = skew(np.eye(3)["xyz".index(axis)])
    return _about_centre(plate, np.column_stack([np.kron(np.eye(2), turn), np.zeros(6)]))


def _in_channel(plate: Plate, source: int, channel: str) -> Array:
    """Return the change by an entry of [w; 1] (6: a constant) in one channel about the plate's centre."""
    return _about_centre(plate, np.outer(np.eye(6)[CHANNELS.index(channel)], np.eye(7)[source]))


_CHANGES: Mapping[str, tuple[str, Callable[[Plate, str], Array]]] = MappingProxyType(
    {
        "plate_position": ("shift", _shifted),
        "plate_rotation": ("angle", _turned),
        "plate_offset": ("offset", lambda plate, channel: _in_channel(plate, 6, channel)),
        "plate_gain": ("gain", lambda plate, channel: _in_channel(plate, CHANNELS.index(channel), channel)),
        "plate_crosstalk": (
            "ratio",
            lambda plate, pair: _in_channel(plate, CHANNELS.index(pair.partition("->")[0]), pair.partition("->")[2]),
        ),
    }
)
"""Parameter of each effect that maps a plate's wrench, and what one unit of it adds."""


def plate_change(effect: str, target: str, plate: Plate) -> Array:
    """Return B (6, 7): what one unit of a fault adds to a plate's wrench w about the lab origin is B [w; 1]; zero for
    faults of other plates, and where a reader's zero takes it off.

    ``target`` as in the family of effects (``plate1:x``, ``plate1:Fz->Mx``, ``Fz`` where there is one plate).
    """
    name, _, where = target.rpartition(":")
    taken_off = effect == "plate_offset" and was_zeroed(plate)
    if effect not in _CHANGES or name not in ("", plate.name) or taken_off:
        return np.zeros((6, 7))
    return _CHANGES[effect][1](plate, where)


def sensitivities(seen: SeenTrial, found: Sequence[_Observed], effect: str, target: str, parameter: str) -> Array:
    """Return (n,) the derivatives of the values less the expectations of the observations ``found`` in one recording
    with respect to a parameter of an effect; 0 where an observation does not respond.
    """
    known = [one.sensitivity for one in found]
    if (effect, parameter) == ("time_delay", "delay"):
        return np.array([one.delay for one in known])
    if (effect, parameter) in {("body_mass", "error"), ("added_mass", "mass")}:
        return np.array([one.mass for one in known])
    if effect == "toe_landmark":
        sides = ("left", "right") if target == "both" else (target,)
        return np.array([sum(one.landmarks.get((side, parameter), 0.0) for side in sides) for one in known])
    out = np.zeros(len(known))
    if effect not in _CHANGES or _CHANGES[effect][0] != parameter:
        return out
    for plate in seen.trial.plates:
        change = plate_change(effect, target, plate)
        out += [one.to(plate.name, change) for one in known]
        if effect == "plate_offset" and target in (f"{plate.name}:{target[-2:]}", target[-2:]) and was_zeroed(plate):
            level = np.eye(6)[CHANNELS.index(target[-2:])][:3]
            out += [one.zero[plate.name] @ level if plate.name in one.zero else 0.0 for one in known]
    return out


def corrected(seen: SeenTrial, effect: str, target: str, size: float) -> SeenTrial:
    """Return the recording that would have been made without a cause of a ``size``."""
    trial = seen.trial
    if effect == "body_mass":
        return replace(seen, mass=seen.mass + size)
    if effect == "time_delay":
        plates = [replace(p, wrench=Wrench(p.wrench.time - size, p.wrench.value)) for p in trial.plates]
    else:
        plates = [_corrected(plate, effect, target, size) for plate in trial.plates]
    return replace(seen, trial=replace(trial, plates=tuple(plates)))


def _corrected(plate: Plate, effect: str, target: str, size: float) -> Plate:
    """Return a plate without a fault of a ``size``: a turn is undone by the turn back, all else is linear."""
    name, _, where = target.rpartition(":")
    if effect == "plate_offset" and name in ("", plate.name) and was_zeroed(plate):
        return replace(plate, zero=plate.zero - size * np.eye(6)[CHANNELS.index(where)][:3])
    change = plate_change(effect, target, plate)
    if not change.any():
        return plate
    added = -size * change
    if effect == "plate_rotation":
        added[:, :6] = expm(added[:, :6]) - np.eye(6)
    corners = plate.corners
    if effect == "plate_position":
        corners = corners - size * np.eye(3)["xyz".index(where)]
    return replace(plate, wrench=_changed(plate.wrench, added), corners=corners)


def _changed(wrench: Wrench, change: Array) -> Wrench:
    value = wrench.value + wrench.value @ change[:, :6].T + change[:, 6]
    value.setflags(write=False)  # the record keeps it without a copy
    return Wrench(wrench.time, value)


def sign_reversals(seen: SeenTrial, *, single: bool) -> Mapping[tuple[str, str], tuple[str, Array]]:
    """Return by effect and target the plate and the change B (6, 7) that turn one channel round, about its centre.

    Where that is the vertical force, the reader has turned the whole plate round to make the weight point up: all other
    channels are reversed. ``single`` as in `possible_causes`.
    """
    found = {}
    for plate in seen.trial.plates:
        for k, name in enumerate(CHANNELS[:5]):
            wrong = np.eye(6)[k] if name != "Fz" else 1 - np.eye(6)[k]
            change = _about_centre(plate, np.column_stack([np.diag(-2 * wrong), np.zeros(6)]))
            found["axis_error", name if single else f"{plate.name}:{name}"] = plate.name, change
    return MappingProxyType(found)


def with_changed_plate(seen: SeenTrial, name: str, change: Array) -> SeenTrial:
    """Return the recording with a plate's wrench changed by B (6, 7) about the lab origin."""
    plates = [
        replace(plate, wrench=_changed(plate.wrench, change)) if plate.name == name else plate
        for plate in seen.trial.plates
    ]
    return replace(seen, trial=replace(seen.trial, plates=tuple(plates)))


def was_zeroed(plate: Plate) -> bool:
    """Return whether the reader found the plate empty in this trial and took its reading off."""
    return any("subtracted" in said and "nothing was subtracted" not in said for said in plate.decisions)

"""What causes do to a recording, and how an observation responds: to plates, clocks, the declared mass, foot markers.

Plates' records are changed as a wrong file, cable or clock would change them; names and parameters are those of the
effects (`biodance.effects`). What a fault of a plate does to its wrench is said once (`lab.plates.faults`).

Every fault of a plate that is told by its wrench is an affine map of it: w becomes w + B [w; 1] with a matrix B (6, 7).
The derivative of an observation with respect to B is all that any such fault needs (`plate_change`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np

from biodance.effects.added_mass import AddedMass
from biodance.effects.axis_error import AxisError
from biodance.effects.body_mass import BodyMass
from biodance.effects.toe_landmark import ToeLandmark
from biodance.lab.plates.faults import CROSSTALK, DELAY, GAIN, OFFSET, PLATE_FAULTS, POSITION, ROTATION, PlateFault
from biodance.observations._recording import SeenTrial
from biodance.records import CHANNELS, SIDES, Array, Plate, Wrench
from biodance.spatial import wrench_shift


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of an observation's value less its expectation, unit of the observation over that of the change.

    ``plates`` by name (6, 7): with respect to the matrix B of a plate whose wrench w (6,) N, N·m about the lab origin
    becomes w + B [w; 1]; ``zero`` by plate (3,) 1/N: of the force that its reader took off; ``delay`` 1/s: of all
    forces, late = positive; ``mass`` 1/kg: of what the person weighs more than declared; ``landmarks`` 1/m by side and
    direction: of toe markers that lie ``inwards``, of heel markers that lie ``backwards`` of where they are expected.
    ``linear``: ``plates`` holds for changes of any size that leave the vertical force as it is.
    """

    plates: Mapping[str, Array] = field(default_factory=dict)
    zero: Mapping[str, Array] = field(default_factory=dict)
    delay: float = 0.0
    mass: float = 0.0
    landmarks: Mapping[tuple[str, str], float] = field(default_factory=dict)
    linear: bool = True

    def __sub__(self, other: "Sensitivity") -> "Sensitivity":
        """Return the sensitivity of the difference of two observations' values."""
        plates = {
            name: self.plates.get(name, np.zeros((6, 7))) - other.plates.get(name, np.zeros((6, 7)))
            for name in (*self.plates, *other.plates)
        }
        return Sensitivity(plates, delay=self.delay - other.delay, mass=self.mass - other.mass)

    def to(self, plate: str, change: Array) -> float:
        """Return the derivative with respect to the size of a ``change`` B (6, 7) of a plate."""
        # <gradient, change>: chain rule, summed over all elements.
        return float(np.vdot(self.plates[plate], change)) if plate in self.plates else 0.0


def by_plate(gradient: Array, plates: Mapping[str, Array]) -> dict[str, Array]:
    """Return by plate the derivative (6, 7) with respect to B of a function of the sum of their wrenches (n, 6) about
    the lab origin, whose derivatives with respect to its samples are ``gradient`` (n, 6).
    """
    # d/dB_ij is the derivative with respect to channel i times w_j (last column: 1), summed over the samples.
    return {name: np.column_stack([gradient.T @ wrench, gradient.sum(axis=0)]) for name, wrench in plates.items()}


def of_mean(wrench: Array, channel: int, weights: Array | None = None) -> Array:
    """Return the derivative (6, 7) with respect to B of the mean of one channel of a wrench (n, 6); ``weights`` (n,)
    by default all the same.
    """
    out = np.zeros((6, 7))
    mean = wrench.mean(axis=0) if weights is None else weights @ wrench
    # d(mean of channel i) / dB_ij: mean of w_j, and 1 for the constant.
    out[channel] = np.append(mean, 1.0 if weights is None else weights.sum())
    return out


def pressure_gradient(wrench: Array, direction: Array, height: float) -> Array:
    """Return the derivatives (n, 6) of ``direction`` (n, 2) @ centre of pressure with respect to the wrench (n, 6)
    about the lab origin; the pressure x = (Fx h - My) / Fz, y = (Fy h + Mx) / Fz at ``height`` h m.
    """
    fx, fy, fz, mx, my, _ = wrench.T
    # u / Fz: dx/dMy = -1 / Fz, dy/dMx = 1 / Fz, d(place)/dFz = -place / Fz.
    along_x, along_y = direction.T / fz
    place = (along_x * (fx * height - my) + along_y * (fy * height + mx)) / fz
    none = np.zeros_like(fz)
    return np.stack([along_x * height, along_y * height, -place, along_y, -along_x, none], axis=1)


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
    found = [_cause(DELAY, "", "s", 0.004), ObservableCause(BodyMass.name, "", "error", "kg", 0.5)]
    for plate in seen.trial.plates:
        own = f"{plate.name}:"
        prefix = "" if single else own
        found += [_cause(POSITION, f"{own}{axis}", "m", 0.004) for axis in "xy"]
        found.append(_cause(ROTATION, f"{own}z", "rad", 0.02))
        found += [_cause(OFFSET, f"{prefix}{channel}", "N", 2.0) for channel in CHANNELS[:3]]
        found += [_cause(OFFSET, f"{prefix}{channel}", "N·m", 0.5) for channel in CHANNELS[3:]]
        found += [_cause(GAIN, f"{prefix}{channel}", "1", 0.02) for channel in CHANNELS[:3]]
        found += [_cause(CROSSTALK, f"{prefix}Fz->{moment}", "m", 0.004) for moment in ("Mx", "My")]
    return tuple(found)


def _cause(fault: PlateFault, target: str, unit: str, step: float) -> ObservableCause:
    return ObservableCause(fault.name, target, fault.parameter, unit, step)


def _about_centre(plate: Plate, slope: Array, zero: Array) -> Array:
    """Return B (6, 7) about the lab origin of ``slope`` (6, 6) @ wrench + ``zero`` (6,) about a plate's centre."""
    # About the centre, the fault there, and back about the origin.
    there, back = wrench_shift(plate.centre), wrench_shift(-plate.centre)
    return np.asarray(back @ np.column_stack([slope @ there, zero]))


def plate_change(effect: str, target: str, plate: Plate) -> Array:
    """Return B (6, 7): what one unit of a fault adds to a plate's wrench w about the lab origin is B [w; 1]; zero for
    faults of other plates, and where a reader's zero takes it off.

    ``target`` as in the family of effects (``plate1:x``, ``plate1:Fz->Mx``, ``Fz`` where there is one plate).
    """
    name, _, place = target.rpartition(":")
    fault = PLATE_FAULTS.get(effect)
    # A zero that was taken off the empty plate holds its offset already.
    taken_off = fault is OFFSET and was_zeroed(plate)
    if fault is None or fault is DELAY or not fault.is_target(target) or name not in ("", plate.name) or taken_off:
        return np.zeros((6, 7))
    if fault is POSITION and place == "z":
        return np.zeros((6, 7))  # the pressure is looked for on the plate, however high it is
    return _about_centre(plate, fault.slope(place), fault.zero(place))


def sensitivities(seen: SeenTrial, found: Sequence[_Observed], effect: str, target: str, parameter: str) -> Array:
    """Return (n,) the derivatives of the values less the expectations of the observations ``found`` in one recording
    with respect to a parameter of an effect; 0 where an observation does not respond.
    """
    known = [one.sensitivity for one in found]
    if (effect, parameter) == (DELAY.name, DELAY.parameter):
        return np.array([one.delay for one in known])
    # A mass that is carried weighs as an error of the declared one does.
    if (effect, parameter) in {(BodyMass.name, "error"), (AddedMass.name, "mass")}:
        return np.array([one.mass for one in known])
    if effect == ToeLandmark.name:
        sides = SIDES if target == "both" else (target,)
        return np.array([sum(one.landmarks.get((side, parameter), 0.0) for side in sides) for one in known])
    out, fault = np.zeros(len(known)), PLATE_FAULTS.get(effect)
    if fault is None or fault.parameter != parameter:
        return out
    name, _, place = target.rpartition(":")
    for plate in seen.trial.plates:
        change = plate_change(effect, target, plate)
        out += [one.to(plate.name, change) for one in known]
        if fault is OFFSET and name in ("", plate.name) and was_zeroed(plate):
            # What the reader took off is the offset itself, whatever the plate carries.
            out += [one.zero.get(plate.name, np.zeros(3)) @ fault.zero(place)[:3] for one in known]
    return out


def sign_reversals(seen: SeenTrial, *, single: bool) -> Mapping[tuple[str, str], tuple[str, Array]]:
    """Return by effect and target the plate and the change B (6, 7) that turn one channel round, about its centre.

    Where that is the vertical force, the reader has turned the whole plate round to make the weight point up: all other
    channels are reversed. ``single`` as in `possible_causes`.
    """
    found = {}
    for plate in seen.trial.plates:
        for k, name in enumerate(CHANNELS[:5]):
            # The channels that end with the wrong sign: this one, or all but Fz.
            wrong = np.eye(6)[k] if name != "Fz" else 1 - np.eye(6)[k]
            # w - 2 w: the sign is turned.
            change = _about_centre(plate, np.diag(-2 * wrong), np.zeros(6))
            found[AxisError.name, name if single else f"{plate.name}:{name}"] = plate.name, change
    return MappingProxyType(found)


def with_changed_plate(seen: SeenTrial, name: str, change: Array) -> SeenTrial:
    """Return the recording with a plate's wrench changed by B (6, 7) about the lab origin."""
    plate = seen.plate(name)
    value = plate.wrench.value + plate.wrench.value @ change[:, :6].T + change[:, 6]
    value.setflags(write=False)  # the record keeps it without a copy
    other = replace(plate, wrench=Wrench(plate.wrench.time, value))
    plates = tuple(other if one is plate else one for one in seen.trial.plates)
    return replace(seen, trial=replace(seen.trial, plates=plates))


def was_zeroed(plate: Plate) -> bool:
    """Return whether the reader found the plate empty in this trial and took its reading off."""
    return any("subtracted" in said and "nothing was subtracted" not in said for said in plate.decisions)

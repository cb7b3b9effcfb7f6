"""What can be wrong with an installed plate, each fault as one object: what the plate reads instead of the wrench that
is there, and its inverse.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from biodance.records import CHANNELS, Array, Plate, Wrench
from biodance.spatial import axis_rotation, skew, wrench_shift

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class PlateFault:
    """One fault of a plate: ``name`` of its effect, ``parameter`` and ``unit`` of its size, and whether it is
    ``lasting``: stays with a laboratory from one session to the next; ``legal`` sizes: beyond them the plate
    reads another unit, or is another plate, which no correction mends; ``places`` where on a plate it can be;
    ``of_plate`` whether a target must name its plate, too.

    With a fault of some size at a place (a channel ``Fz``, a pair ``Fz->My``, an axis ``x``) a plate reads ``mixing`` @
    wrench + size ``zero``, about its centre (N, N·m).
    """

    name: str
    parameter: str
    unit: str
    legal: tuple[float, float]
    lasting: bool = True
    places: tuple[str, ...] = CHANNELS
    of_plate: bool = False

    def slope(self, place: str) -> Array:
        """Return (6, 6), the change of ``mixing`` per unit of a small size."""
        return np.zeros((6, 6))

    def zero(self, place: str) -> Array:
        """Return (6,) what is read per unit of size whatever is there."""
        return np.zeros(6)

    def mixing(self, place: str, size: float) -> Array:
        """Return (6, 6), what is read per unit of what is there."""
        return np.eye(6) + size * self.slope(place)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        """Return (4, 3) m, where the file puts the corners."""
        return plate.corners

    def inverse(self, size: float) -> float:
        """Return the size of the same fault that undoes one of ``size``."""
        return -size

    def joined(self, first: float, second: float) -> float:
        """Return the size of a fault whose ``second`` part was found in recordings freed from the ``first``."""
        return first + second

    def done(self, plate: Plate, place: str, size: float) -> Plate:
        """Return what a sound ``plate`` would have recorded with the fault."""
        back = wrench_shift(-plate.centre)
        # To the centre, the fault there, and back about the lab's origin.
        mixing = back @ self.mixing(place, size) @ wrench_shift(plate.centre)
        value = plate.wrench.value @ mixing.T + size * back @ self.zero(place)
        value.setflags(write=False)  # the record keeps it without a copy
        return replace(plate, wrench=Wrench(plate.wrench.time, value), corners=self.corners(plate, place, size))

    def undone(self, plate: Plate, place: str, size: float) -> Plate:
        """Return what a ``plate`` with the fault would have recorded without it."""
        return self.done(plate, place, self.inverse(size))

    def is_target(self, target: str) -> bool:
        """Return whether ``target`` names a place of this fault, with or without its plate."""
        return (":" in target or not self.of_plate) and target.rpartition(":")[2] in self.places


class _Position(PlateFault):
    """The file puts the plate ``size`` m along an axis beside where it is: M = shift x F."""

    def slope(self, place: str) -> Array:
        # Block (moment, force): shift x F.
        return np.asarray(np.kron([[0.0, 0.0], [1.0, 0.0]], skew(_unit(place))), dtype=float)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        return plate.corners + size * _unit(place)


class _Rotation(PlateFault):
    """What is recorded is turned by ``size`` rad about an axis through the plate's centre, as its corners are."""

    def slope(self, place: str) -> Array:
        # Turned by a small angle both vectors change by angle e x themselves.
        return np.asarray(np.kron(np.eye(2), skew(_unit(place))), dtype=float)

    def mixing(self, place: str, size: float) -> Array:
        return np.asarray(np.kron(np.eye(2), _turn(place, size)), dtype=float)

    def corners(self, plate: Plate, place: str, size: float) -> Array:
        return plate.centre + (plate.corners - plate.centre) @ _turn(place, size).T


class _Gain(PlateFault):
    """A channel reads (1 + ``size``) times what is there."""

    def slope(self, place: str) -> Array:
        return np.diag(_channel(place))

    def inverse(self, size: float) -> float:
        # (1 + s)(1 - s / (1 + s)) = 1.
        return -size / (1 + size)

    def joined(self, first: float, second: float) -> float:
        # Factors multiply: the second was found behind the first.
        return (1 + first) * (1 + second) - 1


class _Crosstalk(PlateFault):
    """A channel reads ``size`` times another one in addition."""

    def slope(self, place: str) -> Array:
        first, _, second = place.partition("->")
        # Row of the second, column of the first channel; its square is zero, so -size undoes size exactly.
        return np.outer(_channel(second), _channel(first))


class _Offset(PlateFault):
    """A channel reads ``size`` when nobody is on the plate."""

    def zero(self, place: str) -> Array:
        return _channel(place)


class _Delay(PlateFault):
    """All that the plate reads comes ``size`` s late."""

    def done(self, plate: Plate, place: str, size: float) -> Plate:
        return replace(plate, wrench=Wrench(plate.wrench.time + size, plate.wrench.value))

    def is_target(self, target: str) -> bool:
        return not target


def _unit(place: str) -> Array:
    return np.eye(3)[_AXES.index(place)]


def _turn(place: str, angle: float) -> Array:
    return np.asarray(axis_rotation(_unit(place), np.array([angle]))[0])


def _channel(place: str) -> Array:
    return np.eye(6)[CHANNELS.index(place)]


POSITION = _Position("plate_position", "shift", "m", (-10.0, 10.0), places=_AXES, of_plate=True)
ROTATION = _Rotation("plate_rotation", "angle", "rad", (-np.pi, np.pi), places=_AXES, of_plate=True)
GAIN = _Gain("plate_gain", "gain", "1", (-0.5, 1.0))
_PAIRS = tuple(f"{a}->{b}" for a in CHANNELS for b in CHANNELS if a != b)
CROSSTALK = _Crosstalk("plate_crosstalk", "ratio", "1", (-1.0, 1.0), places=_PAIRS)
OFFSET = _Offset("plate_offset", "offset", "N or N·m", (-2e4, 2e4), lasting=False)
DELAY = _Delay("time_delay", "delay", "s", (-10.0, 10.0), places=("",))
PLATE_FAULTS: Mapping[str, PlateFault] = MappingProxyType(
    {one.name: one for one in (POSITION, ROTATION, GAIN, CROSSTALK, OFFSET, DELAY)}
)
"""By name. What an offset was today it is not tomorrow; all else is lasting."""

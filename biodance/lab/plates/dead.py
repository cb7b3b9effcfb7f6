"""Dead plates: what they read does not change, whoever moves; neither its sign nor its zero can come from that."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from biodance.lab.markers.still import movement
from biodance.lab.plates.orientation import feet_on
from biodance.lab.plates.signals import PlateReading
from biodance.lab.plates.zero import LARGEST_SHARE, block_means
from biodance.records import Markers
from biodance.settings import TOUCH_FORCE, StandingRules

_STUCK = 2e-3  # share of its mean by which the vertical of a loaded plate varies at least, whoever moves on it
_SAME_PLACE = 0.001
"""m: standard deviation of a centre of pressure that nobody moves."""
_QUIET = 2.5
"""N: largest standard deviation of what an empty plate reads, half the spread up to which `zero` calls one quiet; a
foot that comes or goes changes it by far more.
"""
_SOMEBODY = 5 * TOUCH_FORCE  # N, the load of a plate from which on somebody is on it
_CONTACT = 0.1  # s over which the plate's noise is averaged


def why_dead(reading: PlateReading, markers: Markers | None, elsewhere: float) -> str:
    """Return why a plate is dead, "" for one that is alive: it carries the same load at the same place for the whole
    trial, though the person moves or stands on other plates, where the feet are. Whoever stands and lifts an arm moves
    the centre of pressure.

    ``elsewhere`` N is the largest load of another plate with a foot on it, 0 where this one has, too
    (`borne_elsewhere`).
    """
    length = _CONTACT if elsewhere else 0.0  # noise is averaged only where feet tell that nobody is on the plate
    level, spread, wanders = _course(reading, length)
    still = spread < _STUCK * abs(level) and wanders < _SAME_PLACE * abs(level)
    if markers is None or abs(level) <= TOUCH_FORCE or not still:
        return ""
    if not (elsewhere or movement(markers) > StandingRules.still):
        return ""
    wires = ", ".join(str(c + 1) for c in reading.plate.channels)
    meanwhile = "with nobody on it" if elsewhere else "while the person moves"
    return (
        f"it reads a constant {level:.0f} N (± {spread:.2g} N) {meanwhile}: a stuck or unplugged channel, or a "
        f"plate whose zero was never set. Check channels {wires}."
    )


def borne_elsewhere(reading: PlateReading, others: Sequence[PlateReading], markers: Markers | None) -> float:
    """Return the largest force N of another plate on which a foot is seen; 0 where one is seen on this plate, too, or
    none of the others carries anybody.
    """
    if markers is None or feet_on(reading.corners, markers):
        return 0.0
    loads = [float(np.abs(one.sensor[:, 2]).max()) for one in others if feet_on(one.corners, markers)]
    return max((load for load in loads if load > _SOMEBODY), default=0.0)


def without_offset(reading: PlateReading, elsewhere: float) -> PlateReading:
    """Return the reading without the constant that the plate reads while the person is ``elsewhere`` (N), as its zero:
    up to a third of that load, as in a trial in which it is seen unloaded. As it is for others.
    """
    level, spread, _ = _course(reading, _CONTACT)
    if not TOUCH_FORCE < abs(level) <= LARGEST_SHARE * elsewhere or spread >= _QUIET:
        return reading
    zero = reading.sensor[reading.known].mean(axis=0)
    said = f"Zero: no foot is ever on the plate, so the constant {level:.3g} N that it reads was subtracted."
    decisions = (*reading.decisions[:-1], said)  # instead of the last one, that no zero was found
    return replace(reading, sensor=reading.sensor - zero, empty=reading.empty + zero[:3], decisions=decisions)


def _course(reading: PlateReading, length: float) -> tuple[float, float, float]:
    """Return the mean vertical force N along the plate's z, and the standard deviations of its means over ``length`` s
    (0 = of the samples) and of those of the worse of both tilting moments, N·m.
    """
    sensor = reading.sensor[reading.known]
    vertical, *moments = (block_means(sensor[:, k], reading.rate, length=length)[0] for k in (2, 3, 4))
    return float(vertical.mean()), float(vertical.std()), max(float(one.std()) for one in moments)

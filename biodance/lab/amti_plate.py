"""One AMTI plate on its own: there is no laboratory in such a file, so the lab frame is the plate's frame turned upright."""

import numpy as np

from biodance.lab.baseline import find_baseline
from biodance.lab.plate_signs import gravity_sign, sensor_below
from biodance.lab.plate_types import moved
from biodance.records import Array, Plate, Wrench

UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""lab_R_plate (3, 3): AMTI's plate axes have z down; x stays, y and z are turned, so that the lab's z points up."""
OWN_ZERO = 5.0  # N: an unloaded reading up to here is what the maker's own zero leaves and is kept


def amti_plate(
    number: int, channels: Array, *, rate: float, size: tuple[float, float], centre: Array, vector: Array, said: tuple[str, ...]
) -> tuple[Plate, tuple[str, ...]]:
    """Return the plate with the ground's wrench on the subject, and warnings.

    ``channels`` (S, 6) N, N·m: the load ON the plate in plate axes (z down) about the sensor origin; ``rate`` Hz; ``size`` (x, y) m;
    ``centre`` (3,) m of its surface in the lab frame; ``vector`` (3,) m from the sensor origin to the surface centre in plate axes.
    """
    channels, zeroed = _zeroed(channels, rate)
    below, placed = sensor_below(vector, UPRIGHT)
    wrench = moved(channels, below)
    sign = 1 if gravity_sign(wrench, UPRIGHT, rate) > 0 else -1
    force = sign * wrench[:, :3] @ UPRIGHT.T
    moment = sign * wrench[:, 3:] @ UPRIGHT.T + np.cross(centre, force)
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(size) / 2
    corners = np.column_stack([half, np.zeros(4)]) @ UPRIGHT.T + centre
    directions = (
        "Lab frame = plate frame turned about x: x stays, y and z (down) are reversed, so that z points up; origin at the first surface.",
        "Sign: the file holds the load on the plate; turned round to the ground's action on the subject."
        if sign < 0
        else "Sign: the weight shows that the file holds the reaction, not the load on the plate; it was kept.",
    )
    wrench_in_lab = Wrench(np.arange(len(channels)) / rate, np.hstack([force, moment]))
    plate = Plate(f"plate{number}", 0, corners, wrench_in_lab, (*said, zeroed, placed, *directions))
    return plate, (f"Plate {number}: {directions[1]}",) if sign > 0 else ()


def _zeroed(channels: Array, rate: float) -> tuple[Array, str]:
    """Return the channels with the reading of the empty plate taken off where it is more than the maker's own zero leaves."""
    zero = find_baseline(channels[:, 2], zero=None, rate=rate)
    if zero.stop <= zero.start:
        return channels, "Zero: the maker's own was kept; the plate is never seen unloaded."
    empty = channels[zero.start : zero.stop].mean(axis=0)
    where = f"unloaded (samples {zero.start + 1}-{zero.stop}) the plate reads {empty[2]:.2g} N vertical"
    if abs(empty[2]) <= OWN_ZERO:
        return channels, f"Zero: the maker's own was kept; {where}."
    return channels - empty, f"Zero: {where}; that mean was subtracted from every channel."

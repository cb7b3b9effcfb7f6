"""One plate's channels in SI with their zero taken off: the wrench about the sensor, still in plate axes and with
the recorded sign.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.plates.corners import corners_in_lab, half_sides, plate_axes
from biodance.lab.plates.parameters import CONTENT, PlateParameters, unit_factors, zero_window
from biodance.lab.plates.wrench import (
    DEEPEST,
    FOUR_SENSORS,
    calibrated,
    centre_of_pressure,
    loaded_samples,
    polynomial_corrected,
    sensor_below,
    sensor_wrench,
    surface_vector,
)
from biodance.lab.plates.zero import find_baseline
from biodance.records import CHANNELS, Array
from biodance.spatial import wrench_about_point

_EDGE = 0.02  # m by which a centre of pressure may lie beyond the edge
INSIDE = 0.8  # share of the loaded samples that must lie on the plate
_STILLEST = 0.0015  # m: nobody's centre of pressure stays this close to the plate's centre
FARTHEST_ORIGIN, CLOSEST_SENSORS = 2.0, 0.05  # m
LEAST_BESIDE = 0.02  # m: sensors so near to the middle of the surface cannot be told to lie on its other side
_STRONGEST = np.array([30e3, 30e3, 30e3, 30e3, 30e3, 30e3])  # N, N·m: beyond the range of every maker's plate
MOMENT_UNITS = (1.0, 1000.0, 0.001)


@dataclass(frozen=True, eq=False)
class PlateReading:
    """A plate before its directions are decided: ``sensor`` (S, 6) N, N·m about the sensor origin, plate axes, sign as
    recorded.

    ``vector`` (3,) m from there to the centre of the surface as the file says; ``corners`` (4, 3) m lab; ``rate`` Hz of
    the samples; ``empty`` (3,) N is the force that the empty plate read and that was subtracted, plate axes, sign as
    recorded; ``known`` (S,) False where a channel holds no number (``sensor`` then keeps the nearest known sample, for
    decisions only).
    """

    plate: PlateParameters
    corners: Array
    sensor: Array
    vector: Array
    rate: float
    decisions: tuple[str, ...]
    warnings: tuple[str, ...]
    empty: Array
    known: NDArray[np.bool_]

    def at_surface(self, axes: Array) -> tuple[Array, tuple[str, ...]]:
        """Return the wrench (S, 6) about the centre of the surface in plate axes, and what was decided, for
        lab_R_plate ``axes``.
        """
        return _at_surface(self.plate, self.sensor, self.vector, axes)


def read_plate_signals(raw: RawC3d, plate: PlateParameters, *, metres: float, turn: Array) -> PlateReading:
    """Return the reading of one plate of a C3D file; ``metres`` is the file's length unit, ``turn`` (3, 3) leads from
    file axes to the lab.

    Raises
    ------
    TrialRefused
        Corners, ORIGIN, units or channels make no sense; the sentence says which value and what would be legal.
    """
    corners, placed = corners_in_lab(plate.corners, metres=metres, turn=turn)
    origin, origin_said = _origin(plate, half_sides(corners), metres)
    channels = np.asarray(raw.analog[:, plate.channels], dtype=float)
    channels, known, gaps_said = _without_gaps(channels, plate)
    units = tuple(raw.analog_units[c] for c in plate.channels)
    factors, unit_said = unit_factors(plate, units, metres=metres)
    forces = [k for k, kind in enumerate(CONTENT[plate.type]) if kind == "F"]
    vertical = _vertical(plate, calibrated(plate, channels)[:, forces] * np.array(factors)[forces])
    zero = find_baseline(vertical, zero=zero_window(raw), rate=raw.analog_rate)
    offsets = _offsets(plate, channels, zero.start, zero.stop)
    channels -= offsets
    signals = calibrated(plate, channels) * factors
    sensor, vector = sensor_wrench(plate, signals, origin), surface_vector(plate, origin)
    empty = sensor_wrench(plate, calibrated(plate, offsets[None]) * factors, origin)[0, :3]
    vector, turned = vector_under_load(plate, sensor, vector, corners, raw.analog_rate)
    sensor, sense, warnings = _moments_in_sense(
        plate, sensor, vector, corners, rate=raw.analog_rate, unsure=len(unit_said) > 1
    )
    _refuse_impossible(plate, sensor)
    first = f"TYPE {plate.type}, analog channels {', '.join(str(c + 1) for c in plate.channels)}."
    told = tuple(f"{said[0].upper()}{said[1:]}" for said in (plate.told.sentence,) if said)
    said = (first, *told, *placed, *origin_said, *turned, *unit_said, *gaps_said, *sense, zero.said)
    odd = tuple(f"Plate {plate.number}: {sentence}" for sentence in (*placed, *origin_said, *turned, *gaps_said))
    return PlateReading(plate, corners, sensor, vector, raw.analog_rate, said, (*odd, *warnings), empty, known)


def _at_surface(plate: PlateParameters, sensor: Array, vector: Array, axes: Array) -> tuple[Array, tuple[str, ...]]:
    below, said = sensor_below(vector, axes)
    wrench = wrench_about_point(sensor, below)
    if plate.polynomial is None:
        return wrench, (said,)
    applied = "The maker's correction of the centre of pressure (FPCOPPOLY) was applied."
    return polynomial_corrected(wrench, plate.polynomial), (said, applied)


def _origin(plate: PlateParameters, half: Array, metres: float) -> tuple[Array, tuple[str, ...]]:
    """Return ORIGIN in m, as m or mm where only that makes sense; TrialRefused where nothing does."""
    fits = [unit for unit in dict.fromkeys((metres, 0.001, 1.0)) if _makes_sense(plate, plate.origin * unit, half)]
    if fits and fits[0] == metres:
        return plate.origin * metres, ()
    written = ", ".join(f"{c:.4g}" for c in plate.origin)
    if len(fits) == 1:
        said = f"ORIGIN ({written}) makes no sense in the file's unit and was taken in units of {fits[0]:g} m."
        return plate.origin * fits[0], (said,)
    four = plate.type in FOUR_SENSORS
    legal = "half distances of the sensors inside the plate, then the depth" if four else "sensor to surface centre"
    raise TrialRefused(
        f"ORIGIN is ({written}) in units of {metres:g} m, which no plate of {2 * half[0]:.2f} x {2 * half[1]:.2f} m "
        f"has (legal: {legal}, depth up to {DEEPEST:g} m). Enter the values of the maker's sheet."
    )


def _makes_sense(plate: PlateParameters, origin: Array, half: Array) -> bool:
    if abs(origin[2]) > DEEPEST or np.abs(origin).max() > FARTHEST_ORIGIN:
        return False
    beside = np.abs(origin[:2])
    return plate.type not in FOUR_SENSORS or bool((beside >= CLOSEST_SENSORS).all() and (beside <= half + _EDGE).all())


def _without_gaps(channels: Array, plate: PlateParameters) -> tuple[Array, NDArray[np.bool_], tuple[str, ...]]:
    """Return the channels with the nearest known sample where one is no number, where all are known, and what was
    masked.

    Raises TrialRefused where nothing is known.
    """
    known = np.asarray(np.isfinite(channels).all(axis=1))
    if known.all():
        return channels, known, ()
    sample, column = np.argwhere(np.logical_not(np.isfinite(channels)))[0]
    where = f"analog channel {plate.channels[column] + 1} is not a number at sample {sample + 1}"
    if not known.any():
        raise TrialRefused(
            f"{where}, and no sample of the plate is whole. Check the channel in the recording software."
        )
    whole = np.flatnonzero(known)
    between = np.searchsorted((whole[1:] + whole[:-1]) / 2, np.arange(known.size))
    said = f"{int((~known).sum())} of {known.size} samples are unknown, the first: {where}; they are masked."
    return channels[whole[between]], known, (said,)


def _refuse_impossible(plate: PlateParameters, sensor: Array) -> None:
    """Refuse a plate that reads what no plate measures: TrialRefused names channel and value."""
    largest = np.abs(sensor).max(axis=0, initial=0.0)
    worst = int(np.argmax(largest / _STRONGEST))
    if largest[worst] > _STRONGEST[worst]:
        raise TrialRefused(
            f"{CHANNELS[worst]} reads up to {largest[worst]:.3g} {'N' if worst < 3 else 'N·m'}; no plate measures more "
            f"than {_STRONGEST[worst]:g}. Check the channels {', '.join(str(c + 1) for c in plate.channels)}, their "
            f"ANALOG:SCALE and units."
        )


def vector_under_load(
    plate: PlateParameters, sensor: Array, vector: Array, corners: Array, rate: float
) -> tuple[Array, tuple[str, ...]]:
    """Return the vector sensor -> surface centre with x and y turned where only that puts the load on the plate, and
    what was decided.

    Treadmills write ORIGIN from the surface centre to the sensor (x, y up to 1 m); z has a test of its own
    (`sensor_below`).
    """
    other = vector * np.array([-1.0, -1.0, 1.0])
    if plate.type in FOUR_SENSORS or np.hypot(vector[0], vector[1]) < LEAST_BESIDE:
        return vector, ()
    loaded = loaded_samples(sensor, rate)
    if not loaded.any():
        return vector, ()
    axes, half = plate_axes(corners), half_sides(corners)
    written, turned = (
        _share_on(centre_of_pressure(_at_surface(plate, sensor[loaded], way, axes)[0]), half) for way in (vector, other)
    )
    if turned < INSIDE or written >= INSIDE:
        return vector, ()
    said = (
        f"ORIGIN x, y of ({1000 * vector[0]:.4g}, {1000 * vector[1]:.4g}) mm put {100 * written:.0f} % of the load on "
        f"the plate, turned round {100 * turned:.0f} %: they were turned."
    )
    return other, (said,)


def _share_on(point: Array, half: Array) -> float:
    """Return the share of points (S, 2) m that lie on the plate."""
    return float((np.abs(point) <= half + _EDGE).all(axis=1).mean())


def _vertical(plate: PlateParameters, forces: Array) -> Array:
    """Return the vertical force (S,) N along the plate's z from its force channels (S, n)."""
    if plate.type in FOUR_SENSORS:
        return forces[:, 4:8].sum(axis=1) if forces.shape[1] == 8 else forces[:, 2::3].sum(axis=1)
    return forces[:, 2]


def _offsets(plate: PlateParameters, channels: Array, start: int, stop: int) -> Array:
    """Return the mean of each channel over the window; 0 without one and for the point channels of TYPE 1."""
    if stop <= start:
        return np.zeros(channels.shape[1])
    mean = channels[start:stop].mean(axis=0)
    return np.where([kind == "L" for kind in CONTENT[1]], 0.0, mean) if plate.type == 1 else mean


def _moments_in_sense(
    plate: PlateParameters, sensor: Array, vector: Array, corners: Array, *, rate: float, unsure: bool
) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Return the wrench in the unit of moments, declared or else only one, that puts the load on the plate."""
    axes, half = plate_axes(corners), half_sides(corners)
    loaded = loaded_samples(sensor, rate)
    if not loaded.any():
        return sensor, (), ()
    factors = MOMENT_UNITS if "M" in CONTENT[plate.type] or plate.type == 1 else MOMENT_UNITS[:1]
    pressed, share = sensor[loaded], {}
    for factor in factors:
        tried = pressed * np.array([1, 1, 1, factor, factor, factor])
        on_it = _share_on(centre_of_pressure(_at_surface(plate, tried, vector, axes)[0]), half)
        lives = float(np.percentile(np.abs(centre_of_pressure(tried)).max(axis=1), 90)) > _STILLEST
        share[factor] = (on_it, on_it >= INSIDE and lives)
        if share[1.0][1]:
            break  # as declared it makes sense: no other unit is asked
    good = [factor for factor in share if share[factor][1]]
    if not share[1.0][1] and len(good) == 1:
        said = (
            f"The moments put the load on the plate only when taken {good[0]:g} times as large as the file's "
            f"units say; that was done."
        )
        return sensor * np.array([1, 1, 1, *3 * good]), (said,), (f"Plate {plate.number}: {said} Check the units.",)
    inside = share[1.0][0]
    if inside >= INSIDE:
        return sensor, (f"The centre of pressure lies on the plate in {100 * inside:.0f} % of the loaded samples.",), ()
    said = f"The centre of pressure lies on the plate in only {100 * inside:.0f} % of the loaded samples"
    if unsure:
        raise TrialRefused(
            f"{said.lower()} and the file does not say the units. Write ANALOG:UNITS (N, Nmm) and export again."
        )
    check = "check its CORNERS, ORIGIN, units and whether somebody pushed it sideways."
    return sensor, (f"{said}.",), (f"Plate {plate.number}: {said}: {check}",)

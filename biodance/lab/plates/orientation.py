"""Turn a plate's reading into the lab frame: side of the sensor, axes, load or reaction; feet and weight are the
witnesses.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.plates.corners import half_sides, plate_axes
from biodance.lab.plates.signals import LEAST_BESIDE, PlateReading
from biodance.lab.plates.wrench import FOUR_SENSORS, centre_of_pressure, gravity_sign, sway_sign, wrench_in_lab
from biodance.records import Array, Markers, Plate, Wrench

_LOW = 0.15  # m above the surface: markers of a standing foot, ankle included
BESIDE = 0.15  # m beyond the edge
_AROUND = 0.05  # m by which a sole reaches beyond its markers
_FRAMES = 200
_QUARTER_TURNS = [[[c, -s, 0], [s, c, 0], [0, 0, 1]] for c, s in ((0, 1), (-1, 0), (0, -1))]
"""Rotations about z by 90, 180 and 270 degrees."""


def distance_to_feet(cop: Array, xyz: Array, corners: Array) -> float | None:
    """Return the median distance in m between the centre of pressure and the feet on the plate; None if no foot is seen
    on it.

    ``cop`` (F, 2) m, NaN while unloaded, and markers ``xyz`` (F, K, 3) m in the same frames, lab; ``corners`` (4, 3) m.
    The feet are all markers within 0.15 m over the surface and 0.15 m around the plate; the distance is to the nearest
    straight line between two of them, so it is near 0 between two feet.
    """
    centre, reach = corners.mean(axis=0), float(np.linalg.norm(half_sides(corners))) + BESIDE
    low = np.abs(xyz[:, :, 2] - centre[2]) <= _LOW
    near = low & (np.linalg.norm(xyz[:, :, :2] - centre[:2], axis=2) <= reach)
    told = np.isfinite(cop).all(axis=1) & (near.sum(axis=1) >= 2)
    if told.sum() < max(1, min(5, len(cop))):
        return None
    point, near, feet = cop[told], near[told], np.where(near[:, :, None], xyz[:, :, :2], np.inf)[told]
    first = np.argsort(~near, axis=1, kind="stable")[:, : near.sum(axis=1).max(), None]
    return float(np.median(_distances_between(point, np.take_along_axis(feet, first, axis=1))))


def feet_on(corners: Array, markers: Markers) -> bool:
    """Return whether a marker as low as a standing foot's is ever over the plate of ``corners`` (4, 3) m, or no more
    than 0.05 m beside it.
    """
    axes, centre = plate_axes(corners), corners.mean(axis=0)
    x, y, _ = (axes[:, k] @ np.moveaxis(markers.xyz - centre, -1, 0).reshape(3, -1) for k in range(3))
    low = np.abs(markers.xyz[..., 2] - centre[2]).ravel() <= _LOW
    half = half_sides(corners) + _AROUND
    return bool((low & (np.abs(x) <= half[0]) & (np.abs(y) <= half[1])).any())


def _distances_between(points: Array, feet: Array) -> Array:
    """Return (F,) m from points (F, 2) to the nearest segment between two of ``feet`` (F, n, 2); inf without any."""
    i, j = np.triu_indices(feet.shape[1], 1)
    away = feet - points[:, None]
    with np.errstate(invalid="ignore"):  # feet that are not there give NaN
        x, y = away[:, i, 0], away[:, i, 1]
        ax, ay = away[:, j, 0] - x, away[:, j, 1] - y
        share = np.clip(-(x * ax + y * ay) / np.maximum(ax * ax + ay * ay, 1e-12), 0, 1)
        square = (x + share * ax) ** 2 + (y + share * ay) ** 2
    return np.sqrt(np.where(np.isnan(square), np.inf, square).min(axis=1))


UNDER_THE_FOOT, NOT_UNDER = 0.06, 0.15  # m from the feet: believed; contradicted
_FZ_ALONE = (
    "Fz alone was turned round: its sign is another one than on the other plates, and with the other channels as they "
    "are the load lies under the feet that the markers show."
)
Said = tuple[str, ...]


class Oriented(NamedTuple):
    """A plate in the lab frame, what a person should look at, and whether its Fz alone had the wrong sign."""

    plate: Plate
    warnings: Said
    fz_alone: bool


def oriented(
    reading: PlateReading, time: Array, *, markers: Markers | None, alone: bool, otherwise: int, odd: bool
) -> Oriented:
    """Return the plate with the ground's wrench ON the subject about the lab origin, and warnings.

    ``time`` (S,) s; ``markers`` are asked where the feet are; ``alone`` says that no other plate is loaded, so that the
    sway of a standing person can be used; ``otherwise`` (+1 or -1) is the sign for a plate that never carries anything;
    ``odd`` says that the other plates have another sign: axes turned half round are then a wrong sign of Fz alone,
    since both together turn no channel but Fz, and Mz, which is turned back.

    Raises
    ------
    TrialRefused
        The corners contradict the recorded forces and the markers do not decide between the two possible corrections.
    """
    axes = plate_axes(reading.corners)
    reading, moved = _origin_under_feet(reading, time, axes, markers)
    wrench, said = reading.at_surface(axes)
    sign = gravity_sign(wrench, axes, reading.rate)
    sway = sway_sign(wrench, reading.rate) if alone and sign else 0
    warnings: Said = ()
    if sway and sway != sign and axes[2, 2] > 0:
        axes, turned = _unmirrored(reading, time, axes, markers)
        wrench, said = reading.at_surface(axes)
        sign, said, warnings = sway, (*said, turned), (f"Plate {reading.plate.number}: {turned}",)
    elif sway:
        seen, warnings = _sway_said(reading, sway == sign)
        said = (*said, seen)
    elif sign and axes[2, 2] > 0:
        seen, warnings = _upwards_said(reading)
        said = (*said, seen)
    angle = 0
    if markers is not None and sign:
        axes, angle, checked, warned = _under_feet(reading, time, axes, markers)
        if odd and angle == 180:
            wrench = wrench * np.array([1, 1, 1, 1, 1, -1])
            checked, warned = (_FZ_ALONE,), (f"Plate {reading.plate.number}: {_FZ_ALONE} Check its cabling.",)
        said, warnings = (*said, *checked), (*warnings, *warned)
    value = wrench_in_lab(wrench, axes, sign or otherwise, reading.corners.mean(axis=0))
    value[~reading.known] = np.nan
    value.setflags(write=False)  # the record keeps it without a copy
    decisions = (*reading.decisions, *moved, *said, _sign_said(sign, otherwise))
    zero = (sign or otherwise) * axes @ reading.empty
    where = (reading.plate.name, reading.plate.type, reading.corners)
    plate = Plate(*where, Wrench(time, value), decisions, zero, foot=reading.plate.told.foot)
    told = (*reading.warnings, *(f"Plate {reading.plate.number}: {one}" for one in moved), *warnings)
    return Oriented(plate, told, odd and angle == 180)


def _origin_under_feet(
    reading: PlateReading, time: Array, axes: Array, markers: Markers | None
) -> tuple[PlateReading, Said]:
    """Return the reading, ORIGIN x, y turned where only that puts the load under the feet, and what was decided."""
    x, y = 1000 * reading.vector[:2]
    if markers is None or reading.plate.type in FOUR_SENSORS or np.hypot(x, y) < 1000 * LEAST_BESIDE:
        return reading, ()
    other = replace(reading, vector=reading.vector * np.array([-1.0, -1.0, 1.0]))
    written, turned = (_distance(one, time, axes, markers) for one in (reading, other))
    if written is None or turned is None or written <= NOT_UNDER or turned > UNDER_THE_FOOT:
        return reading, ()
    said = (
        f"ORIGIN x, y of ({x:.4g}, {y:.4g}) mm put the load {written:.2f} m from the feet that the markers show, "
        f"turned round {turned:.2f} m: they were turned."
    )
    return other, (said,)


def _unmirrored(reading: PlateReading, time: Array, axes: Array, markers: Markers | None) -> tuple[Array, str]:
    """Return the axes of a plate whose corners run the wrong way round: its z points down, so x or y must be turned
    too.

    The markers say which; without markers both stay as the corners have them, so the lab frame of such a file is a
    mirror image, in which forces, centre of pressure and weight still fit together.
    """
    why = (
        "CORNERS make the plate's z point up, but the sway of the standing person shows that its z points down: the "
        "corners run the wrong way round"
    )
    choices = {"y": axes * [1, -1, -1], "x": axes * [-1, 1, -1]}
    if markers is not None:
        found = {name: _distance(reading, time, choice, markers) for name, choice in choices.items()}
        good = [name for name, distance in found.items() if distance is not None and distance <= UNDER_THE_FOOT]
        if len(good) == 1:
            return choices[good[0]], f"{why}; {good[0]} was turned, which puts the load under the feet."
        raise TrialRefused(
            f"{why}, and the foot markers do not tell which axis to turn. Correct FORCE_PLATFORM:CORNERS."
        )
    kept = "x and y were kept as the corners have them. Check the corner order before joining this file with markers."
    return axes * [1, 1, -1], f"{why}; {kept}"


def _under_feet(reading: PlateReading, time: Array, axes: Array, markers: Markers) -> tuple[Array, int, Said, Said]:
    """Return the axes, by quarter turns where only that puts the load under the feet; by how many degrees; decisions
    and warnings.
    """
    distance = _distance(reading, time, axes, markers)
    if distance is None:
        return axes, 0, (), ()
    if distance <= NOT_UNDER:
        near = f"The centre of pressure lies {1000 * distance:.0f} mm (median) from the feet that the markers show."
        return axes, 0, (near,), ()
    turns = {90 * k: axes @ turn for k, turn in enumerate(_QUARTER_TURNS, start=1)}
    found = {angle: _distance(reading, time, turned, markers) for angle, turned in turns.items()}
    good = [angle for angle, d in found.items() if d is not None and d <= UNDER_THE_FOOT]
    number = reading.plate.number
    if len(good) == 1 and all(d is None or d > NOT_UNDER for angle, d in found.items() if angle != good[0]):
        said = (
            f"The load lies {distance:.2f} m from the feet that the markers show, and under them when the corners are "
            f"counted from another one: the plate axes were turned by {good[0]} degrees."
        )
        correct = f"Plate {number}: {said} Correct the order of FORCE_PLATFORM:CORNERS."
        return turns[good[0]], good[0], (said,), (correct,)
    said = f"The load lies {distance:.2f} m (median) from the feet that the markers show"
    check = "check CORNERS, ORIGIN and whether a foot without markers stood there."
    return axes, 0, (f"{said}.",), (f"Plate {number}: {said}: {check}",)


def _distance(reading: PlateReading, time: Array, axes: Array, markers: Markers) -> float | None:
    """Return the median distance (m) of load and feet in frames spread over the trial, with lab_R_plate ``axes``."""
    if not markers.time.size:
        return None
    frames = np.unique(np.linspace(0, markers.time.size - 1, _FRAMES).round().astype(int))
    at = np.clip(np.searchsorted(time, markers.time[frames]), 0, time.size - 1)
    point = centre_of_pressure(replace(reading, sensor=reading.sensor[at]).at_surface(axes)[0])
    return distance_to_feet(
        reading.corners.mean(axis=0)[:2] + point @ axes[:2, :2].T, markers.xyz[frames], reading.corners
    )


def _sway_said(reading: PlateReading, agrees: bool) -> tuple[str, Said]:
    if agrees:
        return "The sway of the standing person confirms the sign of the shear.", ()
    said = "Weight and sway contradict each other: the shear channels seem to have the wrong sign"
    return f"{said}.", (f"Plate {reading.plate.number}: {said}. Check the cabling and the corner order.",)


def _upwards_said(reading: PlateReading) -> tuple[str, Said]:
    """Say that a plate's z points up, and warn where the maker's own axes have z down (eight channels)."""
    said = "CORNERS make the plate's z point up; the file's axes were used as they are"
    if reading.plate.type not in (3, 7):
        return f"{said}.", ()
    doubt = f"{said}, but an eight-channel plate has z down: the shear may have the wrong sign. Check the corner order"
    return f"{doubt}.", (f"Plate {reading.plate.number}: {doubt}.",)


def _sign_said(sign: int, otherwise: int) -> str:
    if not sign:
        taken = "reaction" if otherwise > 0 else "load"
        return f"Never loaded, so gravity cannot tell the sign; taken as the {taken}."
    held = "reaction on the subject; kept" if sign > 0 else "load on the plate; turned round"
    return f"Sign: the file holds the {held} (the weight must point up)."

"""The directions that a file does not say or says wrongly: ORIGIN, unit of the moments, load or reaction, plate axes;
and with them the wrench in the lab. What the plate carries decides: weight, sway, and the feet that the markers show.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.plates import PLATE_TYPES
from biodance.lab.plates.decode import EDGE, FARTHEST_PRESSURE, FOOT_HEIGHT, PlateReading
from biodance.records import CHANNELS, Array, Markers, Mask, Plate, Wrench, longest_run
from biodance.settings import COP_FORCE, TOUCH_FORCE
from biodance.spatial import turned_wrench, wrench_about_origin, wrench_about_point, zero_moment_point

_Said = tuple[str, ...]

_INSIDE = 0.8  # share of the loaded samples that must lie on the plate
_LEAST_BESIDE = 0.02  # m: sensors so near to the middle of the surface cannot be told to lie on its other side
_STRONGEST = 30e3  # N, N·m: beyond the range of every maker's plate
_MOMENT_UNITS = (1.0, 1000.0, 0.001)
_HALF_TURN = np.array([-1.0, -1.0, 1.0])
"""A vector of the plate turned by 180 degrees about z: some programs write ORIGIN x, y from the surface to the sensor.
"""
_THROUGHOUT = 0.8
"""Share of the loads that lie under the feet where the axes are right, edges of steps left aside."""
_UNDER_THE_FOOT, _NOT_UNDER = 0.06, 0.15  # m from the feet: believed; contradicted
_SWAY_BAND = (0.5, 5.0)  # Hz
_FZ_ALONE = (
    "Fz alone was turned round: its sign is another one than on the other plates, and with the other channels as they "
    "are the load lies under the feet that the markers show."
)


def _surface_wrench(reading: PlateReading) -> tuple[Array, _Said]:
    """Return the wrench (S, 6) N, N·m about the surface centre, plate axes, as recorded; what was decided."""
    below, said = sensor_below(reading.vector, reading.axes)
    wrench = wrench_about_point(reading.sensor, below)
    if reading.plate.polynomial is None:
        return wrench, (said,)
    # Polynomial in mm.
    point = 1000 * zero_moment_point(wrench, threshold=COP_FORCE)[:, :2]
    point[np.abs(point) > 1000 * FARTHEST_PRESSURE] = np.nan
    error = np.zeros((len(point), 3))
    for i, p in enumerate(reading.plate.polynomial):
        own, other = point[:, i], point[:, 1 - i] ** 2
        # Odd in the coordinate itself, even in the other one.
        error[:, i] = (p[0] * other**2 + p[1] * other + p[2]) * own**3 + (p[3] * other**2 + p[4] * other + p[5]) * own
    # a force that acts at p - d has about the centre the moment that it has about d when it acts at p
    corrected = wrench_about_point(wrench, np.nan_to_num(error / 1000))
    return corrected, (said, "The maker's correction of the centre of pressure (FPCOPPOLY) was applied.")


def pressure_point(reading: PlateReading) -> Array:
    """Return the centre of pressure (S, 3) m from the centre of the surface, plate axes; NaN below 20 N."""
    wrench, _ = _surface_wrench(reading)
    return zero_moment_point(wrench, threshold=COP_FORCE)


def sensor_below(vector: Array, axes: Array) -> tuple[Array, str]:
    """Return the vector (3,) m from the sensor to the surface centre, plate axes, with the z that puts the sensor below
    the surface, and the sentence.

    ``vector`` is that of the file, ``axes`` is lab_R_plate (3, 3). Only z is turned: older AMTI sheets and some
    software write it with the other sign, x and y alike (C3D user guide, ORIGIN of TYPE 2). For a plate whose z points
    down the legal z is negative.
    """
    x, y, z = vector
    if abs(z) < 1e-6:
        beside = f"; x, y ({1000 * x:.4g}, {1000 * y:.4g} mm) are used as written" if max(abs(x), abs(y)) > 1e-6 else ""
        return vector, f"ORIGIN z is 0: the moments are about the surface{beside}."
    if z * axes[2, 2] > 0:
        return vector, f"ORIGIN puts the sensor {1000 * abs(z):.4g} mm below the surface, as it must be."
    said = f"ORIGIN z of {1000 * z:.4g} mm would put the sensor above the surface: its sign was turned"
    unsure = 2000 * float(np.hypot(x, y))
    if unsure >= 0.05:
        said += f" (if x, y were meant the other way round too, the centre of pressure moves by {unsure:.2g} mm)"
    return np.array([x, y, -z]), f"{said}."


def with_loads_on_plates(readings: Sequence[PlateReading]) -> tuple[list[PlateReading], dict[int, str]]:
    """Return the readings with ORIGIN's x, y turned by 180 degrees, and the moments in another unit (times 1000 or
    0.001), each only where that alone puts the load on the plate; and by number why others are refused: the load lies
    beside the plate and the file does not say the units, or a channel reads more than any plate measures.

    Treadmills write ORIGIN from the surface centre to the sensor (x, y up to 1 m); z has a test of its own
    (`sensor_below`).
    """
    fit, refused = [], {}
    for reading in readings:
        try:
            if (loaded := reading.loaded).any():
                reading = _with_moments_in_unit(_with_origin_turned(reading, loaded), loaded)
        except TrialRefused as error:
            refused[reading.plate.number] = str(error)
            continue
        largest = np.abs(reading.sensor).max(axis=0, initial=0.0)
        worst = int(np.argmax(largest))
        if largest[worst] <= _STRONGEST:
            fit.append(reading)
            continue
        refused[reading.plate.number] = (
            f"{CHANNELS[worst]} reads up to {largest[worst]:.3g} {'N' if worst < 3 else 'N·m'}; no plate measures more "
            f"than {_STRONGEST:g}. Check the channels {', '.join(str(c + 1) for c in reading.plate.channels)}, their "
            f"ANALOG:SCALE and units."
        )
    return fit, refused


def _with_origin_turned(reading: PlateReading, loaded: Mask) -> PlateReading:
    """Return the reading, ORIGIN x, y turned where only that puts the load on the plate."""
    x, y, _ = reading.vector
    if PLATE_TYPES[reading.plate.type].four_sensors or np.hypot(x, y) < _LEAST_BESIDE:
        return reading
    pressed, vector = replace(reading, sensor=reading.sensor[loaded]), reading.vector * _HALF_TURN
    written, turned = _share_on_plate(pressed), _share_on_plate(replace(pressed, vector=vector))
    if turned < _INSIDE or written >= _INSIDE:
        return reading
    said = (
        f"ORIGIN x, y of ({1000 * x:.4g}, {1000 * y:.4g}) mm put {100 * written:.0f} % of the load on "
        f"the plate, turned round {100 * turned:.0f} %: they were turned."
    )
    decisions = {**reading.decisions, "origin": (*reading.decisions["origin"], said)}
    return replace(reading, vector=vector, decisions=decisions)


def _with_moments_in_unit(reading: PlateReading, loaded: Mask) -> PlateReading:
    """Return the reading with moments in the unit, declared or else only one, that puts the load on the plate."""
    plate, pressed, inside, good = reading.plate, reading.sensor[loaded], 0.0, []
    for factor in _MOMENT_UNITS if "M" in PLATE_TYPES[plate.type].content else _MOMENT_UNITS[:1]:
        tried = pressed * np.array([1, 1, 1, factor, factor, factor])
        share = _share_on_plate(replace(reading, sensor=tried))
        # moments that are 1000 times too small lie on every plate: at its centre, where nobody's pressure stays
        # 0.0015 m: nobody's centre of pressure stays this close to the plate's centre
        lives = float(np.percentile(np.abs(zero_moment_point(tried, threshold=COP_FORCE)).max(axis=1), 90)) > 0.0015
        if share >= _INSIDE and lives:
            good.append(factor)
        if factor == 1.0:
            inside = share
            if good:
                break  # as declared it makes sense: no other unit is asked
    if len(good) == 1 and good[0] != 1.0:
        said = (
            f"The moments put the load on the plate only when taken {good[0]:g} times as large as the file's "
            f"units say; that was done."
        )
        sensor, check = reading.sensor * np.array([1, 1, 1, *3 * good]), f"{said} Check the units."
    elif inside >= _INSIDE:
        said = f"The centre of pressure lies on the plate in {100 * inside:.0f} % of the loaded samples."
        sensor, check = reading.sensor, ""
    else:
        only = f"The centre of pressure lies on the plate in only {100 * inside:.0f} % of the loaded samples"
        if len(plate.units_said) > 1:
            raise TrialRefused(
                f"{only.lower()} and the file does not say the units. Write ANALOG:UNITS (N, Nmm) and export again."
            )
        said, sensor = f"{only}.", reading.sensor
        check = f"{only}: check its CORNERS, ORIGIN, units and whether somebody pushed it sideways."
    warnings = (f"Plate {plate.number}: {check}",) if check else ()
    return replace(reading, sensor=sensor, decisions={**reading.decisions, "load": (said,)}, warnings=warnings)


def _share_on_plate(reading: PlateReading) -> float:
    """Return the share of the samples whose centre of pressure lies on the plate."""
    point = pressure_point(reading)[:, :2]
    return float((np.abs(point) <= reading.half + EDGE).all(axis=1).mean())


def gravity_sign(pressed: Array, axes: Array) -> int:
    """Return +1 if the recorded wrench pushes up on average while loaded (it acts on the subject), -1 if down, 0 if
    never loaded.

    ``pressed`` (L, 6) N, N·m are the loaded samples in plate axes, ``axes`` (3, 3) is lab_R_plate: the sign of the sum
    of F along the lab's z.
    """
    # Row z of lab_R_plate: the vertical part of every force.
    return int(np.sign((pressed[:, :3] @ axes[2]).sum()))


def sway_sign(force: Array, point: Array, rate: float) -> int:
    """Return +1 if a standing person's shear shows that the reaction was recorded, -1 for the load, 0 if it cannot be
    told.

    A person who stands is an inverted pendulum: the ground's shear on the person is opposite to the quick part of the
    centre of pressure, ``F = -(m g / h) (CoP - CoM)``, whatever the sign of the vertical channel. Needs 2.5 s of
    standing on this one plate (vertical within 5 %), and both axes must agree in sign, correlate by at least 0.4 and by
    three standard errors (1 / sqrt of the seconds: the band holds 9 independent samples each), and have a slope between
    0.25 and 3 per metre.

    ``force`` (S, 3) N and ``point`` (S, 3) m, the centre of pressure, in the same axes; ``rate`` Hz.
    """
    part = _standing(force[:, 2], rate)
    if part is None:
        return 0
    seconds = len(force[part]) / rate
    # Least correlation that is no chance: the band holds 2 B T independent samples.
    least, signs = max(0.4, 3 / np.sqrt(2 * (_SWAY_BAND[1] - _SWAY_BAND[0]) * seconds)), []
    for axis in (0, 1):
        shear, cop = _band(force[part, axis], rate), _band(point[part, axis], rate)
        power = float(cop @ cop)
        if power <= 0 or not shear.any():
            return 0
        # Both have no mean: a normalised scalar product.
        correlation = float(shear @ cop / np.sqrt(power * float(shear @ shear)))
        # Regression of the shear on the pressure, per weight: about 1 / h.
        slope = abs(float(shear @ cop)) / power / abs(float(force[part, 2].mean()))
        if abs(correlation) < least or not 0.25 <= slope <= 3.0:
            return 0
        # The shear on the person is opposite to the pressure: a negative correlation is the reaction.
        signs.append(-np.sign(correlation))
    return int(signs[0]) if signs[0] == signs[1] else 0


def _standing(vertical: Array, rate: float) -> slice | None:
    """Return the longest run of half-seconds with a vertical force near the trial's median; None below 2.5 s."""
    size = round(0.5 * rate)
    middle = float(np.median(vertical))
    if size < 4 or abs(middle) < 5 * TOUCH_FORCE:
        return None
    blocks = vertical[: vertical.size // size * size].reshape(-1, size)
    # Share of the weight by which the vertical force may vary
    most = 0.05 * abs(middle)
    steady = (np.abs(blocks.mean(axis=1) - middle) <= most) & (blocks.std(axis=1) <= most)
    start, stop = longest_run(steady)
    # 2.5 s of standing that the sway test needs
    return slice(start * size, stop * size) if (stop - start) * size >= 2.5 * rate else None


def _band(values: Array, rate: float) -> Array:
    """Return the part of a signal between 0.5 and 5 Hz, without its straight line and faded in and out."""
    along = np.linspace(-1, 1, values.size)
    # Regression line off: `along` has no mean, so slope and mean are independent.
    values = values - values.mean() - along * (along @ values) / (along @ along)
    spectrum = np.fft.rfft(values * np.hanning(values.size))
    frequency = np.fft.rfftfreq(values.size, 1 / rate)
    spectrum[(frequency < _SWAY_BAND[0]) | (frequency > _SWAY_BAND[1])] = 0
    return np.fft.irfft(spectrum, values.size)


def wrench_in_lab(wrench: Array, axes: Array, sign: int, centre: Array) -> Array:
    """Return a plate's wrench (S, 6) N, N·m about its ``centre`` (3,) m as the wrench about the lab origin.

    ``F = s R f``, ``M = s det(R) R m + c x F`` for ``axes`` R (3, 3) lab_R_plate and ``sign`` s; mirrored axes
    (determinant -1) turn moments, which are axial vectors, the other way round than forces.
    """
    # An axial vector under a mirror: det R = -1 turns it once more.
    signs = sign * np.repeat([1.0, np.linalg.det(axes)], 3)
    return wrench_about_origin(turned_wrench(wrench * signs, axes), centre)


def left_out_said(number: int, why: TrialRefused | str) -> str:
    """Return the sentence that a plate is not used."""
    return f"Plate {number} was left out, and what it carried is missing from the total: {why}"


def sense_plates(
    readings: Sequence[PlateReading], time: Array, markers: Markers | None
) -> tuple[tuple[Plate, ...], _Said]:
    """Return the plates with the ground's wrench ON the subject about the lab origin, and warnings.

    The weight must point up; an unloaded plate takes the majority's sign, +1 if all are unloaded. ``time`` (S,) s of
    the samples; ``markers`` (m, lab frame) say where the feet are.
    """
    signs = [gravity_sign(one.sensor[one.loaded], one.axes) for one in readings]
    # the sign belongs to the plate's z: a plate whose z points the other way has the other sign
    up = [int(np.sign(one.axes[2, 2])) for one in readings]
    votes = [sign * z for sign, z in zip(signs, up, strict=True)]
    plates, warnings, mended = [], [], False
    for reading, sign, z in zip(readings, signs, up, strict=True):
        # Sign of most others along the same direction, for this plate's z.
        otherwise = int(np.sign(sum(votes))) * z or 1
        alone = bool(sign) and sum(map(abs, signs)) == 1
        odd = bool(sign) and -sign * z in votes
        try:
            done, told, fz_alone = _in_lab(reading, sign, time, markers, alone=alone, otherwise=otherwise, odd=odd)
        except TrialRefused as error:
            warnings.append(left_out_said(reading.plate.number, error))
            continue
        plates.append(done)
        warnings += told
        mended = mended or fz_alone
    by = {sign: [str(r.plate.number) for r, v in zip(readings, votes, strict=True) if v == sign] for sign in (1, -1)}
    if by[1] and by[-1] and not mended:
        here, there = (
            f"plate{'s' * (len(by[sign]) > 1)} {', '.join(by[sign])} hold{'s' * (len(by[sign]) == 1)}"
            for sign in (1, -1)
        )
        warnings.insert(
            0,
            f"Two signs in one laboratory: along the same direction {here} the force up and {there} the force down; "
            f"each was turned so that weight points up, its shear with it. If only Fz of one plate has the wrong sign, "
            f"its shear is now wrong: check cabling and software.",
        )
    return tuple(plates), tuple(warnings)


def _in_lab(
    reading: PlateReading,
    sign: int,
    time: Array,
    markers: Markers | None,
    *,
    alone: bool,
    otherwise: int,
    odd: bool,
) -> tuple[Plate, _Said, bool]:
    """Return the plate with the ground's wrench ON the subject about the lab origin, what a person should look at, and
    whether its Fz alone had the wrong sign.
    """
    reading, moved = _with_origin_under_feet(reading, time, markers)
    wrench, said = _surface_wrench(reading)
    sway = sway_sign(wrench[:, :3], pressure_point(reading), reading.rate) if alone and sign else 0
    if sway and sway != sign and reading.axes[2, 2] > 0:
        reading, seen = _unmirrored(reading, time, markers)
        wrench, said = _surface_wrench(reading)
        sign, doubt = sway, seen
    else:
        seen, doubt = _direction_said(reading, sign, sway)
    doubts, checked, fz_alone = [*moved, *[doubt] * bool(doubt)], "", False
    if markers is not None and sign:
        reading, angle, checked, doubt = _under_feet(reading, time, markers)
        fz_alone = odd and angle == 180
        if fz_alone:
            # The half turn about z has reversed Fx, Fy, Mx and My; Mz is left to reverse.
            wrench = wrench * np.array([1, 1, 1, 1, 1, -1])
            checked, doubt = _FZ_ALONE, f"{_FZ_ALONE} Check its cabling."
        doubts += [doubt] * bool(doubt)
    signed = f"Never loaded, so gravity cannot tell the sign; taken as the {'reaction' if otherwise > 0 else 'load'}."
    if sign:
        held = "reaction on the subject; kept" if sign > 0 else "load on the plate; turned round"
        signed = f"Sign: the file holds the {held} (the weight must point up)."
    told = (text for text in (*moved, *said, seen, checked, signed) if text)
    value = wrench_in_lab(wrench, reading.axes, sign or otherwise, reading.corners.mean(axis=0))
    value[~reading.known] = np.nan
    value.setflags(write=False)  # the record keeps it without a copy
    # R times the force in plate axes.
    zero = (sign or otherwise) * reading.axes @ reading.empty
    plate, steps = reading.plate, reading.decisions
    where = (plate.name, plate.type, reading.corners, Wrench(time, value))
    done = Plate(*where, (*chain(*steps.values()), *told), zero, foot=plate.told.foot)
    odd_said, more = (
        tuple(f"Plate {plate.number}: {one}" for one in some)
        for some in (chain(*(steps[step] for step in ("corners", "origin", "gaps"))), doubts)
    )
    return done, (*odd_said, *reading.warnings, *more), fz_alone


def _direction_said(reading: PlateReading, sign: int, sway: int) -> tuple[str, str]:
    """Say what the sway of a standing person (0 = not known) tells of a plate that was not mirrored, and doubt it."""
    if sway and sway == sign:
        return "The sway of the standing person confirms the sign of the shear.", ""
    if sway:
        contrary = "Weight and sway contradict each other: the shear channels seem to have the wrong sign"
        return f"{contrary}.", f"{contrary}. Check the cabling and the corner order."
    if not sign or reading.axes[2, 2] <= 0:
        return "", ""
    said = "CORNERS make the plate's z point up; the file's axes were used as they are"
    if len(PLATE_TYPES[reading.plate.type].outputs) != 8:
        return f"{said}.", ""
    doubt = f"{said}, but an eight-channel plate has z down: the shear may have the wrong sign. Check the corner order."
    return doubt, doubt


def _with_origin_under_feet(reading: PlateReading, time: Array, markers: Markers | None) -> tuple[PlateReading, _Said]:
    """Return the reading, ORIGIN x, y turned where only that puts the load under the feet, and what was decided."""
    x, y, _ = 1000 * reading.vector
    four = PLATE_TYPES[reading.plate.type].four_sensors
    if markers is None or four or np.hypot(x, y) < 1000 * _LEAST_BESIDE:
        return reading, ()
    other = replace(reading, vector=reading.vector * _HALF_TURN)
    written, turned = _distance(reading, time, markers), _distance(other, time, markers, throughout=True)
    # Beside the feet as written, under them when turned.
    if written is None or turned is None or written <= _NOT_UNDER or turned > _UNDER_THE_FOOT:
        return reading, ()
    said = (
        f"ORIGIN x, y of ({x:.4g}, {y:.4g}) mm put the load {written:.2f} m from the feet that the markers show, "
        f"turned round {turned:.2f} m: they were turned."
    )
    return other, (said,)


def _unmirrored(reading: PlateReading, time: Array, markers: Markers | None) -> tuple[PlateReading, str]:
    """Return a plate whose corners run the wrong way round: its z points down, so x or y must be turned too."""
    why = (
        "CORNERS make the plate's z point up, but the sway of the standing person shows that its z points down: the "
        "corners run the wrong way round"
    )
    if markers is None:
        kept = "x and y were kept as the corners have them. Check the corner order before joining this file with "
        return replace(reading, axes=reading.axes * [1, 1, -1]), f"{why}; {kept}markers."
    choices = {"y": [1, -1, -1], "x": [-1, 1, -1]}
    turned = {name: replace(reading, axes=reading.axes * choice) for name, choice in choices.items()}
    found = {name: _distance(one, time, markers, throughout=True) for name, one in turned.items()}
    good = [name for name, distance in found.items() if distance is not None and distance <= _UNDER_THE_FOOT]
    if len(good) != 1:
        raise TrialRefused(
            f"{why}, and the foot markers do not tell which axis to turn. Correct FORCE_PLATFORM:CORNERS."
        )
    return turned[good[0]], f"{why}; {good[0]} was turned, which puts the load under the feet."


def _under_feet(reading: PlateReading, time: Array, markers: Markers) -> tuple[PlateReading, int, str, str]:
    """Return the reading turned by quarters if only that puts the load under the feet; degrees; said; doubt."""
    distance = _distance(reading, time, markers)
    if distance is None:
        return reading, 0, "", ""
    if distance <= _NOT_UNDER:
        near = f"The centre of pressure lies {1000 * distance:.0f} mm (median) from the feet that the markers show."
        return reading, 0, near, ""
    # Other corner as the first: the axes turned by quarters about z.
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turns = {90 * k: replace(reading, axes=reading.axes @ np.linalg.matrix_power(quarter, k)) for k in range(1, 4)}
    found = {angle: _distance(turned, time, markers, throughout=True) for angle, turned in turns.items()}
    good = [angle for angle, d in found.items() if d is not None and d <= _UNDER_THE_FOOT]
    if len(good) == 1 and all(d is None or d > _NOT_UNDER for angle, d in found.items() if angle != good[0]):
        said = (
            f"The load lies {distance:.2f} m from the feet that the markers show, and under them when the corners are "
            f"counted from another one: the plate axes were turned by {good[0]} degrees."
        )
        return turns[good[0]], good[0], said, f"{said} Correct the order of FORCE_PLATFORM:CORNERS."
    said = f"The load lies {distance:.2f} m (median) from the feet that the markers show"
    return reading, 0, f"{said}.", f"{said}: check CORNERS, ORIGIN and whether a foot without markers stood there."


def _distance(reading: PlateReading, time: Array, markers: Markers, *, throughout: bool = False) -> float | None:
    """Return the median distance (m) of load and feet; None if no foot is seen on the plate. Where it has to lie under
    one ``throughout``, the one that `_THROUGHOUT` of all loads have at most, and those without a foot on the plate are
    infinitely far: forces that are late, or of another plate, can lie under a foot for a while, with any axes.
    """
    if not markers.time.size:
        return None
    frames = np.unique(np.linspace(0, markers.time.size - 1, 200).round().astype(int))
    at = np.clip(np.searchsorted(time, markers.time[frames]), 0, time.size - 1)
    point = pressure_point(replace(reading, sensor=reading.sensor[at]))[:, :2]
    # 0.15 m beyond the edge
    centre, reach = reading.corners.mean(axis=0), float(np.linalg.norm(reading.half)) + 0.15
    cop, xyz = centre[:2] + point @ reading.axes[:2, :2].T, markers.xyz[frames]
    low = np.abs(xyz[:, :, 2] - centre[2]) <= FOOT_HEIGHT
    near = low & (np.linalg.norm(xyz[:, :, :2] - centre[:2], axis=2) <= reach)
    if throughout:
        near &= reading.under(xyz)
    seen = np.isfinite(cop).all(axis=1) & (near.sum(axis=1) >= 2)
    if seen.sum() < max(1, min(5, len(cop))):
        return None
    # Of a foot that stands there is a marker below 0.09 m, at the ankle if at nothing else; who sits on the plate
    # lets them hang higher.
    if np.median(np.nanmin(np.where(near, xyz[:, :, 2], np.nan)[seen], axis=1)) - centre[2] > 0.09:
        return None
    point, near, feet = cop[seen], near[seen], np.where(near[:, :, None], xyz[:, :, :2], np.inf)[seen]
    # the markers near the plate first, so that no more columns are left than feet were ever seen there
    first = np.argsort(~near, axis=1, kind="stable")[:, : near.sum(axis=1).max(), None]
    away = np.take_along_axis(feet, first, axis=1) - point[:, None]
    i, j = np.triu_indices(away.shape[1], 1)
    with np.errstate(invalid="ignore"):  # feet that are not there give NaN
        x, y = away[:, i, 0], away[:, i, 1]
        ax, ay = away[:, j, 0] - x, away[:, j, 1] - y
        # where on the segment the foot of the perpendicular from the point lies: 0 at one marker, 1 at the other
        share = np.clip(-(x * ax + y * ay) / np.maximum(ax * ax + ay * ay, 1e-12), 0, 1)
        square = (x + share * ax) ** 2 + (y + share * ay) ** 2
    # of each frame the nearest segment between two markers; inf without any
    nearest = np.sqrt(np.where(np.isnan(square), np.inf, square).min(axis=1))
    without = int(np.isfinite(cop).all(axis=1).sum() - seen.sum()) if throughout else 0
    every = np.append(nearest, np.full(without, np.inf))
    return float(np.quantile(every, _THROUGHOUT if throughout else 0.5, method="higher"))

"""The force plates of a C3D file: one wrench per plate, ground on subject, about the lab origin, in SI. Every
decision is a sentence.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.markers.still import movement, steady_mass
from biodance.lab.plates.corners import plate_axes
from biodance.lab.plates.dead import borne_elsewhere, why_dead, without_offset
from biodance.lab.plates.orientation import oriented
from biodance.lab.plates.padding import padded_samples, padding_said
from biodance.lab.plates.parameters import POUND, count_plates, plate_parameters
from biodance.lab.plates.scaled import already_scaled, scale_in_doubt, unscaled
from biodance.lab.plates.signals import PlateReading, read_plate_signals
from biodance.lab.plates.told import ToldPlate
from biodance.lab.plates.undescribed import undescribed_plates
from biodance.lab.plates.wrench import gravity_sign
from biodance.records import Array, Defect, Markers, Plate, Wrench
from biodance.settings import TOUCH_FORCE, CheckLimits, StandingRules

_AS_POUNDS = 0.03


class ReadPlates(NamedTuple):
    """The plates of one file, what a person should look at, what was decided without doubt, and what was left out."""

    plates: tuple[Plate, ...] = ()
    warnings: tuple[str, ...] = ()
    history: tuple[str, ...] = ()
    defects: tuple[Defect, ...] = ()


def read_plates(
    raw: RawC3d,
    *,
    metres: float,
    turn: Array | None = None,
    markers: Markers | None = None,
    body_mass: float | None = None,
    told: Mapping[str, ToldPlate] | None = None,
) -> ReadPlates:
    """Return the force plates of a C3D file, with warnings, history and defects.

    Each ``Plate.wrench`` is the ground's action ON the subject about the LAB origin at the analog rate, zero taken off,
    in N and N·m, NaN where nothing was measured (padding).

    ``metres`` is the file's length unit in m (0.001 for mm); ``turn`` (3, 3) leads from the file's axes to the lab
    frame (z up; None = they are the same); ``markers`` (m, lab frame) set the clock and say where the feet are;
    ``body_mass`` kg is compared with the weight on the plates; ``told`` by name what the analyst says of them, which
    comes before what the file says. A plate that cannot be trusted is left out with a warning that says why; nothing is
    raised. The method per TYPE is in ``plate_types``.
    """
    told = told or {}
    numbers, warnings, history = _numbers_of(raw, told)
    if not numbers:
        return ReadPlates((), warnings, history)
    if raw.analog.shape[0] == 0 or not raw.analog_rate > 0:
        lacks = "holds no analog samples" if raw.analog.shape[0] == 0 else f"has the analog rate {raw.analog_rate:g}"
        declared = f"The file declares {len(numbers)} force plates but {lacks}: no plate was read."
        return ReadPlates((), (*warnings, f"{declared} Export it with the analog data."), history)
    readings, refused = _readings(raw, numbers, metres, np.eye(3) if turn is None else turn, told)
    if body_mass and scale_in_doubt(raw, readings, body_mass):
        plain, refused_plain = _readings(unscaled(raw), numbers, metres, np.eye(3) if turn is None else turn, told)
        if scaled := already_scaled(readings, plain, body_mass):
            readings, refused = plain, [scaled, *refused_plain]
    readings, dead = _alive(readings, markers)
    readings, padded = _measured(raw, readings, markers)
    plates, said = _oriented(readings, _time(raw, markers), markers)
    defects = (*dead, *padded)
    history += tuple(f"{one.plate.name}: {one.plate.told.sentence}" for one in readings if one.plate.told.sentence)
    history += tuple(one.text for one in defects)
    warned = (*warnings, *refused, *said, *_weight_said(plates, markers, body_mass))
    return ReadPlates(plates, warned, history, defects)


def _numbers_of(raw: RawC3d, told: Mapping[str, ToldPlate]) -> tuple[list[int], tuple[str, ...], tuple[str, ...]]:
    """Return the numbers of the plates to be read, warnings and history: those of the file, and those of which the
    analyst says the channels, without those that are not to be used.
    """
    count, warnings = count_plates(raw)
    more = {int(name.removeprefix("plate")): one for name, one in told.items()}
    if not count and not warnings and not more and (undescribed := undescribed_plates(raw)):
        warnings = (undescribed,)
    lacking = [n for n, one in more.items() if n > count and one.use and not one.channels] if raw.analog.size else []
    warnings += tuple(
        f"Plate {n} of session.toml is none of the file's {count} plates. Give its channels in [plates.plate{n}], or "
        f"take it away."
        for n in lacking
    )
    unused = [n for n, one in more.items() if not one.use]
    numbers = sorted({*range(1, count + 1), *(n for n, one in more.items() if one.channels)} - set(unused))
    history = tuple(f"plate{n} was left out, as session.toml says." for n in unused if n <= count)
    return numbers, warnings, history


def total_wrench(plates: tuple[Plate, ...]) -> Wrench:
    """Return the summed wrench of plates that share one time base; TrialRefused without plates or with different
    time bases.
    """
    if not plates or any(not np.array_equal(p.wrench.time, plates[0].wrench.time) for p in plates):
        raise TrialRefused(
            "The total wrench needs at least one plate and one time base for all of them. Read the plates from one "
            "file."
        )
    return Wrench(plates[0].wrench.time, np.sum([p.wrench.value for p in plates], axis=0))


def _readings(
    raw: RawC3d, numbers: list[int], metres: float, turn: Array, told: Mapping[str, ToldPlate]
) -> tuple[list[PlateReading], list[str]]:
    """Return the readings of the plates that make sense and a sentence for each of the others."""
    readings, refused = [], []
    for number in numbers:
        try:
            plate = plate_parameters(raw, number, told.get(f"plate{number}"), metres=metres, turn=turn)
            readings.append(read_plate_signals(raw, plate, metres=metres, turn=turn))
        except TrialRefused as error:
            refused.append(_left_out(number, error))
    return readings, refused


def _alive(readings: list[PlateReading], markers: Markers | None) -> tuple[list[PlateReading], list[Defect]]:
    """Return the readings of plates that are not dead, without constants where nobody steps on them; the dead ones."""
    alive, dead = [], []
    for reading in readings:
        elsewhere = borne_elsewhere(reading, [one for one in readings if one is not reading], markers)
        constant = without_offset(reading, elsewhere)
        if why := why_dead(constant, markers, elsewhere):
            said = _left_out(reading.plate.number, TrialRefused(why))
            dead.append(Defect("dead_plate", reading.plate.name, said, float(reading.sensor[:, 2].mean()), "N"))
        else:
            alive.append(constant)
    return alive, dead


def _measured(
    raw: RawC3d, readings: list[PlateReading], markers: Markers | None
) -> tuple[list[PlateReading], list[Defect]]:
    """Return the readings without padding at the ends of the recording, where a plate is loaded meanwhile, and it as a
    defect.
    """
    padded = padded_samples(raw, markers)
    if not any((np.abs(reading.sensor[padded, 2]) > TOUCH_FORCE).any() for reading in readings):
        return readings, []
    said, lost = padding_said(padded, raw.analog_rate), float(padded.sum() / raw.analog_rate)
    return [replace(one, known=one.known & ~padded) for one in readings], [Defect("padding", "", said, lost, "s")]


def _two_signs(readings: list[PlateReading], votes: list[float]) -> tuple[str, ...]:
    """Say that some plates of the file hold the reaction and others the load."""
    by = {sign: [str(r.plate.number) for r, v in zip(readings, votes, strict=True) if v == sign] for sign in (1, -1)}
    if not (by[1] and by[-1]):
        return ()
    up, down = (
        f"plate{'s' * (len(by[sign]) > 1)} {', '.join(by[sign])} hold{'s' * (len(by[sign]) == 1)}" for sign in (1, -1)
    )
    return (
        f"Two signs in one laboratory: along the same direction {up} the force up and {down} the force down; each was "
        f"turned so that weight points up, its shear with it. If only Fz of one plate has the wrong sign, its shear is "
        f"now wrong: check cabling and software.",
    )


def _oriented(
    readings: list[PlateReading], time: Array, markers: Markers | None
) -> tuple[tuple[Plate, ...], tuple[str, ...]]:
    """Return the plates in the lab frame; an unloaded one takes the majority's sign, +1 if all are unloaded."""
    axes = [plate_axes(r.corners) for r in readings]
    signs = [gravity_sign(r.sensor, a, r.rate) for r, a in zip(readings, axes, strict=True)]  # any point: forces alone
    # the sign belongs to the plate's z: a plate whose z points the other way has the other sign
    votes = [sign * np.sign(a[2, 2]) for sign, a in zip(signs, axes, strict=True)]
    plates, warnings, mended = [], [], False
    for reading, sign, a in zip(readings, signs, axes, strict=True):
        otherwise = int(np.sign(sum(votes)) * np.sign(a[2, 2])) or 1
        alone = bool(sign) and sum(map(abs, signs)) == 1
        odd = bool(sign) and any(other == -sign * np.sign(a[2, 2]) for other in votes)
        try:
            done = oriented(reading, time, markers=markers, alone=alone, otherwise=otherwise, odd=odd)
        except TrialRefused as error:
            warnings.append(_left_out(reading.plate.number, error))
            continue
        plates.append(done.plate)
        warnings += done.warnings
        mended = mended or done.fz_alone
    return tuple(plates), (*(() if mended else _two_signs(readings, votes)), *warnings)


def _left_out(number: int, error: TrialRefused) -> str:
    return f"Plate {number} was left out, and what it carried is missing from the total: {error}"


def _time(raw: RawC3d, markers: Markers | None) -> Array:
    """Return the times (S,) s of the analog samples on the clock of the markers; from 0 without markers."""
    start = float(markers.time[0]) if markers is not None and markers.time.size else 0.0
    return start + np.arange(raw.analog.shape[0]) / raw.analog_rate


def _weight_said(plates: tuple[Plate, ...], markers: Markers | None, body_mass: float | None) -> tuple[str, ...]:
    """Return a warning if the weight in quiet standing contradicts the declared mass."""
    walks = markers is not None and movement(markers) > StandingRules.still
    mass = steady_mass(total_wrench(plates)) if plates and not walks else None
    if mass is None or body_mass is None or not body_mass > 0 or abs(mass / body_mass - 1) <= CheckLimits.mass / 100:
        return ()
    said = f"The plates carry {mass:.2f} kg in quiet standing, {body_mass:.2f} kg are declared"
    for factor, meaning in ((POUND, "newton declared as pounds"), (1 / POUND, "pounds declared as newton")):
        if abs(mass / body_mass / factor - 1) <= _AS_POUNDS:
            return (f"{said}: the ratio is that of {meaning}. Check ANALOG:UNITS.",)
    return (f"{said}: check the mass, the units, and whether a foot stood beside the plates.",)

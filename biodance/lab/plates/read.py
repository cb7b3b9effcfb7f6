"""The force plates of a C3D file: one wrench per plate, ground on subject, about the lab origin, in SI. Every
decision is a sentence.
"""

from dataclasses import replace

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.markers.still import movement, steady_mass
from biodance.lab.plates.corners import plate_axes
from biodance.lab.plates.orientation import oriented
from biodance.lab.plates.parameters import POUND, count_plates, plate_parameters
from biodance.lab.plates.signals import PlateReading, read_plate_signals
from biodance.lab.plates.wrench import gravity_sign
from biodance.records import Array, Markers, Plate, Wrench
from biodance.settings import TOUCH_FORCE, CheckLimits, StandingRules
from biodance.spatial import wrench_about_origin, wrench_about_point

_AS_POUNDS = 0.03
_STUCK = 2e-3  # share of its mean by which the vertical of a loaded plate varies at least, whoever moves on it

_SAME_PLACE = 0.001
"""m: standard deviation of a centre of pressure that nobody moves."""
_HALF_ROUND = "were turned by 180 degrees"
ReadPlates = tuple[tuple[Plate, ...], tuple[str, ...]]


def read_plates(
    raw: RawC3d,
    *,
    metres: float,
    turn: Array | None = None,
    markers: Markers | None = None,
    body_mass: float | None = None,
) -> ReadPlates:
    """Return the force plates of a C3D file and the warnings about them.

    Each ``Plate.wrench`` is the ground's action ON the subject about the LAB origin at the analog rate, zero taken off,
    in N and N·m.

    ``metres`` is the file's length unit in m (0.001 for mm); ``turn`` (3, 3) leads from the file's axes to the lab
    frame (z up; None = they are the same); ``markers`` (m, lab frame) set the clock and say where the feet are;
    ``body_mass`` kg is compared with the weight on the plates. A plate that cannot be trusted is left out with a
    warning that says why; nothing is raised. The method per TYPE is in ``plate_types``.
    """
    count, warnings = count_plates(raw)
    if not count:
        return (), warnings
    if raw.analog.shape[0] == 0 or not raw.analog_rate > 0:
        lacks = "holds no analog samples" if raw.analog.shape[0] == 0 else f"has the analog rate {raw.analog_rate:g}"
        return (), (
            *warnings,
            f"The file declares {count} force plates but {lacks}: no plate was read. Export it with the analog data.",
        )
    readings, refused = _readings(raw, count, metres, np.eye(3) if turn is None else turn)
    readings, stuck = _alive(readings, markers)
    plates, said = _oriented(readings, _time(raw, markers), markers)
    return plates, (*warnings, *refused, *stuck, *said, *_weight_said(plates, markers, body_mass))


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


def _readings(raw: RawC3d, count: int, metres: float, turn: Array) -> tuple[list[PlateReading], list[str]]:
    """Return the readings of the plates that make sense and a sentence for each of the others."""
    readings, refused = [], []
    for number in range(1, count + 1):
        try:
            readings.append(read_plate_signals(raw, plate_parameters(raw, number), metres=metres, turn=turn))
        except TrialRefused as error:
            refused.append(_left_out(number, error))
    return readings, refused


def _alive(readings: list[PlateReading], markers: Markers | None) -> tuple[list[PlateReading], list[str]]:
    """Return the readings without plates that carry the same load at the same place for the whole trial, though the
    person moves (whoever stands and lifts an arm moves the centre of pressure); a sentence for each of these.
    """
    alive, said = [], []
    moves = markers is not None and movement(markers) > StandingRules.still
    for reading in readings:
        sensor = reading.sensor if reading.known.all() else reading.sensor[reading.known]
        vertical = sensor[:, 2]
        mean, spread = float(vertical.mean()), float(vertical.std())
        wanders = max(float(moment.std()) for moment in sensor[:, 3:5].T)
        same = spread < _STUCK * abs(mean) and wanders < _SAME_PLACE * abs(mean)
        if not (moves and abs(mean) > TOUCH_FORCE and same):
            alive.append(reading)
            continue
        wires = ", ".join(str(c + 1) for c in reading.plate.channels)
        stuck = TrialRefused(
            f"it reads a constant {mean:.0f} N (± {spread:.2g} N) while the person moves: a stuck or unplugged "
            f"channel, or a plate whose zero was never set. Check channels {wires}."
        )
        said.append(_left_out(reading.plate.number, stuck))
    return alive, said


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


def _oriented(readings: list[PlateReading], time: Array, markers: Markers | None) -> ReadPlates:
    """Return the plates in the lab frame; an unloaded one takes the majority's sign, +1 if all are unloaded."""
    axes = [plate_axes(r.corners) for r in readings]
    signs = [gravity_sign(r.sensor, a, r.rate) for r, a in zip(readings, axes, strict=True)]  # any point: forces alone
    # the sign belongs to the plate's z: a plate whose z points the other way has the other sign
    votes = [sign * np.sign(a[2, 2]) for sign, a in zip(signs, axes, strict=True)]
    plates, warnings, mended = [], [], []
    for reading, sign, a in zip(readings, signs, axes, strict=True):
        otherwise = int(np.sign(sum(votes)) * np.sign(a[2, 2])) or 1
        alone = bool(sign) and sum(map(abs, signs)) == 1
        try:
            plate, said = oriented(reading, time, markers=markers, alone=alone, otherwise=otherwise)
        except TrialRefused as error:
            warnings.append(_left_out(reading.plate.number, error))
            continue
        odd = bool(sign) and any(other == -sign * np.sign(a[2, 2]) for other in votes)
        if odd and any(_HALF_ROUND in one for one in plate.decisions):
            plate, said = _vertical_alone(plate, said)
            mended.append(reading)
        plates.append(plate)
        warnings += said
    doubts = () if mended else _two_signs(readings, votes)
    return tuple(plates), (*doubts, *warnings)


def _vertical_alone(plate: Plate, warnings: tuple[str, ...]) -> tuple[Plate, tuple[str, ...]]:
    """Return a plate of another sign than its neighbours as one whose Fz alone has the wrong sign, where its axes were
    turned half round, too: both together turn no channel but Fz, and Mz, which is turned back here; and warnings.
    """
    said = (
        "Fz alone was turned round: its sign is another one than on the other plates, and with the other channels as "
        "they are the load lies under the feet that the markers show."
    )
    mirrored = wrench_about_point(plate.wrench.value, plate.centre) * [1, 1, 1, 1, 1, -1]
    wrench = Wrench(plate.wrench.time, wrench_about_origin(mirrored, plate.centre))
    decisions = tuple(said if _HALF_ROUND in one else one for one in plate.decisions)
    kept = tuple(one for one in warnings if _HALF_ROUND not in one)
    number = plate.name.removeprefix("plate")
    return replace(plate, wrench=wrench, decisions=decisions), (*kept, f"Plate {number}: {said} Check its cabling.")


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

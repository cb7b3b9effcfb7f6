"""The force plates of a C3D file: one wrench per plate, ground on subject, about the lab origin, in SI. Every
decision is a sentence.

parameters (what the file says) -> decode (channels to wrench, in plate axes) -> left_out (what is no measurement) ->
sense (directions, and the wrench in the lab).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.markers.still import movement, steady_mass
from biodance.lab.plates.decode import decode_plates
from biodance.lab.plates.left_out import left_out_said, without_dead, without_padding
from biodance.lab.plates.parameters import POUND, declared_plates
from biodance.lab.plates.sense import sense_plates, with_loads_on_plates
from biodance.lab.plates.told import ToldPlate
from biodance.records import Array, Defect, Markers, Plate, Wrench
from biodance.settings import CheckLimits, StandingRules

_AS_POUNDS = 0.03  # share by which a ratio of weights may differ from newton per pound


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
    raised. The formula per TYPE is in `sensor_wrench`.
    """
    turn = np.eye(3) if turn is None else turn
    declared = declared_plates(raw, told or {}, metres=metres, turn=turn)
    decoded = decode_plates(raw, declared.plates, metres=metres, turn=turn, mass=body_mass)
    readings, beside = with_loads_on_plates(decoded.readings)
    refused = {**declared.refused, **decoded.refused, **beside}
    warnings = (*declared.warnings, *decoded.warnings, *(left_out_said(n, refused[n]) for n in sorted(refused)))
    if not readings:
        return ReadPlates((), warnings, declared.history)
    readings, dead = without_dead(readings, markers)
    readings, padded = without_padding(raw, readings, markers)
    start = float(markers.time[0]) if markers is not None and markers.time.size else 0.0
    plates, said = sense_plates(readings, start + np.arange(len(raw.analog)) / raw.analog_rate, markers)
    defects = (*dead, *padded)
    followed = (f"{one.plate.name}: {one.plate.told.sentence}" for one in readings if one.plate.told.sentence)
    history = (*declared.history, *followed, *(one.text for one in defects))
    return ReadPlates(plates, (*warnings, *said, *_weight_said(plates, markers, body_mass)), history, defects)


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


def _weight_said(plates: tuple[Plate, ...], markers: Markers | None, body_mass: float | None) -> tuple[str, ...]:
    """Return a warning if the weight in quiet standing contradicts the declared mass."""
    walks = markers is not None and movement(markers) > StandingRules.still
    if not plates or walks:
        return ()
    total = total_wrench(plates)
    mass = steady_mass(total)
    if mass is None or body_mass is None or not body_mass > 0 or abs(mass / body_mass - 1) <= CheckLimits.mass / 100:
        return ()
    said = f"The plates carry {mass:.2f} kg in quiet standing, {body_mass:.2f} kg are declared"
    for factor, meaning in ((POUND, "newton declared as pounds"), (1 / POUND, "pounds declared as newton")):
        if abs(mass / body_mass / factor - 1) <= _AS_POUNDS:
            return (f"{said}: the ratio is that of {meaning}. Check ANALOG:UNITS.",)
    return (f"{said}: check the mass, the units, and whether a foot stood beside the plates.",)

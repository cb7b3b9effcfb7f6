"""The force plates of a C3D file: one wrench per plate, ground on subject, about the lab origin, in SI. Every
decision is a sentence.

parameters (what the file says) -> decode (channels to wrench, in plate axes) -> what is no measurement ->
sense (directions, and the wrench in the lab). Plates of other formats come as wrenches and are placed as session.toml
says (`as_told`); those that feet have placed lie at one place in all trials (`one_place`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.markers.upright import movement, steady_mass
from biodance.lab.plates import (
    C3D_ONLY,
    NOTHING_TOLD,
    POUND,
    PlateParameters,
    Told,
    ToldPlate,
    declared_plates,
)
from biodance.lab.plates.decode import LARGEST_SHARE, PlateReading, block_means, decode_plate, plate_axes
from biodance.lab.plates.sense import left_out_said, sense_plates, with_loads_on_plates
from biodance.records import Array, Defect, Markers, Plate, Trial, Wrench, grouped
from biodance.records.attention import Doubt, WrongWeight
from biodance.settings import STANDARD_GRAVITY, TOUCH_FORCE, CheckLimits, StandingRules
from biodance.spatial import turned_wrench, wrench_about_origin, wrench_about_point

_CONTACT = 0.1  # s over which the plate's noise is averaged


def decode_plates(
    raw: RawC3d, plates: Sequence[PlateParameters], *, metres: float, turn: Array, mass: float | None
) -> tuple[list[PlateReading], dict[int, str], tuple[str, ...]]:
    """Return the readings of all plates of a C3D file, without ANALOG:SCALE where it was applied already.

    Programs that store floating-point channels in their units may leave the SCALE of the integers in the file. It is
    not applied where with it the plates carry less than half or more than twice the weight, and without it, within
    15 %, all of it.

    ``metres`` is the file's length unit in m, ``turn`` (3, 3) leads from file axes to the lab, ``mass`` kg is the
    person's (None = not known). Return the readings of the plates that make sense; by number why others are not used,
    with the value and what would be legal; and what was decided about the scale of the whole file.
    """
    done, lost = _decode_each(raw, plates, metres, turn)
    used = [column for reading in done for column in reading.plate.channels]
    if not mass or not mass > 0 or raw.layout is None or not raw.layout.floating or not used:
        return done, lost, ()
    gain, share = raw.layout.gain[used], _weight_share(done, mass)
    # A foot beside the plates costs less than half.
    if not np.isfinite(gain).all() or (gain == 1).all() or 0.5 < share < 2:
        return done, lost, ()
    # A scale of zero, or none, cannot be undone.
    scale = np.where(np.isfinite(raw.layout.gain) & (raw.layout.gain != 0), raw.layout.gain, 1.0)
    # Undoes (stored - offset) scale.
    stored = replace(raw, analog=raw.analog / scale + raw.layout.offset)
    plain, lost_plain = _decode_each(stored, plates, metres, turn)
    whole = _weight_share(plain, mass)
    # Shoes, clothes and movement make a difference, too.
    if len(plain) < len(done) or abs(whole - 1) > 0.15:
        return done, lost, ()
    said = (
        f"Read with ANALOG:SCALE the plates carry {share:.1g} of the weight ({mass:.4g} kg), without it all of it "
        f"({whole:.2f}): the floating-point data are already scaled, and SCALE was not applied. Write 1 into "
        f"ANALOG:SCALE, or export the file again."
    )
    return plain, lost_plain, (said,)


def _decode_each(
    raw: RawC3d, plates: Sequence[PlateParameters], metres: float, turn: Array
) -> tuple[list[PlateReading], dict[int, str]]:
    """Return the readings of the plates that make sense, and by number why others are refused."""
    readings, lost = [], {}
    for plate in plates:
        try:
            readings.append(decode_plate(raw, plate, metres, turn))
        except TrialRefused as error:
            lost[plate.number] = str(error)
    return readings, lost


def _weight_share(readings: Sequence[PlateReading], mass: float) -> float:
    """Return the median of the total vertical force while somebody is on the plates over the weight of ``mass`` kg."""
    total = np.sum([np.abs(reading.sensor[:, 2]) for reading in readings], axis=0)
    # Somebody stands there, at a share of the largest total.
    # Share of the largest total force from which on somebody stands on the plates
    loaded = total >= 0.3 * total.max()
    return float(np.median(total[loaded]) / (mass * STANDARD_GRAVITY))


def without_dead(readings: Sequence[PlateReading], markers: Markers | None) -> tuple[list[PlateReading], list[Defect]]:
    """Return the readings of plates that are not dead, without constants where nobody steps on them; the dead ones."""
    alive, dead = [], []
    stood_on = [markers is not None and bool(one.under(markers.xyz).any()) for one in readings]
    for reading, feet in zip(readings, stood_on, strict=True):
        # the largest force of another plate with a foot on it; 0 with a foot on this one, or without
        others = (one for one, on in zip(readings, stood_on, strict=True) if on and not feet)
        loads = (float(np.abs(one.sensor[:, 2]).max()) for one in others)
        elsewhere = max((load for load in loads if load > 5 * TOUCH_FORCE), default=0.0)
        # Its zero first: a plate that reads a small constant is no dead one.
        constant = _without_offset(reading, elsewhere)
        if why := _why_dead(constant, markers, elsewhere):
            said = left_out_said(reading.plate.number, why)
            dead.append(Defect("dead_plate", reading.plate.name, said, float(reading.sensor[:, 2].mean()), "N"))
        else:
            alive.append(constant)
    return alive, dead


def _without_offset(reading: PlateReading, elsewhere: float) -> PlateReading:
    """Return the reading without the constant that it reads while the person is ``elsewhere`` (N), as its zero."""
    level, spread, _ = _course(reading, _CONTACT)
    # 2.5 N: half the spread up to which `decode` calls a plate quiet; a foot that comes or goes changes it far more.
    if not TOUCH_FORCE < abs(level) <= LARGEST_SHARE * elsewhere or spread >= 2.5:
        return reading
    zero = reading.sensor[reading.known].mean(axis=0)
    said = f"Zero: no foot is ever on the plate, so the constant {level:.3g} N that it reads was subtracted."
    decisions = {**reading.decisions, "zero": (said,)}  # instead of the sentence that no zero was found
    return replace(reading, sensor=reading.sensor - zero, empty=reading.empty + zero[:3], decisions=decisions)


def _why_dead(reading: PlateReading, markers: Markers | None, elsewhere: float) -> str:
    """Return why a plate is dead, "" for one alive: a constant load at one place though the person moves."""
    length = _CONTACT if elsewhere else 0.0  # noise is averaged only where feet tell that nobody is on the plate
    level, spread, wanders = _course(reading, length)
    # Shares of the level: noise of a load grows with it, and moments over it are places. Whoever moves on a plate
    # varies its vertical force by 2e-3 at least, and moves the centre of pressure by more than 0.001 m (sd).
    still = spread < 2e-3 * abs(level) and wanders < 0.001 * abs(level)
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


def _course(reading: PlateReading, length: float) -> tuple[float, float, float]:
    """Return the mean vertical N, and the sds of its means over ``length`` s and of the worse moment's, N·m."""
    means, _ = block_means(reading.sensor[reading.known, 2:5], reading.rate, length=length)
    level, (spread, *wanders) = float(means[:, 0].mean()), means.std(axis=0)
    return level, float(spread), float(max(wanders))


def without_padding(
    raw: RawC3d, readings: Sequence[PlateReading], markers: Markers | None
) -> tuple[list[PlateReading], list[Defect]]:
    """Return the readings without padding at the ends of the recording, where a plate is loaded meanwhile, and it as a
    defect. Padding: recording programs and filters that need what was before the first or after the last sample write
    that sample again; nothing was measured there.
    """
    padded = np.zeros(len(raw.analog), dtype=bool)
    # Channels that never change say nothing of padding.
    live = raw.analog[:, (raw.analog != raw.analog[:1]).any(axis=0)] if len(raw.analog) else raw.analog
    first, last = (_repeats(live), _repeats(live[::-1])) if live.size else (0, 0)
    # Padding only where the markers go on meanwhile.
    if first and _moves(markers, 0.0, first / raw.analog_rate):
        padded[:first] = True
    if last and _moves(markers, (len(live) - last) / raw.analog_rate, np.inf):
        padded[-last:] = True
    if not any((np.abs(reading.sensor[padded, 2]) > TOUCH_FORCE).any() for reading in readings):
        return [*readings], []
    first = int(np.argmin(padded)) if padded[:1].any() else 0
    last = int(np.argmin(padded[::-1])) if padded[-1:].any() else 0
    ends = [
        f"{end} {1000 * count / raw.analog_rate:.4g} ms" for end, count in (("first", first), ("last", last)) if count
    ]
    said = (
        f"The {' and the '.join(ends)} of every analog channel repeat one sample: padding by the recording program. "
        f"They were left out."
    )
    lost = float(padded.sum() / raw.analog_rate)
    return [replace(one, known=one.known & ~padded) for one in readings], [Defect("padding", "", said, lost, "s")]


def _repeats(live: Array) -> int:
    """Return how many samples before the first measured one repeat it; 0 for too few."""
    count = int(np.argmax((live != live[0]).any(axis=1))) - 1
    # Five equal samples are no chance: where each of six channels repeats its number half of the time, as a coarse
    # converter does at rest, all of them repeat it four times in six of a hundred million rows.
    return count if count >= 4 and live[0].any() else 0


def _moves(markers: Markers | None, start: float, stop: float) -> bool:
    """Return whether a marker moves between two times (s from the first frame); True where nobody can tell."""
    if markers is None or markers.time.size < 2:
        return True
    time = markers.time - markers.time[0]
    first = min(int(np.searchsorted(time, start)), time.size - 2)
    some = markers.xyz[first : max(int(np.searchsorted(time, stop)), first + 1) + 1]
    return bool((np.diff(some, axis=0) != 0)[np.isfinite(np.diff(some, axis=0))].any())


class PlatesRead(NamedTuple):
    """The plates of one recording, what a person should look at, what was decided without doubt, what was left out."""

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
) -> PlatesRead:
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
    declared, refused, odd, unused = declared_plates(raw, told or {}, metres=metres, turn=turn)
    decoded, lost, scaled = decode_plates(raw, declared, metres=metres, turn=turn, mass=body_mass)
    readings, beside = with_loads_on_plates(decoded)
    refused |= {**lost, **beside}
    warnings = (*odd, *scaled, *(left_out_said(n, refused[n]) for n in sorted(refused)))
    if not readings:
        return PlatesRead((), warnings, unused)
    readings, dead = without_dead(readings, markers)
    readings, padded = without_padding(raw, readings, markers)
    start = float(markers.time[0]) if markers is not None and markers.time.size else 0.0
    plates, said = sense_plates(readings, start + np.arange(len(raw.analog)) / raw.analog_rate, markers)
    defects = (*dead, *padded)
    followed = (f"{one.plate.name}: {one.plate.told.sentence}" for one in readings if one.plate.told.sentence)
    history = (*unused, *followed, *(one.text for one in defects))
    return PlatesRead(plates, (*warnings, *said, *_weight_said(plates, markers, body_mass)), history, defects)


def _weight_said(plates: tuple[Plate, ...], markers: Markers | None, body_mass: float | None) -> tuple[str, ...]:
    """Return a warning if the weight in quiet standing contradicts the declared mass."""
    walks = markers is not None and movement(markers) > StandingRules.still
    if not plates or walks:
        return ()
    mass = steady_mass(Wrench(plates[0].wrench.time, np.sum([one.wrench.value for one in plates], axis=0)))
    if mass is None or body_mass is None or not body_mass > 0 or abs(mass / body_mass - 1) <= CheckLimits.mass / 100:
        return ()
    said = f"The plates carry {mass:.2f} kg in quiet standing, {body_mass:.2f} kg are declared"
    for factor, meaning in ((POUND, "newton declared as pounds"), (1 / POUND, "pounds declared as newton")):
        # Share by which a ratio of weights may differ from newton per pound
        if abs(mass / body_mass / factor - 1) <= 0.03:
            return (f"{said}: the ratio is that of {meaning}. Check ANALOG:UNITS.",)
    return (WrongWeight(f"{said}: check the mass, the units, and whether a foot stood beside the plates."),)


def as_told(trial: Trial, told: Told) -> Trial:
    """Return a trial of a format whose plates come as wrenches (text, AMTI) with what the analyst says of them.

    A plate of unknown place gets its corners; one that was placed in a frame of its own is moved there with what it
    measured. What only the channels of a C3D file can follow is named in a warning.
    """
    plates, history, warnings = [], [], []
    for plate in trial.plates:
        said = told.plates.get(plate.name, NOTHING_TOLD)
        if not said.use:
            history.append(f"{plate.name} was left out, as session.toml says.")
            continue
        idle = [key for key in said.keys if key in C3D_ONLY]
        if idle:
            warnings.append(f"{plate.name}: {', '.join(idle)} of session.toml can be followed in C3D files only.")
        done = plate if said.corners is None else _placed(plate, said.corners)
        if used := ", ".join(key for key in said.keys if key not in idle):
            taken = f"{used} as session.toml says."
            done = replace(done, foot=said.foot, decisions=(*done.decisions, f"{taken[0].upper()}{taken[1:]}"))
            history.append(f"{plate.name}: {taken}")
        plates.append(done)
    history, warnings = [*trial.history, *history], [*trial.warnings, *warnings]
    return replace(trial, plates=tuple(plates), history=tuple(history), warnings=tuple(warnings))


def _placed(plate: Plate, corners: Array) -> Plate:
    """Return the plate at ``corners`` (4, 3) m."""
    if not plate.placed:
        return replace(plate, corners=corners, placed=True)
    turn = plate_axes(corners) @ plate_axes(plate.corners).T
    # Both vectors turn about the plate's own centre.
    local = turned_wrench(wrench_about_point(plate.wrench.value, plate.centre), turn)
    wrench = Wrench(plate.wrench.time, wrench_about_origin(local, corners.mean(axis=0)))
    return replace(plate, corners=corners, wrench=wrench, zero=turn @ plate.zero)


def one_place(trials: Sequence[Trial]) -> tuple[list[Trial], list[str]]:
    """Return the trials with every plate that was put by the feet (``Plate.put``) at the median of what they say, and
    notes: a plate does not move between the trials of one visit, while people lean otherwise in each.
    """
    plates = (plate for trial in trials for plate in trial.plates)
    puts = grouped((plate.name, plate.put) for plate in plates if plate.put is not None)
    place, notes = {}, list[str]()
    for name, found in puts.items():
        apart = float(np.ptp(found, axis=0).max())
        # Nearly three times what the feet leave open in two trials (0.013 m each): another plate, or it was moved.
        if apart > 0.05:
            notes.append(
                Doubt(
                    f"{name} would lie up to {1000 * apart:.0f} mm elsewhere in another trial by where the feet stand: "
                    "each trial keeps its own place",
                    f"Give corners_m in [plates.{name}] of session.toml.",
                )
            )
        elif len(found) > 1:
            place[name] = np.median(found, axis=0)
            x, y = place[name]
            notes.append(
                f"{name} was put at ({x:.3f}, {y:.3f}, 0) m in all trials, the median of what the feet of "
                f"{len(found)} say, which are up to {1000 * apart:.0f} mm apart."
            )
    return [replace(trial, plates=tuple(_moved(plate, place) for plate in trial.plates)) for trial in trials], notes


def _moved(plate: Plate, place: dict[str, Array]) -> Plate:
    """Return the plate, with its wrench, at its ``place``."""
    if plate.put is None or plate.name not in place:
        return plate
    # On the ground: only x and y were put.
    shift = np.array([*(place[plate.name] - plate.put), 0.0])
    wrench = Wrench(plate.wrench.time, wrench_about_origin(plate.wrench.value, shift))
    return replace(plate, corners=plate.corners + shift, wrench=wrench, put=place[plate.name])

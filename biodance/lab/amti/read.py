"""AMTI's native files as Trials with plates and no markers; the lab frame is the plate's frame turned upright."""

from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.amti.bsf import BsfContent, BsfPlate, parse_bsf
from biodance.lab.amti.text import parse_amti_text
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.plates.corners import LONGEST_SIDE, SHORTEST_SIDE
from biodance.lab.plates.decode import DEEPEST, find_baseline, loaded_samples
from biodance.lab.plates.parameters import INCH, POUND
from biodance.lab.plates.sense import gravity_sign, sensor_below, wrench_in_lab
from biodance.records import Array, Plate, Role, Source, Trial, Wrench
from biodance.settings import STANDARD_GRAVITY
from biodance.spatial import wrench_about_point

_PLATE_UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""lab_R_plate (3, 3): AMTI's plate axes have z down; x stays, y and z are turned, so that the lab's z points up."""
_OWN_ZERO = 5.0  # N: an unloaded reading up to here is what the maker's own zero leaves and is kept


def amti_plate(
    number: int,
    channels: Array,
    size: tuple[float, float],
    centre: Array,
    vector: Array,
    *,
    rate: float,
    said: tuple[str, ...],
) -> tuple[Plate, tuple[str, ...]]:
    """Return the plate with the ground's wrench on the subject, and warnings.

    ``channels`` (S, 6) N, N·m: the load ON the plate in plate axes (z down) about the sensor origin; ``size`` (x, y) m;
    ``centre`` (3,) m of its surface in the lab frame; ``vector`` (3,) m from the sensor origin to the surface centre in
    plate axes; ``rate`` Hz.
    """
    channels, zeroed = _zeroed(channels, rate)
    below, placed = sensor_below(vector, _PLATE_UPRIGHT)
    wrench = wrench_about_point(channels, below)
    sign = 1 if gravity_sign(wrench[loaded_samples(wrench, rate)], _PLATE_UPRIGHT) > 0 else -1
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(size) / 2
    corners = np.column_stack([half, np.zeros(4)]) @ _PLATE_UPRIGHT.T + centre
    directions = (
        "Lab frame = plate frame turned about x: x stays, y and z (down) are reversed, so that z points up; origin at "
        "the first surface.",
        "Sign: the file holds the load on the plate; turned round to the ground's action on the subject."
        if sign < 0
        else "Sign: the weight shows that the file holds the reaction, not the load on the plate; it was kept.",
    )
    recorded = Wrench(np.arange(len(channels)) / rate, wrench_in_lab(wrench, _PLATE_UPRIGHT, sign, centre))
    plate = Plate(f"plate{number}", 0, corners, recorded, (*said, zeroed, placed, *directions))
    return plate, (f"Plate {number}: {directions[1]}",) if sign > 0 else ()


def _zeroed(channels: Array, rate: float) -> tuple[Array, str]:
    """Return the channels without the empty plate's reading where it is more than the maker's zero leaves."""
    zero = find_baseline(channels[:, 2], zero=None, rate=rate)
    if zero.stop <= zero.start:
        return channels, "Zero: the maker's own was kept; the plate is never seen unloaded."
    empty = channels[zero.start : zero.stop].mean(axis=0)
    where = f"unloaded (samples {zero.start + 1}-{zero.stop}) the plate reads {empty[2]:.2g} N vertical"
    if abs(empty[2]) <= _OWN_ZERO:
        return channels, f"Zero: the maker's own was kept; {where}."
    return channels - empty, f"Zero: {where}; that mean was subtracted from every channel."


_LIGHTEST, HEAVIEST = 10.0, 300.0  # kg


def read_bsf(path: str | Path, *, role: Role = "fit") -> Trial:
    """Read a NetForce .bsf file, version 100 or 105, as a trial without markers.

    The wrench is the ground's action ON the subject in N, N·m about the lab origin: the centre of the first plate's
    surface, x as the plate's x, z up.

    Raises
    ------
    FileRefused
        The file is missing, damaged or cut off, has another version, or a plate has no calibration or an impossible
        size.
    """
    path = Path(path)
    content = read_bytes(path)
    bsf = parse_bsf(content, path)
    plates, warnings, centre = [], [], np.zeros(3)
    for number, plate in enumerate(bsf.plates, start=1):
        _refuse_nonsense(plate, number, path)
        if number > 1:
            centre = centre + _PLATE_UPRIGHT @ plate.distance
            warnings.append(_placed(plate, number))
        place, said = (plate.size, centre, plate.offset), (_unit_said(bsf, plate),)
        done, odd = amti_plate(number, plate.load, *place, rate=bsf.rate, said=said)
        plates.append(done)
        warnings += odd
    history = [f"AMTI NetForce file, version {bsf.version}, {bsf.rate:g} Hz."]
    if bsf.other_channels:
        history.append(f"{bsf.other_channels} channels of other instruments were not read.")
    source = Source(path, sha256(content), f"AMTI .bsf {bsf.version}", analog_rate=bsf.rate)
    told = (_measurements(bsf.main), tuple(history), tuple(warnings))
    return Trial(path.stem, role, None, tuple(plates), source, "", *told)


def read_amti_ascii(path: str | Path, *, role: Role = "fit") -> Trial:
    """Read a text export of one AMTI plate; what the text does not say stands in a small TOML file of the same name
    beside it.

    The wrench is as in `read_bsf`.

    Raises
    ------
    FileRefused
        The file is missing or no table of numbers, or order, units, rate or plate size are said nowhere; the message
        shows the TOML to write.
    """
    path = Path(path)
    text = parse_amti_text(path)
    load = text.load if text.load_on_plate else -text.load
    vector = np.array([0.0, 0.0, -text.sensor_depth])
    plate, warnings = amti_plate(1, load, text.size, np.zeros(3), vector, rate=text.rate, said=text.said)
    source = Source(path, sha256(read_bytes(path)), "AMTI text", analog_rate=text.rate)
    history = (f"AMTI text export, {text.rate:g} Hz.",)
    return Trial(path.stem, role, None, (plate,), source, history=history, warnings=warnings)


def _refuse_nonsense(plate: BsfPlate, number: int, path: Path) -> None:
    if not SHORTEST_SIDE <= min(plate.size) <= max(plate.size) <= LONGEST_SIDE:
        raise FileRefused(
            f"{path}: plate {number} is {plate.size[0]:.3g} x {plate.size[1]:.3g} m, legal are sides of "
            f"{SHORTEST_SIDE:g} to {LONGEST_SIDE:g} m. Enter the plate's size in NetForce and save again."
        )
    if not np.abs(plate.offset).max() <= DEEPEST:
        raise FileRefused(
            f"{path}: the sensor of plate {number} is said to lie {np.abs(plate.offset).max():.3g} m off. Correct its "
            f"offset in NetForce."
        )


def _placed(plate: BsfPlate, number: int) -> str:
    if not plate.distance.any():
        return (
            f"Plate {number}: the file says no distance to the plate before it, so both lie at one place. Enter "
            f"it in NetForce."
        )
    away: Array = _PLATE_UPRIGHT @ plate.distance
    return (
        f"Plate {number} was put ({', '.join(f'{d:.3g}' for d in away)}) m from the plate before it, as the file "
        f"says. Check that."
    )


def _unit_said(bsf: BsfContent, plate: BsfPlate) -> str:
    stored = "ADC counts times the calibration in the header" if bsf.version == 100 else "engineering units"
    return f"{plate.model or 'Plate'}, serial {plate.serial}: {stored}; lbf and in·lbf were converted to N and N·m."


def _measurements(main: Any) -> dict[str, float]:
    """Return the subject's mass (kg) and height (m) from the header where they make sense."""
    mass, height = float(main["weight"]), float(main["height"])
    if not int(main["metric"]):
        mass, height = mass * POUND / STANDARD_GRAVITY, height * INCH
    elif height > 3:
        height /= 100
    found = {"Bodymass": mass} if _LIGHTEST <= mass <= HEAVIEST else {}
    return found | ({"Height": height} if 0.5 <= height <= 2.5 else {})

"""AMTI's native files: the binary .bsf of NetForce and its text exports, each as a Trial with plates and no markers."""

from pathlib import Path
from typing import Any

import numpy as np

from biodance.errors import FileRefused
from biodance.lab.amti_bsf import BsfContent, BsfPlate, parse_bsf
from biodance.lab.amti_plate import UPRIGHT, amti_plate
from biodance.lab.amti_text import parse_amti_text
from biodance.lab.plain_text import read_bytes, sha256
from biodance.lab.plate_corners import LONGEST_SIDE, SHORTEST_SIDE
from biodance.lab.plate_signs import DEEPEST
from biodance.lab.plate_units import INCH, POUND
from biodance.records import Array, Role, Source, Trial
from biodance.settings import STANDARD_GRAVITY

LIGHTEST, HEAVIEST = 10.0, 300.0  # kg


def read_bsf(path: str | Path, *, role: Role = "fit") -> Trial:
    """Read a NetForce .bsf file, version 100 or 105, as a trial without markers.

    The wrench is the ground's action ON the subject in N, N·m about the lab origin: the centre of the first plate's surface, x as the
    plate's x, z up.

    Raises
    ------
    FileRefused
        The file is missing, damaged or cut off, has another version, or a plate has no calibration or an impossible size.
    """
    path = Path(path)
    content = read_bytes(path)
    bsf = parse_bsf(content, path)
    plates, warnings, centre = [], [], np.zeros(3)
    for number, plate in enumerate(bsf.plates, start=1):
        _refuse_nonsense(plate, number, path)
        if number > 1:
            centre = centre + UPRIGHT @ plate.distance
            warnings.append(_placed(plate, number))
        done, said = amti_plate(
            number, plate.load, rate=bsf.rate, size=plate.size, centre=centre, vector=plate.offset, said=(_unit_said(bsf, plate),)
        )
        plates.append(done)
        warnings += said
    history = [f"AMTI NetForce file, version {bsf.version}, {bsf.rate:g} Hz."]
    if bsf.other_channels:
        history.append(f"{bsf.other_channels} channels of other instruments were not read.")
    source = Source(path, sha256(content), f"AMTI .bsf {bsf.version}", analog_rate=bsf.rate)
    return Trial(
        path.stem, role, None, tuple(plates), source, measurements=_measurements(bsf.main), history=tuple(history), warnings=tuple(warnings)
    )


def read_amti_ascii(path: str | Path, *, role: Role = "fit") -> Trial:
    """Read a text export of one AMTI plate; what the text does not say stands in a small TOML file of the same name beside it.

    The wrench is as in `read_bsf`.

    Raises
    ------
    FileRefused
        The file is missing or no table of numbers, or order, units, rate or plate size are said nowhere; the message shows the TOML to
        write.
    """
    path = Path(path)
    text = parse_amti_text(path)
    load = text.load if text.load_on_plate else -text.load
    vector = np.array([0.0, 0.0, -text.sensor_depth])
    plate, warnings = amti_plate(1, load, rate=text.rate, size=text.size, centre=np.zeros(3), vector=vector, said=text.said)
    source = Source(path, sha256(read_bytes(path)), "AMTI text", analog_rate=text.rate)
    history = (f"AMTI text export, {text.rate:g} Hz.",)
    return Trial(path.stem, role, None, (plate,), source, history=history, warnings=warnings)


def _refuse_nonsense(plate: BsfPlate, number: int, path: Path) -> None:
    if not SHORTEST_SIDE <= min(plate.size) <= max(plate.size) <= LONGEST_SIDE:
        raise FileRefused(
            f"{path}: plate {number} is {plate.size[0]:.3g} x {plate.size[1]:.3g} m, legal are sides of {SHORTEST_SIDE:g} to "
            f"{LONGEST_SIDE:g} m. "
            "Enter the plate's size in NetForce and save again."
        )
    if not np.abs(plate.offset).max() <= DEEPEST:
        raise FileRefused(
            f"{path}: the sensor of plate {number} is said to lie {np.abs(plate.offset).max():.3g} m off. Correct its offset in NetForce."
        )


def _placed(plate: BsfPlate, number: int) -> str:
    if not plate.distance.any():
        return f"Plate {number}: the file says no distance to the plate before it, so both lie at one place. Enter it in NetForce."
    away: Array = UPRIGHT @ plate.distance
    return f"Plate {number} was put ({', '.join(f'{d:.3g}' for d in away)}) m from the plate before it, as the file says. Check that."


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
    found = {"Bodymass": mass} if LIGHTEST <= mass <= HEAVIEST else {}
    return found | ({"Height": height} if 0.5 <= height <= 2.5 else {})

"""Units of plate channels: from the text in ANALOG:UNITS to SI, channel by channel; an unknown unit is never passed over in silence."""

import re

from biodance.lab.plate_parameters import MATRIX_OF_TYPE, PlateParameters
from biodance.settings import STANDARD_GRAVITY

POUND, KILOGRAM_FORCE, INCH = 4.4482216152605, STANDARD_GRAVITY, 0.0254
FORCE = {
    "n": 1.0, "newton": 1.0, "newtons": 1.0, "nt": 1.0, "kn": 1000.0, "lbf": POUND, "lb": POUND, "lbs": POUND, "pound": POUND,
    "pounds": POUND, "kgf": KILOGRAM_FORCE, "kp": KILOGRAM_FORCE,
}  # fmt: skip
LENGTH = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH, "inch": INCH, "inches": INCH, "ft": 12 * INCH}
MOMENT = {force + length: f * s for force, f in FORCE.items() for length, s in LENGTH.items()} | {
    length + force: f * s for force, f in FORCE.items() for length, s in LENGTH.items() if force != "n"
}
"""N·m per unit, for unit texts without blanks and signs: ``nmm``, ``inlb``, ``lbfft`` ..."""
CONTENT = {1: "FFFLLM", 2: "FFFMMM", 3: "FFFFFFFF", 4: "FFFMMM", 5: "FFFMMM", 6: "F" * 12, 7: "F" * 8}
"""What each channel (after the calibration matrix) holds: F force, M moment, L length."""
TABLES = {"F": FORCE, "M": MOMENT, "L": LENGTH}
WORDS = {"F": "force", "M": "moment", "L": "length"}


def plain_unit(text: str) -> str:
    """Return a unit text in lower case without blanks, dots, dashes and stars: ``N.mm`` and ``N-mm`` become ``nmm``."""
    return re.sub(r"[\s.\-*·⋅/_()]", "", text).lower()


def unit_factors(plate: PlateParameters, units: tuple[str, ...], *, metres: float) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Return the factor to SI of each channel of a plate (after the calibration matrix) and what was decided about the units.

    ``units`` are the texts of the plate's channels, ``metres`` is the length unit of the file in m. The output of a calibration matrix is
    in N and N times the file's length unit, as C3D demands. A unit that is missing or makes no sense for the channel is taken as N, N
    times the file's length unit, or the file's length unit, and said.
    """
    content = CONTENT[plate.type]
    assumed = {"F": 1.0, "M": metres, "L": metres}
    if plate.type in MATRIX_OF_TYPE:
        return tuple(assumed[c] for c in content), (f"Units: channels in {_listed(units)} times CAL_MATRIX give N and N x {metres:g} m.",)
    factors, strange = [], {}
    for kind, unit in zip(content, units, strict=True):
        known = TABLES[kind].get(plain_unit(unit))
        factors.append(assumed[kind] if known is None else known)
        if known is None:
            strange[kind] = unit
    said = [f"Units: {_listed(units)}."]
    for kind, unit in strange.items():
        taken = {"F": "N", "M": f"N x {metres:g} m", "L": f"{metres:g} m"}[kind]
        said.append(f"Unit {unit!r} of a {WORDS[kind]} channel says nothing; it was taken as {taken}.")
    return tuple(factors), tuple(said)


def _listed(units: tuple[str, ...]) -> str:
    """Return the different unit texts in order, for a sentence."""
    return ", ".join(dict.fromkeys(unit or "(none)" for unit in units))

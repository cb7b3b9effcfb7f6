"""What the FORCE_PLATFORM group of a C3D file says about each plate, and the units of its channels; nothing computed
yet.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from biodance.errors import TrialRefused
from biodance.lab.c3d.raw import RawC3d
from biodance.lab.plates.told import NOTHING_TOLD, ToldPlate
from biodance.records import Array
from biodance.settings import STANDARD_GRAVITY

CHANNELS_OF_TYPE = {1: 6, 2: 6, 3: 8, 4: 6, 5: 8, 6: 12, 7: 8}
_MATRIX_OF_TYPE = {4: (6, 6), 5: (6, 8), 6: (12, 12), 7: (8, 8)}
_USUAL_TYPE = 2
"""Three forces and three moments: taken for channels of which nothing else is said."""
_NAMES_OF_TYPE = {8: "not defined", **dict.fromkeys((11, 12), "a Kistler split-belt treadmill"), 21: "AMTI stairs"}


@dataclass(frozen=True, eq=False)
class PlateParameters:
    """One plate as the file describes it, in file units and file axes.

    ``number`` from 1; ``type`` the C3D TYPE; ``channels`` columns of the analog data, from 0; ``corners`` (4, 3);
    ``origin`` (3,); ``calibration`` (rows, columns), output = calibration @ channels, None where the type has none;
    ``polynomial`` (2, 6) Kistler's correction of the centre of pressure in millimetres, None = none. ``told`` what of
    it session.toml says; its sensitivity gives N and N·m, the file's matrix N and N times the file's length unit.
    """

    number: int
    type: int
    channels: tuple[int, ...]
    corners: Array
    origin: Array
    calibration: Array | None = None
    polynomial: Array | None = None
    told: ToldPlate = NOTHING_TOLD

    @property
    def name(self) -> str:
        """The lab's name of the plate, ``plate1`` ..."""
        return f"plate{self.number}"


def count_plates(raw: RawC3d) -> tuple[int, tuple[str, ...]]:
    """Return how many plates the file declares, and a sentence where its counts contradict each other."""
    group = raw.parameters.get("FORCE_PLATFORM", {})
    types = _numbers(group, "TYPE").size
    used = _numbers(group, "USED")
    if not used.size:
        if not types and not _numbers(group, "CHANNEL").size:
            return 0, _misnamed(raw)
        return types, (f"FORCE_PLATFORM:USED is missing; TYPE lists {types} plates, which were read.",)
    declared = int(used[0]) if np.isfinite(used[0]) and 0 <= used[0] <= 255 else 0
    if declared != used[0]:
        return 0, (
            f"FORCE_PLATFORM:USED is {used[0]:g}, legal is a whole number from 0 to 255; no plate was read. Correct "
            f"the file.",
        )
    if declared < types:
        return declared, (f"FORCE_PLATFORM:USED says {declared} plates, TYPE lists {types}; {declared} were read.",)
    return declared, ()


def _misnamed(raw: RawC3d) -> tuple[str, ...]:
    """Say which group holds force plates under another name: damage, which must not pass in silence."""
    other = [name for name, group in raw.parameters.items() if {"CORNERS", "ORIGIN", "CHANNEL"} <= group.keys()]
    if not other or "FORCE_PLATFORM" in other:
        return ()
    return (
        f"The group {other[0]} holds CORNERS, ORIGIN and CHANNEL of force plates but is not called FORCE_PLATFORM: no "
        f"plate was read. Rename the group, or copy the file again from its source.",
    )


def zero_window(raw: RawC3d) -> tuple[int, int] | None:
    """Return FORCE_PLATFORM:ZERO as written (first, last), or None if it is missing or not two numbers."""
    values = _numbers(raw.parameters.get("FORCE_PLATFORM", {}), "ZERO")
    if values.size < 2 or not np.isfinite(values[:2]).all():
        return None
    return int(values[0]), int(values[1])


def plate_parameters(
    raw: RawC3d, number: int, told: ToldPlate | None = None, *, metres: float = 1.0, turn: Array | None = None
) -> PlateParameters:
    """Return the parameters of plate ``number`` (from 1), those that are ``told`` instead of the file's.

    ``metres`` is the file's length unit in m, ``turn`` (3, 3) leads from file axes to the lab (None = they are the
    same): what is told in m and in the lab frame is turned into them.

    Raises
    ------
    TrialRefused
        An entry is missing, not finite or out of range, or the TYPE is not one that can be computed.
    """
    told, group = told or NOTHING_TOLD, raw.parameters.get("FORCE_PLATFORM", {})
    described = _numbers(group, "TYPE").size >= number
    kind = told.type or (int(_of_plate(group, "TYPE", (), number)) if described or not told.channels else _USUAL_TYPE)
    if kind not in CHANNELS_OF_TYPE:
        known = ", ".join(map(str, CHANNELS_OF_TYPE))
        what = f" ({_NAMES_OF_TYPE[kind]})" if kind in _NAMES_OF_TYPE else ""
        raise TrialRefused(f"TYPE {kind}{what} cannot be computed; legal are {known}. Export the plate as TYPE 2.")
    rows = _numbers(group, "CHANNEL", keep=True).shape[:1]
    listed = told.columns(raw.analog_labels) if told.channels else _of_plate(group, "CHANNEL", rows or (0,), number)
    channels = _channels(listed, kind, raw.analog.shape[1])
    if told.corners is None:
        corners = _of_plate(group, "CORNERS", (3, 4), number).T
    else:
        corners = told.corners @ (np.eye(3) if turn is None else turn) / metres
    if told.origin is None:
        origin = _of_plate(group, "ORIGIN", (3,), number) if described else np.zeros(3)
    else:
        origin = told.origin / metres
    calibration = _calibration(group, kind, number) if told.sensitivity is None else told.sensitivity
    _refuse_shape(calibration, kind)
    return PlateParameters(number, kind, channels, corners, origin, calibration, _polynomial(group, number), told)


def _refuse_shape(calibration: Array | None, kind: int) -> None:
    """Refuse a sensitivity that does not fit the TYPE of the plate."""
    need = (len(CONTENT[kind]), CHANNELS_OF_TYPE[kind])
    if calibration is not None and calibration.shape != need:
        raise TrialRefused(
            f"the sensitivity in session.toml has the shape {calibration.shape}, TYPE {kind} needs {need}. Give the "
            f"type, too, or correct it."
        )


def _channels(listed: Array, kind: int, available: int) -> tuple[int, ...]:
    """Return the columns (from 0) of the plate's channels after checking their number and range."""
    need = CHANNELS_OF_TYPE[kind]
    if listed.size < need:
        raise TrialRefused(
            f"CHANNEL lists {listed.size} channels, TYPE {kind} needs {need}. Correct the file or export it again."
        )
    used = listed[:need]
    bad = [f"{c:g}" for c in used if c != round(c) or not 1 <= c <= available]
    if bad:
        raise TrialRefused(
            f"CHANNEL names analog channel {', '.join(bad)}, but the file holds {available} channels (legal: 1 to "
            f"{available}). Export it again."
        )
    if len(set(used)) < need:
        raise TrialRefused(
            f"CHANNEL names an analog channel twice: {', '.join(f'{c:g}' for c in used)}. Correct the file."
        )
    return tuple(int(c) - 1 for c in used)


def _calibration(group: Mapping[str, Any], kind: int, number: int) -> Array | None:
    """Return CAL_MATRIX (stored by columns unless MATRIX_STORE says BYROW); None for types without one."""
    if kind not in _MATRIX_OF_TYPE:
        return None
    rows, columns = _MATRIX_OF_TYPE[kind]
    stored = _numbers(group, "CAL_MATRIX", keep=True)
    by_row = "BYROW" in "".join(str(text) for text in group.get("MATRIX_STORE", [])).replace(" ", "").upper()
    shape = stored.shape[:2] if stored.ndim >= 2 else (rows, columns)
    if not stored.size or shape[0] < rows or shape[1] < columns:
        found = " x ".join(map(str, stored.shape)) if stored.size else "nothing"
        raise TrialRefused(
            f"TYPE {kind} needs a CAL_MATRIX of {rows} x {columns}, the file holds {found}. Export the plate with its "
            f"calibration matrix or as TYPE 2."
        )
    matrix = _of_plate(group, "CAL_MATRIX", shape, number)
    matrix = (matrix.T if by_row and shape[0] == shape[1] else matrix)[:rows, :columns]
    if not matrix.any(axis=1).all():
        raise TrialRefused(
            f"CAL_MATRIX holds a row of zeros; legal is a full {rows} x {columns} matrix. Enter the calibration sheet "
            f"again."
        )
    return matrix


def _polynomial(group: Mapping[str, Any], number: int) -> Array | None:
    """Return Kistler's FPCOPPOLY (2, 6), stored as 2 x 6 or 6 x 2; None if there is none or only zeros."""
    stored = _numbers(group, "FPCOPPOLY")
    if stored.size < 12 * number:
        return None
    block = stored[12 * (number - 1) : 12 * number]
    if not np.isfinite(block).all() or not block.any():
        return None
    by_term = _numbers(group, "FPCOPPOLY", keep=True).shape[0] == 2
    return block.reshape(2, 6, order="F") if by_term else block.reshape(6, 2, order="F").T


def _numbers(group: Mapping[str, Any], name: str, *, keep: bool = False) -> Array:
    """Return a parameter's floats in the file's order (``keep``: in its dimensions); empty if missing or text."""
    value = group.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iufb":
        return np.empty(0)
    return value.astype(float) if keep else value.astype(float).ravel(order="F")


def _of_plate(group: Mapping[str, Any], name: str, shape: tuple[int, ...], number: int) -> Array:
    """Return the block of ``shape`` that belongs to plate ``number``; TrialRefused if it is missing or not finite."""
    values = _numbers(group, name)
    size = int(np.prod(shape, dtype=int))
    block = values[size * (number - 1) : size * number]
    if not size or block.size < size:
        held = values.size // size if size else 0
        raise TrialRefused(
            f"FORCE_PLATFORM:{name} holds values for {held} plates, none for this one. Correct USED, export it again, "
            f"or say it in session.toml: [plates.plate{number}]."
        )
    if not np.isfinite(block).all():
        raise TrialRefused(
            f"FORCE_PLATFORM:{name} holds a value that is not a number. Correct the file or export it again."
        )
    return block.reshape(shape, order="F")


POUND, KILOGRAM_FORCE, INCH = 4.4482216152605, STANDARD_GRAVITY, 0.0254
FORCE = {
    **dict.fromkeys(("n", "newton", "newtons", "nt"), 1.0),
    "kn": 1000.0,
    **dict.fromkeys(("lbf", "lb", "lbs", "pound", "pounds"), POUND),
    **dict.fromkeys(("kgf", "kp"), KILOGRAM_FORCE),
}
_LENGTH = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH, "inch": INCH, "inches": INCH, "ft": 12 * INCH}
MOMENT = {force + length: f * s for force, f in FORCE.items() for length, s in _LENGTH.items()} | {
    length + force: f * s for force, f in FORCE.items() for length, s in _LENGTH.items() if force != "n"
}
"""N·m per unit, for unit texts without blanks and signs: ``nmm``, ``inlb``, ``lbfft`` ..."""
CONTENT = {1: "FFFLLM", 2: "FFFMMM", 3: "FFFFFFFF", 4: "FFFMMM", 5: "FFFMMM", 6: "F" * 12, 7: "F" * 8}
"""What each channel (after the calibration matrix) holds: F force, M moment, L length."""
TABLES = {"F": FORCE, "M": MOMENT, "L": _LENGTH}
_WORDS = {"F": "force", "M": "moment", "L": "length"}


def plain_unit(text: str) -> str:
    """Return a unit text in lower case without blanks, dots, dashes and stars: ``N.mm`` and ``N-mm`` become ``nmm``."""
    return re.sub(r"[\s.\-*·⋅/_()]", "", text).lower()


def unit_factors(
    plate: PlateParameters, units: tuple[str, ...], *, metres: float
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Return the factor to SI of each channel of a plate (after the calibration matrix) and what was decided about the
    units.

    ``units`` are the texts of the plate's channels, ``metres`` is the length unit of the file in m. The output of a
    calibration matrix is in N and N times the file's length unit, as C3D demands. A unit that is missing or makes no
    sense for the channel is taken as N, N times the file's length unit, or the file's length unit, and said.
    """
    content = CONTENT[plate.type]
    assumed = {"F": 1.0, "M": metres, "L": metres}
    if plate.told.sensitivity is not None:
        given = f"Units: channels in {_listed(units)} times the sensitivity in session.toml give N and N·m."
        return (1.0,) * len(content), (given,)
    if plate.type in _MATRIX_OF_TYPE:
        return tuple(assumed[c] for c in content), (
            f"Units: channels in {_listed(units)} times CAL_MATRIX give N and N x {metres:g} m.",
        )
    factors, strange = [], {}
    for kind, unit in zip(content, units, strict=True):
        known = TABLES[kind].get(plain_unit(unit))
        factors.append(assumed[kind] if known is None else known)
        if known is None:
            strange[kind] = unit
    said = [f"Units: {_listed(units)}."]
    for kind, unit in strange.items():
        taken = {"F": "N", "M": f"N x {metres:g} m", "L": f"{metres:g} m"}[kind]
        said.append(f"Unit {unit!r} of a {_WORDS[kind]} channel says nothing; it was taken as {taken}.")
    return tuple(factors), tuple(said)


def _listed(units: tuple[str, ...]) -> str:
    """Return the different unit texts in order, for a sentence."""
    return ", ".join(dict.fromkeys(unit or "(none)" for unit in units))

"""What a C3D file says of its force plates (group FORCE_PLATFORM, labels and units of the analog channels), and what
session.toml says instead (`ToldPlate`), which comes first; no sample is looked at yet.

Sources: C3D user guide, FORCE_PLATFORM; Visual3D documentation, force platform types 5-7; Kistler 9287C manual, 8.4.3
(FPCOPPOLY).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from biodance.errors import TrialRefused, did_you_mean
from biodance.lab.c3d.raw import RawC3d
from biodance.records import Array
from biodance.settings import STANDARD_GRAVITY


@dataclass(frozen=True)
class PlateType:
    """What the outputs of a plate of one TYPE hold: its channels, or with a calibration matrix of so many ``inputs``
    what that makes of them.

    ``outputs`` by name: ``fx`` a force in N, ``mx`` a moment about the sensor in N·m, ``tz`` a free moment, ``px`` the
    place of the pressure in m. Of four sensors at (a, b), (-a, b), (-a, -b), (a, -b), ``fz2`` is the force in the
    second and ``fx12`` that in the first and second together.

    From the names follow how many analog ``channels`` there are, the ``content`` of the outputs (F force, M moment, L
    length), the ``vertical`` ones whose sum is the force along the plate's z, whether ORIGIN holds a, b and depth of
    ``four_sensors``, and whether the point ``on_surface`` is told at which the force acts.
    """

    outputs: tuple[str, ...]
    inputs: int
    channels: int
    content: str
    vertical: tuple[int, ...]
    four_sensors: bool
    on_surface: bool


def plate_type(*outputs: str, inputs: int = 0) -> PlateType:
    """Return the type of a plate with these outputs, and with a calibration matrix if it has ``inputs``."""
    content = "".join({"f": "F", "p": "L"}.get(name[0], "M") for name in outputs)
    vertical = tuple(column for column, name in enumerate(outputs) if name.startswith("fz"))
    sensors, point = outputs[0][-1].isdigit(), "L" in content
    return PlateType(outputs, inputs, inputs or len(outputs), content, vertical, sensors, point)


_SIX = ("fx", "fy", "fz", "mx", "my", "mz")
_EIGHT = ("fx12", "fx34", "fy14", "fy23", "fz1", "fz2", "fz3", "fz4")
PLATE_TYPES = {
    1: plate_type("fx", "fy", "fz", "px", "py", "tz"),
    2: plate_type(*_SIX),
    3: plate_type(*_EIGHT),
    4: plate_type(*_SIX, inputs=6),
    5: plate_type(*_SIX, inputs=8),
    6: plate_type(*(f"f{axis}{sensor}" for sensor in "1234" for axis in "xyz"), inputs=12),
    7: plate_type(*_EIGHT, inputs=8),
}
"""The TYPEs of the C3D standard that can be computed."""
_NAMES_OF_TYPE = {8: "not defined", **dict.fromkeys((11, 12), "a Kistler split-belt treadmill"), 21: "AMTI stairs"}


POUND, INCH = 4.4482216152605, 0.0254
FORCE = {
    **dict.fromkeys(("n", "newton", "newtons", "nt"), 1.0),
    "kn": 1000.0,
    **dict.fromkeys(("lbf", "lb", "lbs", "pound", "pounds"), POUND),
    **dict.fromkeys(("kgf", "kp"), STANDARD_GRAVITY),
}
_LENGTH = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH, "inch": INCH, "inches": INCH, "ft": 12 * INCH}
MOMENT = {force + length: f * s for force, f in FORCE.items() for length, s in _LENGTH.items()} | {
    length + force: f * s for force, f in FORCE.items() for length, s in _LENGTH.items() if force != "n"
}
"""N·m per unit, for unit texts without blanks and signs: ``nmm``, ``inlb``, ``lbfft`` ..."""

C3D_ONLY = ("type", "channels", "sensitivity", "origin_m")
"""What of a plate only a reader of its channels can follow."""


@dataclass(frozen=True, eq=False)
class ToldPlate:
    """What is said of one plate; None = nothing, the file decides.

    ``corners`` (4, 3) m in the lab frame (z up, as `inspect` shows them), in the order +x+y, -x+y, -x-y, +x-y of the
    plate axes; ``type`` of the C3D standard; ``channels`` labels, or numbers from 1; ``sensitivity`` (rows, channels)
    N and N·m per unit of a channel as the file gives it; ``origin`` (3,) m from the sensor to the centre of the
    surface, plate axes; ``foot`` that stands on it, "" = as the markers show; ``use`` False leaves the plate out.
    """

    corners: Array | None = None
    type: int | None = None
    channels: tuple[str | int, ...] | None = None
    sensitivity: Array | None = None
    origin: Array | None = None
    foot: str = ""
    use: bool = True

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of session.toml that say something of what the plate measures and where."""
        said = {
            "corners_m": self.corners,
            "type": self.type,
            "channels": self.channels,
            "sensitivity": self.sensitivity,
            "origin_m": self.origin,
            "foot": self.foot or None,
        }
        return tuple(key for key, value in said.items() if value is not None)

    @property
    def sentence(self) -> str:
        """What is taken from session.toml, for the history; "" for nothing."""
        return f"{', '.join(self.keys)} as session.toml says." if self.keys else ""


NOTHING_TOLD = ToldPlate()


@dataclass(frozen=True, eq=False)
class Told:
    """What the analyst says to readers of forces: ``plates`` by name, declared body ``mass`` kg or None."""

    plates: Mapping[str, ToldPlate] = field(default_factory=lambda: MappingProxyType({}))
    mass: float | None = None


@dataclass(frozen=True, eq=False)
class PlateParameters:
    """One plate as the file describes it, in file units and file axes.

    ``number`` from 1; ``type`` of the C3D standard; ``channels`` columns of the analog data, from 0; ``corners`` (4, 3)
    and ``origin`` (3,) in the file's length unit, the corners in file axes, ORIGIN in plate axes; ``factors`` SI unit
    per unit of each channel, after the calibration matrix where there is one; ``units_said`` what was decided about the
    units, more than one sentence where the file does not say one of them; ``zero`` FORCE_PLATFORM:ZERO as written,
    first and last sample from 1, None if it is missing or not two numbers; ``calibration`` (rows, columns), output =
    calibration @ channels: N, and N times the file's length unit (that of session.toml gives N and N·m), None where the
    type has none; ``polynomial`` (2, 6) Kistler's correction of the centre of pressure in millimetres, None = none;
    ``told`` what of it session.toml says.
    """

    number: int
    type: int
    channels: tuple[int, ...]
    corners: Array
    origin: Array
    factors: tuple[float, ...]
    units_said: tuple[str, ...]
    zero: tuple[int, int] | None = None
    calibration: Array | None = None
    polynomial: Array | None = None
    told: ToldPlate = NOTHING_TOLD

    @property
    def name(self) -> str:
        """The lab's name of the plate, ``plate1`` ..."""
        return f"plate{self.number}"


def declared_plates(
    raw: RawC3d, told: Mapping[str, ToldPlate], *, metres: float, turn: Array
) -> tuple[list[PlateParameters], dict[int, str], tuple[str, ...], tuple[str, ...]]:
    """Return the plates of the file and those whose channels ``told`` names, without those that are not to be used; the
    reason by number why others are refused; what a person should look at; what was decided without doubt.

    ``told`` by the plate's name; ``metres`` is the file's length unit in m, ``turn`` (3, 3) leads from file axes to the
    lab.
    """
    count, warnings = count_plates(raw)
    more = {int(name.removeprefix("plate")): one for name, one in told.items()}
    if not count and not warnings and not more:
        warnings = _undescribed_plates(raw)
    if raw.analog.size:
        warnings += _without_channels(more, count)
    unused = [n for n, one in more.items() if not one.use]
    numbers = sorted({*range(1, count + 1), *(n for n, one in more.items() if one.channels)} - set(unused))
    history = tuple(f"plate{n} was left out, as session.toml says." for n in unused if n <= count)
    lacks = "" if raw.analog_rate > 0 else f"has the analog rate {raw.analog_rate:g}"
    lacks = lacks if raw.analog.shape[0] else "holds no analog samples"
    if numbers and lacks:
        declared = f"The file declares {len(numbers)} force plates but {lacks}: no plate was read."
        return [], {}, (*warnings, f"{declared} Export it with the analog data."), history
    plates, refused = [], {}
    for number in numbers:
        try:
            plates.append(plate_parameters(raw, number, more.get(number), metres=metres, turn=turn))
        except TrialRefused as error:
            refused[number] = str(error)
    return plates, refused, warnings, history


def _without_channels(told: Mapping[int, ToldPlate], count: int) -> tuple[str, ...]:
    """Return a sentence for every plate of session.toml beyond the file's ``count`` that is to be used without one."""
    return tuple(
        f"Plate {n} of session.toml is none of the file's {count} plates. Give its channels in [plates.plate{n}], or "
        f"take it away."
        for n, one in told.items()
        if n > count and one.use and not one.channels
    )


def count_plates(raw: RawC3d) -> tuple[int, tuple[str, ...]]:
    """Return how many plates the file declares, and a sentence where its counts contradict each other."""
    group = raw.parameters.get("FORCE_PLATFORM", {})
    types = _numbers(group, "TYPE").size
    used = _numbers(group, "USED")
    if not used.size:
        if not types and not _numbers(group, "CHANNEL").size:
            # another name of the group is damage, which must not pass in silence
            other = [name for name, held in raw.parameters.items() if {"CORNERS", "ORIGIN", "CHANNEL"} <= held.keys()]
            said = (
                f"The group {', '.join(other[:1])} holds CORNERS, ORIGIN and CHANNEL of force plates but is not called "
                f"FORCE_PLATFORM: no plate was read. Rename the group, or copy the file again from its source."
            )
            return 0, (said,) if other and "FORCE_PLATFORM" not in other else ()
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


def plate_parameters(
    raw: RawC3d, number: int, told: ToldPlate | None = None, *, metres: float, turn: Array | None = None
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
    # Three forces and three moments: taken for channels of which nothing else is said
    kind = told.type or (int(_of_plate(group, "TYPE", (), number)) if described or not told.channels else 2)
    if kind not in PLATE_TYPES:
        known = ", ".join(map(str, PLATE_TYPES))
        what = f" ({_NAMES_OF_TYPE[kind]})" if kind in _NAMES_OF_TYPE else ""
        raise TrialRefused(f"TYPE {kind}{what} cannot be computed; legal are {known}. Export the plate as TYPE 2.")
    if told.channels:
        listed = _told_columns(told.channels, raw.analog_labels)
    else:
        rows = _numbers(group, "CHANNEL", keep=True).shape[:1]  # 6, 8 or 12 channels a plate, as the file has it
        listed = _of_plate(group, "CHANNEL", rows or (0,), number)
    channels = _channels(listed, kind, raw.analog.shape[1])
    if told.corners is None:
        corners = _of_plate(group, "CORNERS", (3, 4), number).T
    else:
        # v @ R is R'v: from the lab to the file's axes, then into its unit.
        corners = told.corners @ (np.eye(3) if turn is None else turn) / metres
    if told.origin is None:
        origin = _of_plate(group, "ORIGIN", (3,), number) if described else np.zeros(3)
    else:
        origin = told.origin / metres
    calibration = _calibration(group, kind, number) if told.sensitivity is None else told.sensitivity
    need = (len(PLATE_TYPES[kind].outputs), PLATE_TYPES[kind].channels)
    if told.sensitivity is not None and told.sensitivity.shape != need:
        raise TrialRefused(
            f"the sensitivity in session.toml has the shape {told.sensitivity.shape}, TYPE {kind} needs {need}. Give "
            f"the type, too, or correct it."
        )
    factors, units_said = _unit_factors(kind, told, [raw.analog_units[c] for c in channels], metres)
    window = _numbers(group, "ZERO")[:2]
    zero = (int(window[0]), int(window[1])) if window.size == 2 and np.isfinite(window).all() else None
    where = (corners, origin, factors, units_said, zero)
    return PlateParameters(number, kind, channels, *where, calibration, _polynomial(group, number), told)


def _told_columns(channels: Sequence[str | int], labels: tuple[str, ...]) -> Array:
    """Return the channels that session.toml names as numbers (n,) from 1 among the ``labels`` of the file."""
    plain = [label.strip().casefold() for label in labels]
    named = [label for label in labels if label]
    found = []
    for channel in channels:
        if isinstance(channel, int) and channel <= len(labels):
            found.append(channel)
        elif isinstance(channel, str) and plain.count(channel.strip().casefold()) == 1:
            found.append(plain.index(channel.strip().casefold()) + 1)
        elif isinstance(channel, int) or not named:
            legal = f"but the file holds {len(labels)} channels (legal: 1 to {len(labels)})."
            raise TrialRefused(f"session.toml names channel {channel!r}, {legal}")
        elif plain.count(channel.strip().casefold()) > 1:
            raise TrialRefused(
                f"session.toml names channel {channel!r}, which is there more than once: give its number."
            )
        else:
            hint = did_you_mean(channel, named)
            legal = f"Legal: {', '.join(named[:24])}{' ...' * (len(named) > 24)}."
            raise TrialRefused(f"session.toml names channel {channel!r}, which the file does not have.{hint} {legal}")
    return np.array(found, dtype=float)


def _channels(listed: Array, kind: int, available: int) -> tuple[int, ...]:
    """Return the columns (from 0) of the plate's channels after checking their number and range."""
    need = PLATE_TYPES[kind].channels
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
    if not PLATE_TYPES[kind].inputs:
        return None
    rows, columns = len(PLATE_TYPES[kind].outputs), PLATE_TYPES[kind].inputs
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
    # Read by columns, as C3D stores them; written by rows it is the transpose.
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
    # Two rows first: one for x, one for y.
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
    # C3D stores the first index fastest.
    return block.reshape(shape, order="F")


def plain_unit(text: str) -> str:
    """Return a unit text in lower case without blanks, dots, dashes and stars: ``N.mm`` and ``N-mm`` become ``nmm``."""
    return re.sub(r"[\s.\-*·⋅/_()]", "", text).lower()


def _unit_factors(
    kind: int, told: ToldPlate, units: Sequence[str], metres: float
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Return the SI unit per unit of each channel (after the calibration matrix), and what was decided."""
    content = PLATE_TYPES[kind].content
    listed = ", ".join(dict.fromkeys(unit or "(none)" for unit in units))
    assumed, tables = {"F": 1.0, "M": metres, "L": metres}, {"F": FORCE, "M": MOMENT, "L": _LENGTH}
    if told.sensitivity is not None:
        given = f"Units: channels in {listed} times the sensitivity in session.toml give N and N·m."
        return (1.0,) * len(content), (given,)
    if PLATE_TYPES[kind].inputs:
        said = f"Units: channels in {listed} times CAL_MATRIX give N and N x {metres:g} m."
        return tuple(assumed[what] for what in content), (said,)
    factors, strange = [], {}
    for what, unit in zip(content, units, strict=True):
        known = tables[what].get(plain_unit(unit))
        factors.append(assumed[what] if known is None else known)
        if known is None:
            strange[what] = unit
    taken = {"F": ("force", "N"), "M": ("moment", f"N x {metres:g} m"), "L": ("length", f"{metres:g} m")}
    doubts = (
        f"Unit {unit!r} of a {taken[what][0]} channel says nothing; it was taken as {taken[what][1]}."
        for what, unit in strange.items()
    )
    return tuple(factors), (f"Units: {listed}.", *doubts)


def channel_groups(labels: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Return the columns (from 0) of every set of channels that are those of one plate: three forces and three moments,
    or the eight forces of a plate with four sensors, with the same text around them (``AMTI_1.FX``, ``Fx1``,
    ``Force.Fx1`` and ``Moment.Mx1``).
    """
    found: list[tuple[int, ...]] = []
    for parts, pattern in ((_EIGHT, r"(f[xy](?:12|34|14|23)|fz[1-4])"), (_SIX, r"([fm][xyz])")):
        plates: dict[str, dict[str, int]] = {}
        for column, label in enumerate(labels):
            plain = re.sub(r"force|moment|torque|[\s._+:-]", "", label, flags=re.IGNORECASE).lower()
            match = re.fullmatch(rf"(.*?){pattern}(\D?\d*)", plain)
            if match and not any(column in group for group in found):
                plates.setdefault(match[1] + "|" + match[3], {}).setdefault(match[2], column)
        found += [tuple(columns[part] for part in parts) for columns in plates.values() if set(parts) <= set(columns)]
    return tuple(sorted(found))


def _undescribed_plates(raw: RawC3d) -> tuple[str, ...]:
    """Say that channels of a file without described plates look like some; () if none do."""
    groups = channel_groups(raw.analog_labels)
    if not groups:
        return ()
    columns = [column for group in groups for column in group]
    units = ", ".join(dict.fromkeys(raw.analog_units[column] or "no unit" for column in columns))
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
    count = words[len(groups)] if len(groups) < len(words) else str(len(groups))
    names = f"{raw.analog_labels[columns[0]]} ... {raw.analog_labels[columns[-1]]}, in {units}"
    said = (
        f"{len(columns)} channels ({names}) look like {count} force plate{'s' * (len(groups) > 1)}, which the file "
        f"does not describe: no plate was read. Give geometry, channels and sensitivity in session.toml: corners_m, "
        f"channels and sensitivity in [plates.plate1] (docs/session_folder.md; `biodance init` begins it)."
    )
    return (said,)

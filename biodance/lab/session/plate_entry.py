"""The tables ``[plates.NAME]`` of session.toml: what they say, and how they are written for the plates of a session."""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.c3d.raw import RawC3d, read_raw
from biodance.lab.plates.corners import LONGEST_SIDE, SHORTEST_SIDE, ToldPlate, corners_in_lab
from biodance.lab.plates.decode import DEEPEST
from biodance.lab.plates.parameters import CHANNELS_OF_TYPE, CONTENT, channel_groups, plate_parameters
from biodance.lab.readers.c3d import file_frame
from biodance.records import Array, Plate, Session, Trial

_ORDER = "in the order +x+y, -x+y, -x-y, +x-y of the plate's own axes"


class PlateEntry(BaseModel):
    """One table ``[plates.NAME]``; None = not said. `told_plate` checks the numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    corners_m: Any = None
    type: Any = None
    channels: Any = None
    sensitivity: Any = None
    origin_m: Any = None
    foot: Literal["left", "right"] | None = None
    use: bool | None = None


def told_plate(name: str, entry: PlateEntry) -> ToldPlate:
    """Return what a table ``[plates.NAME]`` says.

    Raises
    ------
    SessionRefused
        There is no such plate, or a value is not legal; the message says what would be.
    """
    if not re.fullmatch(r"plate[1-9]\d?", name):
        raise SessionRefused(f"[plates.{name}] is no plate. Legal names are plate1, plate2 ..., as inspect shows them.")
    where = f"[plates.{name}]"
    kind = _type(entry.type, where)
    channels = _channels(entry.channels, kind, where)
    return ToldPlate(
        corners=_corners(entry.corners_m, where),
        type=kind,
        channels=channels,
        sensitivity=_sensitivity(entry.sensitivity, kind, channels, where),
        origin=_origin(entry.origin_m, where),
        foot=entry.foot or "",
        use=entry.use is not False,
    )


def _numbers(value: Any, where: str, legal: str) -> Array:
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)
    if not np.isfinite(numbers).all():
        raise SessionRefused(f"{where} = {value!r} is not legal. Write {legal}.")
    return numbers


def _corners(value: Any, where: str) -> Array | None:
    if value is None:
        return None
    legal = f"four points [x, y, z] in m in the lab frame (z up), {_ORDER}"
    corners = _numbers(value, f"{where} corners_m", legal)
    if corners.shape != (4, 3):
        raise SessionRefused(f"{where} corners_m has the shape {corners.shape}. Write {legal}.")
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    if not SHORTEST_SIDE <= sides.min() <= sides.max() <= LONGEST_SIDE:
        raise SessionRefused(
            f"{where} corners_m make a plate with sides of {sides.min():.3g} to {sides.max():.3g} m; legal are "
            f"{SHORTEST_SIDE:g} to {LONGEST_SIDE:g} m. Write {legal}."
        )
    try:
        return corners_in_lab(corners, metres=1.0, turn=np.eye(3))[0]
    except TrialRefused as error:
        said = str(error).replace("CORNERS", "corners_m").replace("FORCE_PLATFORM:corners_m", "corners_m")
        raise SessionRefused(f"{where} {said}") from None


def _type(value: Any, where: str) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or value not in CHANNELS_OF_TYPE:
        legal = ", ".join(map(str, CHANNELS_OF_TYPE))
        raise SessionRefused(f"{where} type = {value!r} is not legal. Legal are the TYPEs {legal} of the C3D standard.")
    return int(value)


def _channels(value: Any, kind: int | None, where: str) -> tuple[str | int, ...] | None:
    if value is None:
        return None
    legal = 'labels or numbers of analog channels, from 1: ["Fx1", "Fy1", ...] or [1, 2, 3, 4, 5, 6]'
    listed = value if isinstance(value, list) else [None]
    channels: list[Any] = [int(c) if isinstance(c, float) and c == round(c) and c >= 1 else c for c in listed]
    if not all((isinstance(c, str) and c.strip()) or (type(c) is int and c >= 1) for c in channels):
        raise SessionRefused(f"{where} channels = {value!r} is not legal. Write {legal}.")
    counts = {CHANNELS_OF_TYPE[kind]} if kind else set(CHANNELS_OF_TYPE.values())
    if len(channels) not in counts or len(set(channels)) < len(channels):
        need = " or ".join(map(str, sorted(counts)))
        of = f" of TYPE {kind}" if kind else ""
        raise SessionRefused(f"{where} channels names {len(set(channels))} channels; a plate{of} has {need}.")
    return tuple(channels)


def _sensitivity(value: Any, kind: int | None, channels: tuple[str | int, ...] | None, where: str) -> Array | None:
    """Return the matrix (rows, channels) of a list of numbers, which is its diagonal, or of a list of rows."""
    if value is None:
        return None
    columns = CHANNELS_OF_TYPE[kind] if kind else len(channels or ()) or 6
    rows = len(CONTENT[kind]) if kind else columns
    legal = (
        f"one number for each channel ({columns}), or {rows} rows of {columns} numbers: N and N·m per unit of the "
        f"channel as the file gives it"
    )
    numbers = _numbers(value, f"{where} sensitivity", legal)
    matrix = np.diag(numbers) if numbers.ndim == 1 else numbers
    if matrix.shape != (rows, columns) or not matrix.any(axis=1).all():
        of = f" of TYPE {kind}" if kind else ""
        zero = " and holds a row of zeros" if matrix.shape == (rows, columns) else ""
        raise SessionRefused(f"{where} sensitivity has the shape {numbers.shape}{zero}; a plate{of} needs {legal}.")
    return matrix


def _origin(value: Any, where: str) -> Array | None:
    if value is None:
        return None
    legal = f"[x, y, z] in m from the sensor to the centre of the surface, z up to {DEEPEST:g} m, plate axes"
    origin = _numbers(value, f"{where} origin_m", legal)
    if origin.shape != (3,) or abs(origin[2]) > DEEPEST or np.abs(origin).max() > LONGEST_SIDE:
        raise SessionRefused(f"{where} origin_m = {value!r} is not legal. Write {legal}.")
    return origin


_WRITTEN_ORDER = "# m, lab frame, z up; +x+y, -x+y, -x-y, +x-y of the plate's own axes"


def plate_lines(session: Session) -> Iterator[str]:
    """Yield the tables of all plates of a session, every line with a # before it."""
    plates: dict[str, tuple[Plate, Trial]] = {}
    for trial in session.trials:
        for plate in trial.plates:
            plates.setdefault(plate.name, (plate, trial))
    hidden = None if plates else _undescribed(session)
    if not plates and hidden is None:
        return
    yield "# Force plates: what stands here comes before what the files say. Take the # from the table's name and from"
    yield "# what you correct."
    for plate, trial in plates.values():
        yield f"# [plates.{plate.name}] # as in {trial.name}"
        corners = [[round(float(x), 5) for x in corner] for corner in plate.corners]
        yield f"# corners_m = {json.dumps(corners)} {_WRITTEN_ORDER}"
        if plate.type:
            yield f"# type = {plate.type} # of the C3D standard"
            yield from _channel_lines(*plate_channels(plate, trial))
        yield from _use_lines()
    if hidden is None:
        return
    raw, groups = hidden
    for number, columns in enumerate(groups, start=1):
        yield f"# [plates.plate{number}] # its channels are in {raw.path.name}, which does not describe it"
        yield f"# corners_m = [[x, y, z], [x, y, z], [x, y, z], [x, y, z]] {_WRITTEN_ORDER}"
        yield f"# type = {2 if len(columns) == 6 else 3} # of the C3D standard"
        yield from _channel_lines([raw.analog_labels[column] for column in columns], (1.0,) * len(columns))
        yield from _use_lines()


def _undescribed(session: Session) -> tuple[RawC3d, tuple[tuple[int, ...], ...]] | None:
    """Return the first file with channels that look like plates, and their columns."""
    for trial in session.trials:
        if trial.source.format == "C3D":
            raw = read_raw(trial.source.path)
            if groups := channel_groups(raw.analog_labels):
                return raw, groups
    return None


def plate_channels(plate: Plate, trial: Trial) -> tuple[list[str | int], tuple[float, ...]]:
    """Return the labels (or numbers) of a plate's channels, and N or N·m per unit where there is no matrix."""
    if trial.source.format != "C3D":
        return [], ()
    raw = read_raw(trial.source.path)
    try:
        found = plate_parameters(raw, int(plate.name.removeprefix("plate")), metres=file_frame(raw)[0])
    except TrialRefused:
        return [], ()
    labels = [raw.analog_labels[column] for column in found.channels]
    told = all(label and raw.analog_labels.count(label) == 1 for label in labels)
    factors = () if found.calibration is not None else found.factors
    return [*labels] if told else [column + 1 for column in found.channels], factors


def _channel_lines(channels: Sequence[str | int], factors: tuple[float, ...]) -> Iterator[str]:
    if channels:
        yield f"# channels = {json.dumps(channels, ensure_ascii=False)} # labels, or numbers from 1"
    if factors:
        yield f"# sensitivity = {[*factors]} # N, N·m per unit of each channel as in the file; or rows of a matrix"


def _use_lines() -> Iterator[str]:
    yield '# foot = "left" # or "right", where the markers do not tell which foot stands on it'
    yield "# use = false # leaves the plate out"
    yield ""

"""``session.toml``: what the analyst says about the subject and the trials, with inheritance subject > session > trial.

```toml
[subject]
mass_kg = 66.2        # all keys may be left out
height_m = 1.75
sex = "F"             # or "M"
age = 33
name = "S01"

[trials."static*"]    # file name without extension, * and ? allowed; the exact name wins over a pattern
role = "static"       # static, fit, validate, check or skip

[settings]            # as `biodance settings` prints them
filter.cutoff = 6
```

``[markers] file = "my_set.toml"`` names the marker set that was worn (a set's name or a file, relative to this one);
``[markers] map = {LASI = "left_asis", BACK4 = "trunk_head"}`` says it here: which label is which landmark, or sits on
which segment.

``[subject] girths_cm = {thigh = 54, right_shank = 37}`` says how thick the person is (`lab.shape`),
``foot_outline = {length = 26, breadth = 10, heel_breadth = 7}`` (cm) or ``"feet.csv"`` how large the feet are
(`lab.shape`), ``scan = "body.obj"`` names the closed surface of the standing person, in m (``scan_up`` its axis
that points up, by default z).

``[plates.plate1]`` gives or corrects a force plate: ``corners_m``, ``type``, ``channels``, ``sensitivity``,
``origin_m``, the ``foot`` that stands on it, ``use = false``.

``[subject] prosthesis = "left_shank"`` says that this limb is a prosthesis from there on; ``[devices] right_shank =
0.6`` what is worn there in kg, on top of ``mass_kg`` (`worn`).

``[session]`` may say ``date`` (2026-03-05), ``lab``, ``operator`` and ``condition``.

A ``subject.toml`` or ``session.toml`` in the folder above (the subject's folder) has the same keys and fills in what
the session's own file leaves out.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date as day
from datetime import datetime
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from biodance.errors import BiodanceError, SessionRefused, TrialRefused
from biodance.lab.c3d.raw import RawC3d, read_raw
from biodance.lab.plates.corners import LONGEST_SIDE, SHORTEST_SIDE, Told, ToldPlate, corners_in_lab
from biodance.lab.plates.decode import DEEPEST
from biodance.lab.plates.parameters import CHANNELS_OF_TYPE, CONTENT, channel_groups, plate_parameters
from biodance.lab.readers.c3d import file_frame
from biodance.lab.session.worn import legal_devices, legal_prosthesis
from biodance.lab.shape import legal_girths, traced_outline, typed_outline
from biodance.library import read_toml
from biodance.records import Array, FootSizes, Plate, Role, Session, Trial
from biodance.records.attention import WARNING
from biodance.settings import USUAL, Settings

_ORDER = "in the order +x+y, -x+y, -x-y, +x-y of the plate's own axes"


class _PlateEntry(BaseModel):
    """One table ``[plates.NAME]``; None = not said. `_told_plate` checks the numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    corners_m: Any = None
    type: Any = None
    channels: Any = None
    sensitivity: Any = None
    origin_m: Any = None
    foot: Literal["left", "right"] | None = None
    use: bool | None = None


def _told_plate(name: str, entry: _PlateEntry) -> ToldPlate:
    """Return what a table ``[plates.NAME]`` says."""
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
            yield from _channel_lines(*_channels_line(plate, trial))
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


def _channels_line(plate: Plate, trial: Trial) -> tuple[list[str | int], tuple[float, ...]]:
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


FILES = ("subject.toml", "session.toml")


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class SubjectEntry(_Entry):
    """The table ``[subject]``; None = not said. The bounds catch grams, millimetres and centimetres."""

    mass_kg: Annotated[float, Field(ge=5, le=400)] | None = None
    height_m: Annotated[float, Field(ge=0.4, le=2.6)] | None = None
    sex: Literal["F", "M"] | None = None
    age: Annotated[float, Field(ge=0, le=120)] | None = None
    name: str | None = None
    girths_cm: dict[str, float] | None = None
    scan: str | None = None
    scan_up: Literal["z", "y", "x"] | None = None
    foot_outline: str | dict[str, float] | None = None
    prosthesis: str | None = None

    @property
    def girths(self) -> dict[str, float]:
        """Girths in m by name, checked when the file was read."""
        return legal_girths({name: value / 100 for name, value in (self.girths_cm or {}).items()})

    @property
    def outlines(self) -> dict[str, FootSizes]:
        """Outlines of the feet by side, checked when the file was read."""
        if isinstance(self.foot_outline, str):
            return traced_outline(self.foot_outline)
        return typed_outline({name: value / 100 for name, value in (self.foot_outline or {}).items()})


class _TrialEntry(_Entry):
    """One table ``[trials.NAME]``."""

    role: Role | None = None


class _MarkersEntry(_Entry):
    """The table ``[markers]``: the ``file`` (or name) of a set, or the ``map`` of labels to places."""

    file: str | None = None
    map: dict[str, str] | None = None


class VisitEntry(_Entry):
    """The table ``[session]``: when, where and by whom it was recorded."""

    date: str | datetime | day | None = None
    lab: str | None = None
    operator: str | None = None
    condition: str | None = None


class _Contents(_Entry):
    session: VisitEntry = VisitEntry()
    subject: SubjectEntry = SubjectEntry()
    markers: _MarkersEntry = _MarkersEntry()
    trials: dict[str, _TrialEntry] = {}
    plates: dict[str, _PlateEntry] = {}
    devices: dict[str, float] = {}
    settings: dict[str, Any] = {}


@dataclass(frozen=True)
class SessionFile:
    """What all files of the chain say together: ``subject``, ``trials`` by name or pattern (the innermost file first),
    ``read`` paths, ``visit`` when and where; ``settings`` with what ``[settings]`` changes; ``marker_set`` the name or
    file of the set that was worn, "" where none is said (see `read_marker_set`); ``plates`` by name;
    ``devices`` kg by segment.
    """

    subject: SubjectEntry = field(default_factory=SubjectEntry)
    trials: tuple[tuple[str, _TrialEntry], ...] = ()
    read: tuple[Path, ...] = field(default=())
    settings: Settings = USUAL
    marker_set: str = ""
    visit: VisitEntry = field(default_factory=VisitEntry)
    plates: Mapping[str, ToldPlate] = field(default_factory=dict)
    devices: Mapping[str, float] = field(default_factory=dict)

    @property
    def told(self) -> Told:
        """What readers of forces must know."""
        return Told(self.plates, self.subject.mass_kg)

    def role(self, name: str) -> Role | None:
        """Return the role of a trial: by its exact name, else by the first pattern; case does not count."""
        exact = [entry.role for key, entry in self.trials if key.lower() == name.lower()]
        similar = [entry.role for key, entry in self.trials if fnmatchcase(name.lower(), key.lower())]
        return next((role for role in exact + similar if role), None)

    def unused(self, names: list[str]) -> list[str]:
        """Return the keys of ``[trials]`` that fit no trial, each with the closest name: most often a slip of the
        pen. A pattern (``squat*``) is for what there may be.
        """
        said = []
        for key, _ in self.trials:
            if not set(key) & set("*?[") and not any(fnmatchcase(name.lower(), key.lower()) for name in names):
                close = get_close_matches(key, names, n=1)
                hint = f" Did you mean {close[0]!r}?" if close else ""
                said.append(f"{WARNING}[trials.{key}] fits no recording of the session.{hint}")
        return said

    def unused_plates(self, names: set[str]) -> list[str]:
        """Return a sentence for each ``[plates.NAME]`` that fits none of the plates that were read."""
        idle = [name for name, plate in self.plates.items() if plate.use and name not in names]
        legal = f"The plates read are {', '.join(sorted(names))}." if names else "No plate was read."
        return [f"{WARNING}[plates.{name}] fits no plate of the session. {legal}" for name in idle]


def read_session_file(folder: Path) -> SessionFile:
    """Return what ``session.toml`` (and ``subject.toml`` or ``session.toml`` in the folder above) says; empty where
    there is none.

    Raises
    ------
    SessionRefused
        A file is not TOML, has an unknown key (the closest legal one is named) or a value out of bounds.
    """
    folder = folder.resolve()
    paths = [place / name for place in (folder.parent, folder) for name in FILES if (place / name).is_file()]
    contents = [_read(path) for path in paths]
    said: dict[str, Any] = {}
    visit: dict[str, Any] = {}
    plates: dict[str, _PlateEntry] = {}
    for content in contents:
        plates |= {name: _over(plates.get(name), entry) for name, entry in content.plates.items()}
        said |= content.subject.model_dump(exclude_none=True)
        visit |= content.session.model_dump(exclude_none=True)
    trials = tuple((key, entry) for content in reversed(contents) for key, entry in content.trials.items())
    worn = [name for path, content in zip(paths, contents, strict=True) if (name := _marker_set(path, content.markers))]
    settings, marker_set = _settings(paths, contents), (worn or [""])[-1]
    told = {name: _told_plate(name, entry) for name, entry in plates.items()}
    worn_kg = {segment: mass for content in contents for segment, mass in content.devices.items()}
    subject, day_of = SubjectEntry(**said), VisitEntry(**visit)
    return SessionFile(subject, trials, tuple(paths), settings, marker_set, day_of, told, worn_kg)


def _over(earlier: _PlateEntry | None, entry: _PlateEntry) -> _PlateEntry:
    """Return what an inner file says of a plate, filled in by an outer one."""
    said = earlier.model_dump(exclude_none=True) if earlier is not None else {}
    return _PlateEntry(**{**said, **entry.model_dump(exclude_none=True)})


def _settings(paths: list[Path], contents: list[_Contents]) -> Settings:
    """Return the settings with what the files change, the innermost file last."""
    settings = USUAL
    for path, content in zip(paths, contents, strict=True):
        try:
            settings = settings.changed(content.settings)
        except BiodanceError as error:
            raise SessionRefused(f"{path}: [settings] {error}") from None
    return settings


def _marker_set(path: Path, said: _MarkersEntry) -> str:
    """Return a known set's name, a set file's path, or the file's own path for a map; "" where it says none."""
    if said.file is not None and said.map is not None:
        raise SessionRefused(f"{path}: [markers] has both file and map. Keep one of the two.")
    if said.map is not None:
        return str(path)
    return str(path.parent / said.file) if said.file and said.file.endswith(".toml") else said.file or ""


def _read(path: Path) -> _Contents:
    raw = read_toml(path)
    try:
        found = _beside(path, _Contents.model_validate(_whole_numbers_are_numbers(raw)))
        _ = found.subject.girths, found.subject.outlines
    except SessionRefused as error:
        raise SessionRefused(f"{path}: [subject] {error}") from None
    except ValidationError as error:
        raise SessionRefused(" ".join(_sentence(path, fault) for fault in error.errors())) from None
    try:
        _ = [_told_plate(name, entry) for name, entry in found.plates.items()]
        _ = legal_prosthesis(found.subject.prosthesis), legal_devices(found.devices)
    except SessionRefused as error:
        raise SessionRefused(f"{path}: {error}") from None
    return found


def _beside(path: Path, found: _Contents) -> _Contents:
    """Return the contents with the files that the subject's table names as paths from where we stand."""
    subject = found.subject
    files = {"scan": subject.scan, "foot_outline": subject.foot_outline}
    placed = {name: str(path.parent / said) for name, said in files.items() if isinstance(said, str)}
    if subject.scan is not None and not Path(placed["scan"]).is_file():
        raise SessionRefused(f"scan: there is no file {placed['scan']}. Check the path, relative to {path.name}.")
    return found.model_copy(update={"subject": subject.model_copy(update=placed)})


def _whole_numbers_are_numbers(raw: Any) -> Any:
    """Return the tables with 70 as 70.0: strict pydantic keeps text and truth apart from numbers."""
    if isinstance(raw, dict):
        return {key: _whole_numbers_are_numbers(value) for key, value in raw.items()}
    return float(raw) if isinstance(raw, int) and not isinstance(raw, bool) else raw


def _sentence(path: Path, fault: Any) -> str:
    """Return one fault that pydantic found as a sentence for the analyst."""
    *table, key = (str(part) for part in fault["loc"]) if fault["loc"] else ("",)
    where = f"[{'.'.join(table)}]" if table else "the top level"
    if fault["type"] == "extra_forbidden":
        legal = list(_TABLES.get(table[0] if table else "", _Contents).model_fields)
        close = get_close_matches(key, legal, n=1, cutoff=0.3)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        return f"{path}: {where} has the unknown key {key!r}.{hint} Legal: {', '.join(legal)}."
    wrong = f"{path}: {key} = {fault['input']!r} in {where} is not legal: {fault['msg'][0].lower()}{fault['msg'][1:]}."
    return f"{wrong} {_HELP.get(key, '')}".rstrip()


_TABLES: dict[str, type[BaseModel]] = {
    "session": VisitEntry,
    "subject": SubjectEntry,
    "trials": _TrialEntry,
    "markers": _MarkersEntry,
    "plates": _PlateEntry,
}
_HELP = {
    "mass_kg": "Give the body mass in kg.",
    "height_m": "Give the stature in m.",
    "sex": 'Write "F" or "M".',
    "age": "Give the age in years.",
    "girths_cm": "Write {thigh = 54, right_shank = 37}, in cm.",
    "scan": 'Write the path of a mesh, for example "body.obj".',
    "scan_up": 'Write the axis of the scan that points up: "z", "y" or "x".',
    "prosthesis": 'Write the segment that it begins with, for example "left_shank".',
    "foot_outline": "Write {length = 26, breadth = 10, heel_breadth = 7} in cm, or the path of a CSV file.",
    "file": 'Write the path of a marker set, for example "my_set.toml".',
    "map": 'Write {LABEL = "left_asis", ...}.',
    "foot": 'Write "left" or "right"; leave it out where both stand on the plate.',
    "use": "Write false to leave the plate out.",
    "role": f"Legal are {', '.join(get_args(Role))}.",
}

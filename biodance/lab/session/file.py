"""``session.toml``: what the analyst says about the subject, the trials, markers and plates, key by key as
docs/session_folder.md tells it.

The exact name of a trial wins over a pattern. A ``subject.toml`` or ``session.toml`` in the folder above (the subject's
folder) has the same keys and fills in what the session's own file leaves out.
"""

import csv
import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date as day
from datetime import datetime
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator, model_validator

from biodance.errors import BiodanceError, SessionRefused, did_you_mean
from biodance.lab.markers.sets import parse_map
from biodance.lab.plain_text import read_text
from biodance.lab.plates import Told, ToldPlate
from biodance.lab.session.entries import (
    PlateEntry,
    TrialParts,
    legal_events,
    legal_exchanges,
    legal_spans,
    refuse_devices,
    refuse_prosthesis,
    told_plate,
)
from biodance.library import locate, parse_toml, read_toml
from biodance.records import SIDES, Array, FootSizes, Role
from biodance.records.attention import Doubt
from biodance.settings import USUAL, Settings

_ALIASES = {"calf": "shank"}  # What else a girth is called


@functools.cache
def usual_girths() -> Mapping[str, float]:
    """Return the usual girth of an adult in m, by name, the sexes' mean."""
    with locate("anthropometry/human", "girths", ".csv").open(encoding="utf-8") as file:
        found = {row["girth"]: (float(row["F"]) + float(row["M"])) / 2 for row in csv.DictReader(file)}
    return MappingProxyType(found)


def legal_girths(given: Mapping[str, float]) -> dict[str, float]:
    """Return girths (m) by name: ``thigh`` of both sides, ``right_thigh`` of one; a calf is the girth of the shank.

    Raises
    ------
    SessionRefused
        A name is not known, stands for two entries, has a side that it cannot have, or the value is no person's.
    """
    found: dict[str, float] = {}
    for said, value in given.items():
        side = next((f"{side}_" for side in SIDES if said.startswith(f"{side}_")), "")
        short = said.removeprefix(side)
        name = _ALIASES.get(short, short)
        if name not in usual_girths() or (side and name in ("hip", "waist", "chest", "neck", "head")):
            legal = (*usual_girths(), *_ALIASES)
            raise SessionRefused(
                f"girths_cm: there is no girth {said!r}.{did_you_mean(said, legal)} Legal: {', '.join(legal)}; "
                "with right_ or left_ before those of arms and legs."
            )
        if f"{side}{name}" in found:
            raise SessionRefused(f"girths_cm: {side}{name} is given twice (also as {said!r}). Keep one of the two.")
        usual = usual_girths()[name]
        low, high = 0.4 * usual, 2.2 * usual
        if not low <= value <= high:  # another unit, or a slip of the pen
            units = {"mm": value / 10, "m": value * 100, "inch": value * 2.54}
            unit = next((unit for unit, one in units.items() if 0.6 * usual <= one <= 1.6 * usual), "")
            hint = f" It looks like {unit}: write {100 * units[unit]:.1f}." if unit else " Measure again, in cm."
            legal_cm = f"{100 * low:.0f} to {100 * high:.0f} cm"
            raise SessionRefused(f"girths_cm: {said} = {100 * value:g} cm is no person's. Legal: {legal_cm}.{hint}")
        found[f"{side}{name}"] = float(value)
    return found


_LEGAL_SIZES = {"length": (0.12, 0.36), "breadth": (0.05, 0.15), "heel_breadth": (0.03, 0.11)}  # m


def typed_outline(given: Mapping[str, float]) -> dict[str, FootSizes]:
    """Return the outline of each foot from sizes in m: ``length`` of both or ``right_length`` of one foot.

    Raises
    ------
    SessionRefused
        A name is not known, a value is no foot's, or a foot misses a size.
    """
    for name, value in given.items():
        short = next((name.removeprefix(f"{side}_") for side in SIDES if name.startswith(f"{side}_")), name)
        if short not in _LEGAL_SIZES:
            raise SessionRefused(
                f"foot_outline: there is no size {name!r}. Legal: {', '.join(_LEGAL_SIZES)}, with right_ or left_ "
                "before for one foot."
            )
        _refuse_impossible_size(name, value, short)
    found: dict[str, FootSizes] = {}
    for side in SIDES if given else ():
        sizes = {name: given.get(f"{side}_{name}", given.get(name)) for name in _LEGAL_SIZES}
        missing = [name for name, value in sizes.items() if value is None]
        if missing:
            raise SessionRefused(
                f"foot_outline: the {side} foot has no {' and no '.join(missing)}. Give all three, in cm."
            )
        found[side] = FootSizes(**{name: float(value) for name, value in sizes.items() if value is not None})
    return found


def _refuse_impossible_size(name: str, value: float, short: str) -> None:
    low, high = _LEGAL_SIZES[short]
    if low <= value <= high:
        return
    unit = next((unit for unit, one in (("mm", value / 10), ("m", value * 100)) if low <= one <= high), "")
    hint = f" It looks like {unit}." if unit else ""
    raise SessionRefused(
        f"foot_outline: {name} = {100 * value:g} cm is no foot's. Legal: {100 * low:.0f} to {100 * high:.0f} cm.{hint}"
    )


def traced_outline(path: str | Path) -> dict[str, FootSizes]:
    """Return the outline of each foot from a CSV file with the columns ``side`` (right, left), ``x_cm`` from the heel
    to the toes and ``y_cm`` across: points in order round each foot.

    Raises
    ------
    SessionRefused
        The file is missing, has other columns, no number where one belongs, or fewer than 12 points of a foot.
    """
    path = Path(path)
    if not os.path.isfile(path):
        raise SessionRefused(f"foot_outline: there is no file {path}. Check the path, relative to session.toml.")
    try:
        rows = list(csv.DictReader(read_text(path).splitlines()))
    except csv.Error:  # a quotation mark that is never closed
        rows = []
    if not rows or not {"side", "x_cm", "y_cm"} <= set(rows[0]):
        raise SessionRefused(f"foot_outline: {path} needs the columns side, x_cm and y_cm and a row for every point.")
    found = {}
    for side in SIDES:
        try:
            points = np.array([[float(row["x_cm"]), float(row["y_cm"])] for row in rows if row["side"] == side]) / 100
        except (TypeError, ValueError):
            raise SessionRefused(f"foot_outline: {path} has no number for x_cm or y_cm of the {side} foot.") from None
        if len(points) < 12 or not np.isfinite(points).all():
            raise SessionRefused(
                f"foot_outline: {path} has {len(points)} points of the {side} foot; trace at least 12 round each foot "
                "(side is right or left)."
            )
        found[side] = _sizes(points)
    return found


def _sizes(points: Array) -> FootSizes:
    """Return length, breadth and heel breadth of points (n, 2) m in order round one foot."""
    x = points[:, 0] - points[:, 0].min()
    length = float(x.max())
    # The heel's breadth: where a line across, at a share of the length, cuts the closed polygon
    # Share of the length, from the heel, at which its breadth is measured
    beyond, y, at = np.roll(x, -1), points[:, 1], 0.15 * length
    cut = (x - at) * (beyond - at) < 0
    across = y[cut] + (at - x[cut]) / (beyond[cut] - x[cut]) * (np.roll(y, -1)[cut] - y[cut])
    heel = float(np.ptp(across)) if cut.any() else 0.0
    sizes = {"length": length, "breadth": float(np.ptp(y)), "heel_breadth": heel}
    for name, value in sizes.items():
        _refuse_impossible_size(name, value, name)
    return FootSizes(**sizes)


FILES = ("subject.toml", "session.toml")


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)


class SubjectEntry(_Entry):
    """The table ``[subject]``; None = not said. The bounds catch grams, millimetres and centimetres. Validated with the
    folder of its file as context, the files it names become paths from where we stand.
    """

    mass_kg: Annotated[float, Field(ge=5, le=400)] | None = None
    """Give the body mass in kg."""
    height_m: Annotated[float, Field(ge=0.4, le=2.6)] | None = None
    """Give the stature in m."""
    sex: Literal["F", "M"] | None = None
    """Write "F" or "M"."""
    age: Annotated[float, Field(ge=0, le=120)] | None = None
    """Give the age in years."""
    name: str | None = None
    girths_cm: dict[str, float] | None = None
    """Write {thigh = 54, right_shank = 37}, in cm."""
    scan: str | None = None
    """Write the path of a mesh, for example "body.obj"."""
    scan_up: Literal["z", "y", "x"] | None = None
    """Write the axis of the scan that points up: "z", "y" or "x"."""
    foot_outline: str | dict[str, float] | None = None
    """Write {length = 26, breadth = 10, heel_breadth = 7} in cm, or the path of a CSV file."""
    prosthesis: str | None = None
    """Write the segment that it begins with, for example "left_shank"."""

    @field_validator("scan", "foot_outline")
    @classmethod
    def _beside(cls, said: object, info: ValidationInfo) -> object:
        """Return the path of a file that lies beside session.toml; anything else as it is."""
        return str(info.context / said) if isinstance(said, str) and info.context else said

    @model_validator(mode="after")
    def _possible(self) -> "SubjectEntry":
        """Refuse what no person has, and a scan that is not there."""
        _ = self.girths, self.outlines
        refuse_prosthesis(self.prosthesis)
        if self.scan is not None and not os.path.isfile(self.scan):
            raise SessionRefused(f"scan: there is no file {self.scan}. Check the path, relative to session.toml.")
        return self

    @property
    def girths(self) -> dict[str, float]:
        """Girths in m by name."""
        return legal_girths({name: value / 100 for name, value in (self.girths_cm or {}).items()})

    @property
    def outlines(self) -> dict[str, FootSizes]:
        """Outlines of the feet by side."""
        if isinstance(self.foot_outline, str):
            return traced_outline(self.foot_outline)
        return typed_outline({name: value / 100 for name, value in (self.foot_outline or {}).items()})


class _TrialEntry(_Entry):
    """One table ``[trials.NAME]``."""

    role: Role | None = None
    """Legal are static, fit, validate, check, skip."""
    exchange: list[list[str | float]] | None = None
    """Write [["LKNE", "RKNE"]], or with from and to in s: [["LKNE", "RKNE", 1.2, 3.4]]."""
    leave_out: list[list[float | str]] | None = None
    """Write spans from and to in s: [[2.5, 3.1]], or of one foot: [[2.5, 3.1, "right"]]."""
    events: list[dict[str, float | str]] | None = None
    """Write [{side = "left", kind = "strike", time = 1.23}, ...]."""

    @model_validator(mode="after")
    def _possible(self) -> "_TrialEntry":
        _ = legal_exchanges(self.exchange), legal_spans(self.leave_out), legal_events(self.events)
        return self


class _MarkersEntry(_Entry):
    """The table ``[markers]``: the ``file`` (or name) of a set, or the ``map`` of labels to places; the labels to
    ``drop``.
    """

    file: str | None = None
    """Write the path of a marker set, for example "my_set.toml"."""
    map: dict[str, str] | None = None
    """Write {LABEL = "left_asis", ...}."""
    drop: list[str] | None = None
    """Write the labels, for example ["T10", "RBAK"]."""


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
    plates: dict[str, PlateEntry] = {}
    devices: dict[str, float] = {}
    settings: dict[str, Any] = {}

    @model_validator(mode="after")
    def _possible(self) -> "_Contents":
        _ = [told_plate(name, entry) for name, entry in self.plates.items()]
        refuse_devices(self.devices)
        return self


@dataclass(frozen=True)
class SessionFile:
    """What all files of the chain say together: ``subject``, ``trials`` by name or pattern (the innermost file first),
    ``read`` paths, ``visit`` when and where; ``settings`` with what ``[settings]`` changes; ``marker_set`` the name or
    file of the set that was worn, "" where none is said (see `read_marker_set`); ``plates`` by name;
    ``devices`` kg by segment; ``dropped`` labels of markers that are not used.
    """

    subject: SubjectEntry = field(default_factory=SubjectEntry)
    trials: tuple[tuple[str, _TrialEntry], ...] = ()
    read: tuple[Path, ...] = field(default=())
    settings: Settings = USUAL
    marker_set: str = ""
    visit: VisitEntry = field(default_factory=VisitEntry)
    plates: Mapping[str, ToldPlate] = field(default_factory=dict)
    devices: Mapping[str, float] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()

    @property
    def told(self) -> Told:
        """What readers of forces must know."""
        return Told(self.plates, self.subject.mass_kg)

    def role(self, name: str) -> Role | None:
        """Return the role of a trial: by its exact name, else by the first pattern; case does not count."""
        return next((entry.role for entry in self._about(name) if entry.role), None)

    def parts(self, name: str) -> TrialParts:
        """Return what is said of the parts of a trial: labels that change places, dropped markers, spans left
        out, events of the feet.
        """
        about = self._about(name)
        exchange = next((one.exchange for one in about if one.exchange is not None), None)
        spans = next((one.leave_out for one in about if one.leave_out is not None), None)
        events = next((one.events for one in about if one.events is not None), None)
        return TrialParts(legal_exchanges(exchange), self.dropped, legal_spans(spans), legal_events(events))

    def _about(self, name: str) -> list[_TrialEntry]:
        """Return what is said of a trial: by its exact name, then by patterns."""
        exact = [entry for key, entry in self.trials if key.lower() == name.lower()]
        return exact + [entry for key, entry in self.trials if fnmatchcase(name.lower(), key.lower())]

    def unused(self, names: list[str], plates: set[str], labels: set[str]) -> list[str]:
        """Return a sentence for each entry that fits nothing of the session, most often a slip of the pen: keys of
        ``[trials]`` that fit no trial among the ``names``, each with the closest (a pattern, ``squat*``, is for what
        there may be); ``[plates.NAME]`` of no plate that was read; dropped labels that no trial has.
        """
        said: list[str] = []
        for key, _ in self.trials:
            if not set(key) & set("*?[") and not any(fnmatchcase(name.lower(), key.lower()) for name in names):
                hint = did_you_mean(key, names)
                said.append(Doubt(f"[trials.{key}] fits no recording of the session", hint.strip()))
        idle = [name for name, plate in self.plates.items() if plate.use and name not in plates]
        legal = f"The plates read are {', '.join(sorted(plates))}." if plates else "No plate was read."
        said += [Doubt(f"[plates.{name}] fits no plate of the session", legal) for name in idle]
        absent = [one for one in self.dropped if one not in labels]
        return said + [Doubt(f"[markers] drop names {one!r}, which no trial has") for one in absent]


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
    contents = [_checked(path, read_toml(path)) for path in paths]
    said: dict[str, Any] = {}
    visit: dict[str, Any] = {}
    plates: dict[str, PlateEntry] = {}
    for content in contents:
        for name, entry in content.plates.items():
            # An outer file fills in what the inner one does not say of a plate.
            outer = plates[name].model_dump(exclude_none=True) if name in plates else {}
            plates[name] = PlateEntry(**{**outer, **entry.model_dump(exclude_none=True)})
        said |= content.subject.model_dump(exclude_none=True)
        visit |= content.session.model_dump(exclude_none=True)
    trials = tuple((key, entry) for content in reversed(contents) for key, entry in content.trials.items())
    worn = [name for path, content in zip(paths, contents, strict=True) if (name := _marker_set(path, content.markers))]
    settings, marker_set = _settings(paths, contents), (worn or [""])[-1]
    told = {name: told_plate(name, entry) for name, entry in plates.items()}
    worn_kg = {segment: mass for content in contents for segment, mass in content.devices.items()}
    subject, day_of = SubjectEntry(**said), VisitEntry(**visit)
    dropped = tuple(dict.fromkeys(label for content in contents for label in content.markers.drop or ()))
    return SessionFile(subject, trials, tuple(paths), settings, marker_set, day_of, told, worn_kg, dropped)


def check_session_text(path: Path, text: str) -> None:
    """Refuse a ``text`` that would not be legal as the content of the session file ``path``.

    Raises
    ------
    FileRefused
        It is no TOML.
    SessionRefused
        It has an unknown key or a value that is not legal; the message says what would be.
    """
    content = _checked(path, parse_toml(text, path))
    _settings([path], [content])
    _marker_set(path, content.markers)
    if content.markers.map:
        parse_map(content.markers.map, str(path))


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


def _checked(path: Path, raw: dict[str, Any]) -> _Contents:
    try:
        return _Contents.model_validate(_whole_numbers_are_numbers(raw), context=path.parent)
    except ValidationError as error:
        raise SessionRefused(" ".join(_sentence(path, fault) for fault in error.errors())) from None


def _whole_numbers_are_numbers(raw: Any) -> Any:
    """Return the tables with 70 as 70.0: strict pydantic keeps text and truth apart from numbers."""
    if isinstance(raw, dict):
        return {key: _whole_numbers_are_numbers(value) for key, value in raw.items()}
    return float(raw) if isinstance(raw, int) and not isinstance(raw, bool) else raw


def _sentence(path: Path, fault: Any) -> str:
    """Return one fault that pydantic found as a sentence for the analyst."""
    loc = [str(part) for part in fault["loc"]]
    if fault["type"] == "value_error":  # a check of our own
        at = f"[{'.'.join(loc)}] " if loc else ""
        return f"{path}: {at}{fault['ctx']['error']}"
    *table, key = loc or [""]
    where = f"[{'.'.join(table)}]" if table else "the top level"
    # What the table holds: the fields of its model, or of the model of its entries by name.
    kind = _Contents.model_fields[table[0]].annotation if table else _Contents
    fields = getattr((kind, *get_args(kind))[-1], "model_fields", {})
    if fault["type"] == "extra_forbidden":
        hint = did_you_mean(key, list(fields), cutoff=0.3)
        return f"{path}: {where} has the unknown key {key!r}.{hint} Legal: {', '.join(fields)}."
    wrong = f"{path}: {key} = {fault['input']!r} in {where} is not legal: {fault['msg'][0].lower()}{fault['msg'][1:]}."
    cures = (fields[part].description for part in reversed(loc) if part in fields)
    return f"{wrong} {next(cures, None) or ''}".rstrip()

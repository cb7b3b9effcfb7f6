"""What single tables of session.toml say, and how it reaches the trials: plates; exchanged and dropped labels, seconds
left out; strikes and offs by hand; what somebody wears.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from biodance.errors import SessionRefused, TrialRefused, UnknownName, did_you_mean
from biodance.lab.c3d.raw import read_raw
from biodance.lab.markers.sets import MARKED_SEGMENTS
from biodance.lab.plates import PLATE_TYPES, ToldPlate, channel_groups, plate_parameters
from biodance.lab.plates.decode import DEEPEST, LONGEST_SIDE, SHORTEST_SIDE, corners_in_lab
from biodance.lab.readers.c3d import file_frame
from biodance.records import SIDES, Array, FootEvent, LeftOutSpan, Mask, Plate, Session, Trial

_KINDS = {"strike": True, "off": False}
_KEYS = ("side", "kind", "time")


def legal_events(given: Sequence[Mapping[str, float | str]] | None) -> tuple[FootEvent, ...]:
    """Return the events that a list of ``{side, kind, time}`` says, in the order of time; ``kind`` strike or off.

    Raises
    ------
    SessionRefused
        A key is missing or unknown, a value is not legal, or a foot strikes twice without an off between (or leaves
        twice without a strike).
    """
    found = sorted((_event(one) for one in given or ()), key=lambda one: one.time)
    for side in SIDES:
        for one, after in pairwise(one for one in found if one.side == side):
            if one.down is after.down or one.time == after.time:
                raise SessionRefused(
                    f"events has the {_said(one)} and then the {_said(after)} with no {_kind(not one.down)} between "
                    f"them. Add that one, or take one of the two out."
                )
    return tuple(found)


def _event(given: Mapping[str, float | str]) -> FootEvent:
    for key in given:
        if key not in _KEYS:
            hint = did_you_mean(key, _KEYS)
            raise SessionRefused(f"events has the unknown key {key!r}.{hint} Legal: {', '.join(_KEYS)}.")
    side, kind, time = (given.get(key) for key in _KEYS)
    if side not in SIDES or kind not in _KINDS or not isinstance(time, int | float) or not isfinite(time):
        raise SessionRefused(
            f"events has {dict(given)!r}, which is not legal. Write a side (left, right), a kind (strike, off) and the "
            f'time in s: {{side = "left", kind = "strike", time = 1.23}}.'
        )
    return FootEvent(float(time), str(side), _KINDS[str(kind)], "hand")


def with_events(trial: Trial, events: tuple[FootEvent, ...]) -> Trial:
    """Return a trial with the ``events`` that session.toml says; the history names their sides.

    Raises
    ------
    TrialRefused
        One is not within the trial.
    """
    clocks = [trial.markers.time] if trial.markers is not None else []
    clocks += [plate.wrench.time for plate in trial.plates]
    begin, end = min(time[0] for time in clocks), max(time[-1] for time in clocks)
    for one in events:
        if not begin <= one.time <= end:
            raise TrialRefused(
                f"Trial {trial.name}: session.toml has the {_said(one)} in [trials.{trial.name}] events, which is not "
                f"within the recording, {begin:g} to {end:g} s. Correct the time, or take the event out."
            )
    sides = " and ".join(side for side in SIDES if any(one.side == side for one in events))
    said = f"The {len(events)} strikes and offs of the {sides} foot were set by hand, as session.toml says."
    return replace(trial, events=events, history=(*trial.history, said))


def _said(event: FootEvent) -> str:
    return f"{event.side} {_kind(event.down)} at {event.time:g} s"


def _kind(down: bool) -> str:
    return "strike" if down else "off"


@dataclass(frozen=True)
class Exchange:
    """The markers ``one`` and ``other`` carry each other's label from ``start`` to ``end`` s of a trial."""

    one: str
    other: str
    start: float = -inf
    end: float = inf

    def __str__(self) -> str:
        when = f" from {self.start:g} to {self.end:g} s" if isfinite(self.end) else ""
        return f"{self.one} and {self.other} take each other's places{when}"

    @property
    def entry(self) -> list[str | float]:
        """As session.toml says it."""
        return [self.one, self.other, *((self.start, self.end) if isfinite(self.start) else ())]


def legal_exchanges(given: Sequence[Sequence[str | float]] | None) -> tuple[Exchange, ...]:
    """Return the exchanges that a list of ``[label, label]`` or ``[label, label, from s, to s]`` says.

    Raises
    ------
    SessionRefused
        An entry is none of the two, names one label twice, or ends before it begins.
    """
    found = []
    for entry in given or ():
        labels, span = entry[:2], entry[2:]
        two = len(set(labels)) == 2 and all(isinstance(one, str) and one for one in labels)
        if not two or (span and not _is_span(span)):
            raise SessionRefused(
                f'exchange has {list(entry)!r}, which is not legal. Write two labels, ["LKNE", "RKNE"], or with from '
                f'and to in s: ["LKNE", "RKNE", 1.2, 3.4].'
            )
        found.append(Exchange(str(labels[0]), str(labels[1]), *(float(one) for one in span)))
    return tuple(found)


def legal_spans(given: Sequence[Sequence[float | str]] | None) -> tuple[LeftOutSpan, ...]:
    """Return the spans that a list of ``[from s, to s]`` or ``[from s, to s, side]`` says, in the order of time.

    Raises
    ------
    SessionRefused
        An entry is none of the two, or ends before it begins.
    """
    found = []
    for entry in given or ():
        span, side = list(entry[:2]), str(entry[2]) if len(entry) == 3 else ""
        if not _is_span(span) or len(entry) > 3 or side not in ("", *SIDES):
            raise SessionRefused(
                f"leave_out has {list(entry)!r}, which is not legal. Write from and to in s, [2.5, 3.1], or with the "
                f'foot whose steps alone are left out: [2.5, 3.1, "right"].'
            )
        found.append(LeftOutSpan(float(span[0]), float(span[1]), side))
    return tuple(sorted(found, key=lambda one: (one.start, one.end)))


def _is_span(given: Sequence[str | float]) -> bool:
    """Return whether two finite numbers are a span with a beginning before its end."""
    numbers = [one for one in given if isinstance(one, int | float) and isfinite(one)]
    return len(given) == len(numbers) == 2 and numbers[0] < numbers[1]


@dataclass(frozen=True)
class TrialParts:
    """What is said of parts of a trial: ``exchanges`` and ``dropped`` of labels, spans ``left_out``, ``events`` of the
    feet.
    """

    exchanges: tuple[Exchange, ...] = ()
    dropped: tuple[str, ...] = ()
    left_out: tuple[LeftOutSpan, ...] = ()
    events: tuple[FootEvent, ...] = ()


def with_parts_corrected(trial: Trial, said: TrialParts) -> Trial:
    """Return a trial as the analyst says of its parts: labels exchanged, markers dropped, and the forces of the
    spans that are left out for both feet unknown (NaN); with the events of the feet. What was done stands in the
    history. TrialRefused: an event is not within the trial.
    """
    trial = _exchanged(trial, said.exchanges) if said.exchanges else trial
    trial = _without(trial, said.dropped) if said.dropped else trial
    trial = with_events(trial, said.events) if said.events else trial
    return _left_out(trial, said.left_out) if said.left_out else trial


def _exchanged(trial: Trial, exchanges: Sequence[Exchange]) -> Trial:
    markers = trial.markers
    if markers is None:
        return trial
    xyz, said, doubts = markers.xyz.copy(), list[str](), list[str]()
    for one in exchanges:
        if absent := [label for label in (one.one, one.other) if label not in markers.names]:
            doubts.append(f"session.toml exchanges {' and '.join(absent)}, which this trial does not have.")
            continue
        frames = np.flatnonzero(within(markers.time, one.start, one.end))[:, None]
        first, second = markers.names.index(one.one), markers.names.index(one.other)
        xyz[frames, [first, second]] = xyz[frames, [second, first]]
        said.append(f"{one}, as session.toml says.")
    history, warnings = (*trial.history, *said), (*trial.warnings, *doubts)
    return replace(trial, markers=replace(markers, xyz=xyz), history=history, warnings=warnings)


def _without(trial: Trial, dropped: Sequence[str]) -> Trial:
    markers = trial.markers
    gone = [label for label in dropped if markers is not None and label in markers.names]
    if markers is None or not gone:
        return trial
    kept = markers.select([name for name in markers.names if name not in gone])
    said = f"Not used, as session.toml says: {', '.join(gone)}."
    return replace(trial, markers=kept, history=(*trial.history, said))


def _left_out(trial: Trial, spans: tuple[LeftOutSpan, ...]) -> Trial:
    plates = []
    for plate in trial.plates:
        value = plate.wrench.value.copy()
        for one in spans:
            if not one.side:
                value[within(plate.wrench.time, one.start, one.end)] = np.nan
        plates.append(replace(plate, wrench=replace(plate.wrench, value=value)))
    history = (*trial.history, f"Left out, as session.toml says: {', '.join(map(str, spans))}.")
    return replace(trial, plates=tuple(plates), left_out=spans, history=history)


def within(time: Array, start: float, end: float) -> Mask:
    """Return the frames (T,) of ``time`` s from ``start`` to ``end``, both included."""
    return (time >= start) & (time <= end)


def refuse_prosthesis(segment: str | None) -> None:
    """Refuse the ``segment`` that a prosthesis begins with where it is none of an arm or leg (SessionRefused)."""
    limbs = [name for name in MARKED_SEGMENTS if name.startswith(SIDES)]
    if segment and segment not in limbs:
        told = UnknownName.of("segment of an arm or leg, below whose joint the prosthesis is", segment, limbs)
        raise SessionRefused(f"prosthesis: {told}")


def refuse_devices(devices: Mapping[str, float]) -> None:
    """Refuse what is worn, kg by segment, where there is no such segment, or the mass is none of a device
    (SessionRefused).
    """
    for segment, mass in devices.items():
        if segment not in MARKED_SEGMENTS:
            raise SessionRefused(f"[devices] {UnknownName.of('segment', segment, MARKED_SEGMENTS)}")
        if not 0 < mass <= 30.0:  # more is in grams
            raise SessionRefused(f"[devices] {segment} = {mass:g} kg is no device. Legal: above 0 and at most 30 kg.")


class PlateEntry(BaseModel):
    """One table ``[plates.NAME]``; None = not said. `told_plate` checks the numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)

    corners_m: Any = None
    type: Any = None
    channels: Any = None
    sensitivity: Any = None
    origin_m: Any = None
    foot: Literal["left", "right"] | None = None
    """Write "left" or "right"; leave it out where both stand on the plate."""
    use: bool | None = None
    """Write false to leave the plate out."""


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
    kind = entry.type
    if kind is not None and (type(kind) not in (int, float) or kind not in PLATE_TYPES):
        legal = ", ".join(map(str, PLATE_TYPES))
        raise SessionRefused(f"{where} type = {kind!r} is not legal. Legal are the TYPEs {legal} of the C3D standard.")
    kind = None if kind is None else int(kind)
    channels = None if entry.channels is None else _channels(entry.channels, kind, where)
    return ToldPlate(
        corners=None if entry.corners_m is None else _corners(entry.corners_m, where),
        type=kind,
        channels=channels,
        sensitivity=None if entry.sensitivity is None else _sensitivity(entry.sensitivity, kind, channels, where),
        origin=None if entry.origin_m is None else _origin(entry.origin_m, where),
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


def _corners(value: Any, where: str) -> Array:
    order = "in the order +x+y, -x+y, -x-y, +x-y of the plate's own axes"
    legal = f"four points [x, y, z] in m in the lab frame (z up), {order}"
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


def _channels(value: Any, kind: int | None, where: str) -> tuple[str | int, ...]:
    legal = 'labels or numbers of analog channels, from 1: ["Fx1", "Fy1", ...] or [1, 2, 3, 4, 5, 6]'
    listed = value if isinstance(value, list) else [None]
    channels: list[Any] = [int(c) if isinstance(c, float) and c == round(c) and c >= 1 else c for c in listed]
    if not all((isinstance(c, str) and c.strip()) or (type(c) is int and c >= 1) for c in channels):
        raise SessionRefused(f"{where} channels = {value!r} is not legal. Write {legal}.")
    counts = {PLATE_TYPES[kind].channels} if kind else {one.channels for one in PLATE_TYPES.values()}
    if len(channels) not in counts or len(set(channels)) < len(channels):
        need = " or ".join(map(str, sorted(counts)))
        of = f" of TYPE {kind}" if kind else ""
        raise SessionRefused(f"{where} channels names {len(set(channels))} channels; a plate{of} has {need}.")
    return tuple(channels)


def _sensitivity(value: Any, kind: int | None, channels: tuple[str | int, ...] | None, where: str) -> Array:
    """Return the matrix (rows, channels) of a list of numbers, which is its diagonal, or of a list of rows."""
    columns = PLATE_TYPES[kind].channels if kind else len(channels or ()) or 6
    rows = len(PLATE_TYPES[kind].outputs) if kind else columns
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


def _origin(value: Any, where: str) -> Array:
    legal = f"[x, y, z] in m from the sensor to the centre of the surface, z up to {DEEPEST:g} m, plate axes"
    origin = _numbers(value, f"{where} origin_m", legal)
    if origin.shape != (3,) or abs(origin[2]) > DEEPEST or np.abs(origin).max() > LONGEST_SIDE:
        raise SessionRefused(f"{where} origin_m = {value!r} is not legal. Write {legal}.")
    return origin


def plate_lines(session: Session) -> Iterator[str]:
    """Yield the tables of all plates of a session, else of channels that look like some, each line with a # before."""
    first: dict[str, tuple[Plate, Trial]] = {}
    for trial in session.trials:
        for plate in trial.plates:
            first.setdefault(plate.name, (plate, trial))
    tables: list[tuple[str, str, str, int, Sequence[str | int], tuple[float, ...]]] = []
    for plate, trial in first.values():
        corners = json.dumps([[round(float(x), 5) for x in corner] for corner in plate.corners])
        channels = plate_channels(plate, trial) if plate.type else ([], ())
        tables.append((plate.name, f"as in {trial.name}", corners, plate.type, *channels))
    for trial in session.trials:
        if tables or trial.source.format != "C3D":
            continue
        raw = read_raw(trial.source.path)
        where = f"its channels are in {raw.path.name}, which does not describe it"
        corners = f"[{', '.join(['[x, y, z]'] * 4)}]"
        for number, columns in enumerate(channel_groups(raw.analog_labels), start=1):
            kind = 2 if len(columns) == 6 else 3
            named = [raw.analog_labels[column] for column in columns]
            tables.append((f"plate{number}", where, corners, kind, named, (1.0,) * len(columns)))
    if not tables:
        return
    yield "# Force plates: what stands here comes before what the files say. Take the # from the table's name and from"
    yield "# what you correct."
    for name, where, corners, kind, labels, units in tables:
        yield f"# [plates.{name}] # {where}"
        yield f"# corners_m = {corners} # m, lab frame, z up; +x+y, -x+y, -x-y, +x-y of the plate's own axes"
        if kind:
            yield f"# type = {kind} # of the C3D standard"
        if labels:
            yield f"# channels = {json.dumps(labels, ensure_ascii=False)} # labels, or numbers from 1"
        if units:
            yield f"# sensitivity = {[*units]} # N, N·m per unit of each channel as in the file; or rows of a matrix"
        yield '# foot = "left" # or "right", where the markers do not tell which foot stands on it'
        yield "# use = false # leaves the plate out"
        yield ""


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

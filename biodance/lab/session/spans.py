"""What session.toml says of parts of a trial: labels that take each other's places, markers that are dropped, seconds
that are left out.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from biodance.errors import SessionRefused
from biodance.lab.session.foot_events import with_events
from biodance.records import SIDES, Array, FootEvent, LeftOutSpan, Mask, Trial
from biodance.records.attention import WARNING


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


def unused_labels(dropped: Sequence[str], known: Collection[str]) -> list[str]:
    """Return a sentence for each dropped label that is not ``known`` from any trial: most often a slip of the pen."""
    return [f"{WARNING}[markers] drop names {one!r}, which no trial has." for one in dropped if one not in known]

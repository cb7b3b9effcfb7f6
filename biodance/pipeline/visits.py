"""Visits of one person side by side: each quantity with its interval, and what changed beyond its uncertainty."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from biodance import display
from biodance.cycles.curves import CurveGroup, group_curves
from biodance.cycles.summary import KeyValue, key_values, leading_foot, stride_values
from biodance.errors import BiodanceError, SessionRefused
from biodance.identification.knowledge import SIGMAS
from biodance.identification.sessions import differences
from biodance.lab.session.read import read_session, visit_words
from biodance.lab.session.recordings import ANOTHER_STATURE
from biodance.pipeline.attention import session_attention
from biodance.pipeline.body import refuse_another_reference
from biodance.pipeline.diagnosis import as_diagnosed, diagnosed_and_corrected
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.movement import SessionMovement, describe_movement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import followed, identification_of
from biodance.pipeline.trial import Weighing
from biodance.records import Session, side_in_name
from biodance.records.attention import Attention
from biodance.uncertainty.visits import (
    FEWEST_STRIDES,
    KeyKind,
    VisitMean,
    beyond_chance,
    change_of_mean,
    placement_sd,
    visit_mean,
)


class Untested(StrEnum):
    """Why a change has no interval."""

    NO = ""
    FEW_CYCLES = "few cycles"
    NOT_KNOWN = "not known"


@dataclass(frozen=True, kw_only=True)
class ComparedQuantity:
    """One quantity in two or more visits: ``kind`` of the cycles ("body" for masses), ``quantity`` with its ``key``
    ("maximum", ...; "" where it is a number by itself), ``side``.

    ``values`` in ``unit``, one a visit (None = not known there), each with its 95 % interval ``ci95`` and over how many
    cycles (``counts``; 0 of a mass). ``change``, the last less the first, with ``change_ci95`` and ``p`` of one at
    least as large if nothing had changed; None where too little is known, ``why`` says of what. ``placement_sd`` what
    placing the markers adds in the last visit (None = no part of it). ``changed`` beyond chance.
    """

    kind: str
    quantity: str
    key: str
    side: str
    unit: str
    values: tuple[float | None, ...]
    ci95: tuple[tuple[float, float] | None, ...]
    counts: tuple[int, ...]
    change: float
    change_ci95: tuple[float, float] | None
    p: float | None
    placement_sd: float | None = None
    why: Untested = Untested.NO
    changed: bool = False

    @property
    def name(self) -> str:
        """``knee_flexion_maximum``, or the quantity alone."""
        return f"{self.quantity}_{self.key}" if self.key else self.quantity

    @property
    def distance(self) -> float:
        """The change in half widths of its interval; 0 where there is none."""
        if self.change_ci95 is None:
            return 0.0
        half = (self.change_ci95[1] - self.change_ci95[0]) / 2
        return abs(self.change) / half if half > 0 else (float("inf") if self.change else 0.0)


_About = tuple[str, str, str]
"""Kind of cycle, name of the quantity, side."""


def cycle_quantities(visits: Sequence[SessionMovement]) -> Iterator[ComparedQuantity]:
    """Yield the values of cycles that the first and the last visit have in common, over all their trials."""
    foot = leading_foot([[stride for trial in one for stride in trial.strides] for one in visits])
    seen = [_values(one, foot) for one in visits]
    for about in seen[0]:
        if about in seen[-1]:
            yield _compared(about, [one.get(about, []) for one in seen])


def _values(moved: SessionMovement, foot: str) -> dict[_About, list[KeyValue]]:
    """Return all values of each quantity in a visit, over all its trials."""
    found: dict[_About, list[KeyValue]] = {}
    for trial in moved:
        for one in (*stride_values(trial.strides, leading=foot), *key_values(trial.curves)):
            found.setdefault((one.cycle.kind, one.name, one.side), []).append(one)
    return found


def _mean(some: Sequence[KeyValue]) -> VisitMean:
    """Return what a visit says of a quantity, with what all its cycles share."""
    # independent of each other and the same in all cycles of a visit, so that no mean over cycles makes them smaller
    shared = float(np.hypot(placement_sd(_kind(some)), np.mean([one.sd for one in some])))
    return visit_mean(np.array([one.value for one in some]), systematic=shared)


def _kind(some: Sequence[KeyValue]) -> KeyKind:
    """Return what says how far placing the markers anew moves a quantity, of which these are the values in a visit."""
    rate, span, beside = np.mean([(one.rate, one.span, one.beside) for one in some], axis=0).tolist()
    return KeyKind(quantity=some[0].quantity, key=some[0].key, unit=some[0].unit, rate=rate, span=span, beside=beside)


def _compared(about: _About, seen: Sequence[Sequence[KeyValue]]) -> ComparedQuantity:
    """Return one quantity of which the first and the last visit have values."""
    one, means = seen[0][0], [_mean(some) if some else None for some in seen]
    first, last = _mean(seen[0]), _mean(seen[-1])
    change, few = change_of_mean(first, last), min(first.count, last.count) < FEWEST_STRIDES
    return ComparedQuantity(
        kind=about[0], quantity=one.quantity, key=one.key, side=about[2], unit=one.unit,
        values=tuple(mean.mean if mean else None for mean in means),
        ci95=tuple(mean.interval if mean else None for mean in means),
        counts=tuple(map(len, seen)),
        change=change.value, change_ci95=change.interval, p=change.p, placement_sd=placement_sd(_kind(seen[-1])),
        why=Untested.FEW_CYCLES if few else Untested.NO,
    )  # fmt: skip


def mass_quantities(
    visits: Sequence["ExaminedVisit"], *, tell: Callable[[str], None]
) -> tuple[list[ComparedQuantity], list[str]]:
    """Return the masses that the first and the last visit have in common, those of segments as
    `biodance.compare_sessions` has them, and why others are not compared.
    """
    found = [*_weights([one.result.weighed for one in visits])]
    notes = [one.unweighed for one in (visits[0], visits[-1]) if one.unweighed]
    first, last = visits[0].identified, visits[-1].identified
    if first is None or last is None:
        return found, [f"The masses of the segments are not compared: {why}" for why in notes]
    tell("comparing the bodies")
    try:
        changes = differences(first.identification, last.identification)
    except BiodanceError as why:
        return found, [f"The masses of the segments are not compared: {why}"]
    known = [one.identified.identification.known if one.identified is not None else () for one in visits]
    masses = [{row.segment: row for row in rows if row.quantity == "mass"} for rows in known]
    for one in (change for change in changes if change.quantity == "mass"):
        side, rows = side_in_name(one.segment), [some.get(one.segment) for some in masses]
        seen = [(row.value, row.interval) if row else None for row in rows]
        # a change of which neither visit's data know anything is not tested
        tested = (one.interval, one.p) if one.known else None
        found.append(_mass(one.segment.removeprefix(f"{side}_"), side, seen, one.value, tested))
    return found, []


def _weights(weighed: Sequence[Weighing | None]) -> Iterator[ComparedQuantity]:
    """Yield the mass that the plates carry, where they do in the first and the last visit."""
    first, last = weighed[0], weighed[-1]
    if first is None or last is None:
        return
    # two weighings err independently: variances add; p is two-sided of a normal difference
    change, sd = last.mass - first.mass, float(np.hypot(first.sd, last.sd))
    seen = [(one.mass, (one.mass - SIGMAS * one.sd, one.mass + SIGMAS * one.sd)) if one else None for one in weighed]
    interval = (change - SIGMAS * sd, change + SIGMAS * sd)
    yield _mass("total", "both", seen, change, (interval, float(2 * ndtr(-abs(change) / sd))))


def _mass(
    of: str,
    side: str,
    seen: Sequence[tuple[float, tuple[float, float]] | None],
    change: float,
    tested: tuple[tuple[float, float], float] | None,
) -> ComparedQuantity:
    """Return a mass ``of`` the body, ``seen`` in each visit with its interval, and interval and p of its change."""
    return ComparedQuantity(
        # where the cycles of other quantities have their kind
        kind="body", quantity=f"{of}_mass", key="", side=side, unit="kg",
        values=tuple(one[0] if one else None for one in seen),
        ci95=tuple(one[1] if one else None for one in seen),
        counts=(0,) * len(seen),
        change=change, change_ci95=tested[0] if tested else None, p=tested[1] if tested else None,
        why=Untested.NO if tested else Untested.NOT_KNOWN,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ExaminedVisit:
    """One visit: its ``name`` and ``date`` (ISO 8601, "" = not said), the examined session ``result``, what ``moved``,
    what it says of the body (``identified``; None where it can say nothing, ``unweighed`` says why), and what needs a
    person (``attention``, without notes).
    """

    name: str
    date: str
    result: SessionResult
    moved: SessionMovement
    identified: SessionIdentification | None
    unweighed: str
    attention: tuple[Attention, ...]


@dataclass(frozen=True, eq=False)
class VisitComparison:
    """What changed between ``visits`` of one person, the last less the first: ``quantities``, the surest change first,
    and ``notes`` on what is not in the intervals and what could not be compared.
    """

    visits: tuple[ExaminedVisit, ...]
    quantities: tuple[ComparedQuantity, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        names = " -> ".join(repr(one.name) for one in self.visits)
        return f"VisitComparison({names}: {len(self.changed)} of {len(self.quantities)} quantities changed)"

    def _repr_html_(self) -> str:
        return display.card(repr(self), None, self.notes)

    @property
    def changed(self) -> tuple[ComparedQuantity, ...]:
        """The quantities that changed beyond their uncertainty, the surest first."""
        return tuple(one for one in self.quantities if one.changed)

    @property
    def tested(self) -> int:
        """How many quantities have an interval of the change."""
        return sum(one.p is not None for one in self.quantities)

    def curves(self) -> list[tuple[CurveGroup, ...]]:
        """Return for each visit the curves of all its trials, by kind of cycle, quantity and side."""
        return [group_curves([curve for trial in one.moved for curve in trial.curves]) for one in self.visits]


def read_visits(folders: Sequence[str | Path], *, tell: Callable[[str], None] = lambda _: None) -> tuple[Session, ...]:
    """Return the sessions of one person's visits, as read, of at least two ``folders``, the earliest first.

    Raises
    ------
    SessionRefused
        There are fewer than two, two are one visit or hold the same recording, or they declare another sex or stature.
    """
    if len(folders) < 2:
        given = "Only one visit was given" if folders else "No visit was given"
        raise SessionRefused(f"{given}. Give two or more visits of one person, the earliest first.")
    places = [Path(one).resolve() for one in folders]
    for k, place in enumerate(places):
        if place in places[:k]:
            raise SessionRefused(f"{folders[k]}: is given twice. Give two different visits of one person.")
    sessions = tuple(read_session(one, tell=tell) for one in folders)
    for k, later in enumerate(sessions):
        for earlier in sessions[:k]:
            _refuse_same(earlier, later)
        if k:
            _refuse_another(sessions[0], later)
    return sessions


def _refuse_same(earlier: Session, later: Session) -> None:
    """Refuse two visits that hold the same recording of a movement: one standing trial may serve both."""
    first, second = (
        {one.source.sha256: one.name for one in some.trials if one.role != "static" and one.source.sha256}
        for some in (earlier, later)
    )
    if shared := first.keys() & second.keys():
        raise SessionRefused(
            f"{later.folder}: trial {second[min(shared)]} is the same recording as {first[min(shared)]} of "
            f"{earlier.folder}, so these are not two visits. Give two different visits of one person."
        )


def _refuse_another(first: Session, later: Session) -> None:
    """Refuse visits whose declared sex or stature contradict each other; what was guessed contradicts nothing."""
    one, other = first.subject, later.subject
    said = {what for what in ("sex", "stature") if what not in (*one.guessed, *other.guessed)}
    names = f"{first.folder.name} and {later.folder.name}"
    if "sex" in said and one.sex != other.sex:
        words = {"F": "female", "M": "male"}
        raise SessionRefused(
            f"{names} are of two persons: {words[one.sex]} and {words[other.sex]} are declared. Give visits of one "
            "person, or put the sex right in session.toml."
        )
    if "stature" in said and not 1 / ANOTHER_STATURE < other.stature / one.stature < ANOTHER_STATURE:
        raise SessionRefused(
            f"{names} are of two persons, or of one who has grown: {one.stature:.2f} m and {other.stature:.2f} m are "
            "declared. Give visits of one person, or put height_m right in session.toml."
        )


def compare_visits(sessions: Sequence[Session], *, tell: Callable[[str], None] = lambda _: None) -> VisitComparison:
    """Return what changed from the first to the last visit of one person (`read_visits`), in every quantity that both
    have: key values of angles (deg), moments (N·m/kg) and powers (W/kg), spatio-temporal values, masses (kg).

    Raises
    ------
    SessionRefused
        They are of two persons, or have no quantity in common.

    Notes
    -----
    A value is the mean over the strides of a visit, pooled over its trials. Its variance is s²/n; in that of a change,
    those of both visits add up with what placing the markers anew (`placement_sd`) and the inertial parameters leave
    uncertain in each. A quantity has changed where Benjamini and Hochberg's procedure at a false discovery rate of 5 %
    over all quantities tells it.
    """
    names = [one.folder.resolve().name for one in sessions]
    if len(set(names)) < len(names):  # with the folder above where two are alike
        names = ["/".join(one.folder.resolve().parts[-2:]) for one in sessions]
    visits = tuple(_examined(one, name, tell) for one, name in zip(sessions, names, strict=True))
    known = visits[0].result.body
    for later in visits[1:]:
        if known is not None and later.result.body is not None:
            refuse_another_reference(known, later.result.body, later.result.subject.mass, names[0])
    masses, why = mass_quantities(visits, tell=tell)
    found = [*cycle_quantities([one.moved for one in visits]), *masses]
    if not found:
        raise SessionRefused(
            f"{names[0]} and {names[-1]} have no quantity in common: no cycle of one kind on one side, and no mass. "
            "Give visits with the same kind of movement."
        )
    told = beyond_chance([one.p for one in found])
    # what changed stands first, the change of most half widths on top; the rest keeps its order
    marked = [replace(one, changed=bool(change)) for one, change in zip(found, told, strict=True)]
    ordered = sorted(marked, key=lambda one: (not one.changed, -one.distance if one.changed else 0.0))
    return VisitComparison(visits, tuple(ordered), (*why, *_notes(visits, marked)))


def _examined(session: Session, name: str, tell: Callable[[str], None]) -> ExaminedVisit:
    """Return one visit after all stages, without what its diagnosis proves to be wrong with the plates."""
    tell_visit: Callable[[str], None] = lambda what: tell(f"{name}: {what}")  # noqa: E731
    result, found = diagnosed_and_corrected(followed(session, tell=tell_visit), tell=tell_visit)
    diagnosis = found.diagnosis if found else None
    result = as_diagnosed(result, diagnosis) if diagnosis else result
    identified, unweighed = _body_told(result, name)
    date = visit_words(session.folder, [one.name for one in session.trials])["date"]
    acted = tuple(one for one in session_attention(result, diagnosis) if one.level != "note")
    return ExaminedVisit(name, date, result, describe_movement(result, tell=tell_visit), identified, unweighed, acted)


def _body_told(result: SessionResult, name: str) -> tuple[SessionIdentification | None, str]:
    """Return what a visit says of the body, or why it says nothing."""
    try:
        found = identification_of(result)
    except SessionRefused as refused:
        return None, str(refused)
    if found.identification.status == "failed":
        return None, f"{name}: {found.identification.cause}"
    return found, ""


def _notes(visits: Sequence[ExaminedVisit], found: Sequence[ComparedQuantity]) -> list[str]:
    """Return what a person should know of the intervals."""
    notes = []
    if few := [one for one in found if one.why is Untested.FEW_CYCLES]:
        notes.append(
            f"{len(few)} quantities have fewer than {FEWEST_STRIDES} cycles in the first or the last visit: they have "
            "no interval and are never told to have changed."
        )
    dates = [one.date for one in visits]
    # ISO dates in the order of their letters are in the order of time
    if all(dates) and dates != sorted(dates):
        notes.append("The visits are not in the order of their dates; a change is the last one given less the first.")
    if len({one.moved.parameters for one in visits}) > 1:
        notes.append(
            "Moments and powers were computed with identified inertial parameters in one visit and the table's in "
            "another: a part of their changes may come from that."
        )
    return notes

"""Two or more visits of one person side by side: what changed from the first to the last beyond its uncertainty."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from biodance import display
from biodance.cycles.curves import CurveGroup, group_curves
from biodance.errors import SessionRefused
from biodance.lab.session.read import read_session, visit_words
from biodance.lab.session.recordings import ANOTHER_STATURE
from biodance.pipeline.attention import corrected_attention, session_attention
from biodance.pipeline.body import refuse_another_reference
from biodance.pipeline.diagnosis import diagnosed_and_corrected
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.load import as_diagnosed
from biodance.pipeline.movement import SessionMovement, session_movement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine, identification_of
from biodance.pipeline.visit_quantities import ComparedQuantity, Untested, cycle_quantities, mass_quantities
from biodance.records import Session
from biodance.records.attention import Attention
from biodance.uncertainty.visits import FEWEST_STRIDES, beyond_chance


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
    """What changed between visits of one person.

    Parameters
    ----------
    visits : tuple of ExaminedVisit
        In the order given; a change is the last less the first.
    quantities : tuple of ComparedQuantity
        Those that changed beyond their uncertainty first, the surest first of all.
    notes : tuple of str
        What is not in the intervals, and what could not be compared.
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
    """Return the sessions of one person's visits, as read.

    Parameters
    ----------
    folders : sequence of str or pathlib.Path
        Their folders, at least two, the earliest first.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    tuple of Session
        In the same order.

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
    """Return what changed from the first to the last visit of one person.

    Parameters
    ----------
    sessions : sequence of Session
        Two or more visits, as `read_visits` returns them.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    VisitComparison
        Every quantity that the first and the last visit have in common: key values of angles (deg), moments (N·m/kg)
        and powers (W/kg), spatio-temporal values, masses of the segments and of the whole body (kg).

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
    names = _names(sessions)
    visits = tuple(_examined(one, name, tell) for one, name in zip(sessions, names, strict=True))
    for later in visits[1:]:
        _refuse_other_legs(visits[0], later)
    masses, why = mass_quantities(
        [(one.identified, one.result.weighed) for one in visits], [one.unweighed for one in visits], tell=tell
    )
    found = [*cycle_quantities([one.moved for one in visits]), *masses]
    if not found:
        raise SessionRefused(
            f"{names[0]} and {names[-1]} have no quantity in common: no cycle of one kind on one side, and no mass. "
            "Give visits with the same kind of movement."
        )
    told = beyond_chance([one.p for one in found])
    marked = [replace(one, changed=bool(change)) for one, change in zip(found, told, strict=True)]
    ordered = sorted(marked, key=lambda one: (not one.changed, -one.distance if one.changed else 0.0))
    return VisitComparison(visits, tuple(ordered), (*why, *_notes(visits, marked)))


def _names(sessions: Sequence[Session]) -> list[str]:
    """Return the names of the folders, with the folder above where two are alike."""
    own = [one.folder.resolve().name for one in sessions]
    return own if len(set(own)) == len(own) else ["/".join(one.folder.resolve().parts[-2:]) for one in sessions]


def _examined(session: Session, name: str, tell: Callable[[str], None]) -> ExaminedVisit:
    """Return one visit after all stages, without what its diagnosis proves to be wrong with the plates."""

    def tell_visit(what: str) -> None:
        tell(f"{name}: {what}")

    result, found = diagnosed_and_corrected(examine(session, tell=tell_visit), tell=tell_visit)
    result = as_diagnosed(result, found.diagnosis) if found else result
    said = (*found.diagnosis.attention, *corrected_attention(result)) if found else session_attention(result)
    identified, unweighed = _body_told(result, name)
    date = visit_words(session.folder, [one.name for one in session.trials])["date"]
    acted = tuple(one for one in said if one.level != "note")
    return ExaminedVisit(name, date, result, session_movement(result, tell=tell_visit), identified, unweighed, acted)


def _body_told(result: SessionResult, name: str) -> tuple[SessionIdentification | None, str]:
    """Return what a visit says of the body, or why it says nothing."""
    try:
        found = identification_of(result)
    except SessionRefused as refused:
        return None, str(refused)
    if found.identification.status == "failed":
        return None, f"{name}: {found.identification.cause}"
    return found, ""


def _refuse_other_legs(first: ExaminedVisit, later: ExaminedVisit) -> None:
    known, body = first.result.body, later.result.body
    if known is not None and body is not None:
        refuse_another_reference(known, body, later.result.subject.mass, first.name)


def _notes(visits: Sequence[ExaminedVisit], found: Sequence[ComparedQuantity]) -> list[str]:
    """Return what a person should know of the intervals."""
    notes = []
    if few := [one for one in found if one.why is Untested.FEW_CYCLES]:
        notes.append(
            f"{len(few)} quantities have fewer than {FEWEST_STRIDES} cycles in the first or the last visit: they have "
            "no interval and are never told to have changed."
        )
    dates = [one.date for one in visits]
    if all(dates) and dates != sorted(dates):
        notes.append("The visits are not in the order of their dates; a change is the last one given less the first.")
    bodies = {one.moved.parameters for one in visits}
    if len(bodies) > 1:
        notes.append(
            "Moments and powers were computed with identified inertial parameters in one visit and the table's in "
            "another: a part of their changes may come from that."
        )
    return notes

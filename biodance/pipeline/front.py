"""What ``import biodance`` conducts: what an analyst asks of a visit; the commands call the same functions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from biodance import display
from biodance.body.body import Body
from biodance.discovery import Chosen
from biodance.effects import DiscreteEffect, Effect, causes
from biodance.identification.sessions import certain_changes, differences
from biodance.lab.session.read import read_session
from biodance.pipeline.body import refuse_another_reference
from biodance.pipeline.diagnosis import SessionDiagnosis, diagnose_session, diagnosed_and_corrected
from biodance.pipeline.front_dance import performance_of
from biodance.pipeline.identification import SessionIdentification, identify_trials
from biodance.pipeline.lab_file import read_lab
from biodance.pipeline.results import SessionResult
from biodance.pipeline.saved_results import known_body
from biodance.pipeline.session import by_paper, examine, identification_of
from biodance.records import Session
from biodance.uncertainty.tolerances import Tolerances

if TYPE_CHECKING:
    import pandas as pd

    from biodance.dance.dance import Dance

Visit: TypeAlias = Session | SessionResult | str | Path
"""A session: as read, as examined, or its folder."""
Earlier: TypeAlias = SessionIdentification | Visit
"""An earlier session: as identified, or anything that can be."""
_Tell: TypeAlias = Callable[[str], None]


def _silent(_: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True, eq=False)
class SessionComparison:
    """Two visits of one person, side by side.

    Parameters
    ----------
    earlier, later : SessionIdentification
        What each says by itself; ``later.changes`` are the differences, ``later.search`` the load looked for against
        ``earlier``.

    Examples
    --------
    >>> compared = biodance.compare_sessions(identified, identified)
    >>> compared
    SessionComparison('visit' -> 'visit': no certain change)
    """

    earlier: SessionIdentification
    later: SessionIdentification

    def __repr__(self) -> str:
        sure = certain_changes(self.later.changes)
        told = ", ".join(f"{one.segment} {one.quantity} {one.value:+.3g} {one.unit}" for one in sure)
        return f"SessionComparison({self.earlier.name!r} -> {self.later.name!r}: {told or 'no certain change'})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.table())

    def table(self) -> "pd.DataFrame":
        """Return one row for each quantity of each segment.

        Returns
        -------
        pandas.DataFrame
            segment, quantity, unit, difference (later less earlier), sd, low, high (95 %), p, known.

        Examples
        --------
        >>> compared = biodance.compare_sessions(identified, identified)
        >>> float(compared.table()["difference"].abs().max()) < 1e-6
        True
        """
        import pandas as pd

        rows = [(c.segment, c.quantity, c.unit, c.value, c.sd, *c.interval, c.p, c.known) for c in self.later.changes]
        return pd.DataFrame(
            rows, columns=["segment", "quantity", "unit", "difference", "sd", "low", "high", "p", "known"]
        )


def identify(
    session: Visit,
    *,
    reference: Earlier | None = None,
    dance: "Dance | str | Path | None" = None,
    body: Body | str | Path | None = None,
    lab: str | Path | None = None,
    method: Literal["posterior", "paper"] = "posterior",
    tell: _Tell = _silent,
) -> SessionIdentification:
    """Return what every segment of a person weighs, with intervals, validated on the trials kept.

    What the diagnosis proves to be wrong with signs, zeros, clocks and gains of the plates is taken off before.

    Parameters
    ----------
    session : Session, SessionResult, str or pathlib.Path
        The visit: as `read_session` or `examine` return it, or its folder.
    reference : SessionIdentification, Session, SessionResult, str or pathlib.Path, optional
        An earlier visit of the same person without load: a load is then looked for against it instead of the table.
    dance : Dance, str or pathlib.Path, optional
        The dance that was shown (dance.npz): ``performance`` then says how well it was danced.
    body : Body, str or pathlib.Path, optional
        The same person's body of an earlier visit (body.json): what is known before, instead of the table.
    lab : str or pathlib.Path, optional
        The laboratory's lab.toml: its corrections are made first.
    method : {"posterior", "paper"}
        With intervals, or by the paper's quadratic programme, the posterior beside it (``posterior``).
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionIdentification
        ``identification.sip`` (N segments, kg, kg·m, kg·m² in the segments' joint frames) with covariance and `status`,
        the agreement of table and identified body with the plates on every trial, and the search for an added mass.

    Raises
    ------
    SessionRefused
        There is no trial to identify from, or the body is another person's; the message says why.
    FileRefused
        A file that was named is none of its kind.

    See Also
    --------
    diagnose : What the simulation gets wrong.

    References
    ----------
    Bayesian linear regression of the ground wrench on the standard inertial parameters, physically consistent by linear
    matrix inequalities; docs/derivations.md.

    Examples
    --------
    >>> identified = biodance.identify(result)
    >>> identified  # doctest: +ELLIPSIS
    SessionIdentification('visit': solved, 12 segments, 61... kg)
    """
    before = None if reference is None else _earlier(reference, tell)
    result = examined_visit(session, reference=before, body=body, lab=lab, tell=tell)
    result, _ = diagnosed_and_corrected(result, reference=before, tolerances=read_lab(lab).tolerances, tell=tell)
    found = identification_of(by_paper(result) if method == "paper" else result)
    return found if dance is None else replace(found, performance=performance_of(result, dance))


def diagnose(
    session: Visit,
    *,
    reference: Earlier | None = None,
    effects: Chosen[Effect | DiscreteEffect | type[Effect | DiscreteEffect]] = None,
    tolerances: Tolerances | None = None,
    body: Body | str | Path | None = None,
    lab: str | Path | None = None,
    tell: _Tell = _silent,
) -> SessionDiagnosis:
    """Return what the simulation of a visit gets wrong: cause, size, how sure, what else it could be, and what naming
    it gains.

    Parameters
    ----------
    session : Session, SessionResult, str or pathlib.Path
        The visit: as `read_session` or `examine` return it, or its folder.
    reference : SessionIdentification, Session, SessionResult, str or pathlib.Path, optional
        An earlier visit of the same person without fault or load: the body is then known ten times better than from the
        table.
    effects : iterable, optional
        The causes to look for, by name or as objects of your own; by default all.
    tolerances : Tolerances, optional
        Of everything that is no fault, as learned by a laboratory.
    body : Body, str or pathlib.Path, optional
        The same person's body of an earlier visit (body.json): what is known before, instead of the table.
    lab : str or pathlib.Path, optional
        The laboratory's lab.toml: its corrections are made first, and its tolerances hold where it has any.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionDiagnosis
        Its `verdict` is "nothing wrong", "named, complete", "named, incomplete" or "unexplained"; `findings` and
        `table` name the causes.

    Raises
    ------
    SessionRefused
        There is no trial to look at, and no check found a cause either.
    UnknownName
        There is no such effect; the legal names are listed.

    See Also
    --------
    identify : What the segments weigh.

    References
    ----------
    Candidate causes are ranked by Bayes factors under the tolerances of everything that is no fault;
    docs/derivations.md.

    Examples
    --------
    >>> found = biodance.diagnose(result)
    >>> found
    SessionDiagnosis(nothing wrong)
    """
    asked = causes(effects)
    before = None if reference is None else _earlier(reference, tell)
    result = examined_visit(session, reference=before, body=body, lab=lab, tell=tell)
    known = tolerances or read_lab(lab).tolerances
    result = result if before is None else _beside(result, before)
    return diagnose_session(result, reference=before, tolerances=known, effects=asked, tell=tell)


def compare_sessions(earlier: Earlier, later: Earlier, *, tell: _Tell = _silent) -> SessionComparison:
    """Return what changed in a person from an earlier visit to a later one.

    Parameters
    ----------
    earlier, later : SessionIdentification, Session, SessionResult, str or pathlib.Path
        Two visits of the same person.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionComparison
        Every difference of mass (kg), centre of mass (m) and inertia (kg·m²) with its 95 % interval, and the load
        looked for.

    Raises
    ------
    SessionRefused
        One of them has no trial to identify from.
    BiodanceError
        The two bodies have different segments.

    Examples
    --------
    >>> biodance.compare_sessions(identified, identified).table().shape
    (120, 9)
    """
    first, second = _earlier(earlier, tell), _earlier(later, tell)
    return SessionComparison(first, replace(second, changes=differences(first.identification, second.identification)))


def examined_visit(
    session: Visit,
    *,
    reference: SessionIdentification | None = None,
    body: Body | str | Path | None = None,
    lab: str | Path | None = None,
    tell: _Tell = _silent,
) -> SessionResult:
    """Return the visit with all stages done; one that was examined already is examined again only where ``body`` or
    ``lab`` change it.
    """
    carried, known = read_lab(lab), known_body(body)
    if isinstance(session, SessionResult) and known is None and not carried.corrections:
        return session if reference is None else _beside(session, reference)
    read = session.session if isinstance(session, SessionResult) else session
    read = read if isinstance(read, Session) else read_session(read, tell=tell)
    return examine(carried.corrected(read), reference=reference, known=known, tell=tell)


def _earlier(session: Earlier, tell: _Tell) -> SessionIdentification:
    """Return what a visit says about the body."""
    if isinstance(session, SessionIdentification):
        return session
    return identify(session, tell=tell)


def _beside(result: SessionResult, before: SessionIdentification) -> SessionResult:
    """Return an examined visit with its load looked for against an earlier one."""
    found = result.identification
    if result.body is None or found is None or found.search.reference == f"session {before.name}":
        return result
    refuse_another_reference(before.identification.body, result.body, result.subject.mass, before.name)
    name = result.session.folder.name
    again = identify_trials(
        result.body, result.trials, name=name, reference=before, checks=result.checks, prior=result.prior,
        corrections=result.corrections, weighed=result.weighed,
    )  # fmt: skip
    return replace(result, identification=replace(again, corrected=found.corrected))

"""What ``import biodance`` and the commands ask of a visit, with markers and forces registered first."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from biodance import display
from biodance.body.body import Body
from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.problem import TrialWindow
from biodance.discovery import Chosen
from biodance.effects import DiscreteEffect, Effect, causes
from biodance.errors import SessionRefused, TrialRefused
from biodance.identification.sessions import certain_changes, differences
from biodance.lab.readers import read_trial
from biodance.lab.session.read import read_session
from biodance.motion.dynamics import predict_wrench
from biodance.motion.soles import soles_from_body
from biodance.motion.track import track
from biodance.pipeline.body import body_of, refuse_another_reference
from biodance.pipeline.diagnosis import diagnose_session, diagnosed_and_corrected
from biodance.pipeline.front_dance import with_performance
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.lab_file import read_lab
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.saved_results import known_body
from biodance.pipeline.session import by_paper, followed, identification_of, identify_result
from biodance.pipeline.trial import Step, prepare_trial
from biodance.records import Motion, Session, Trial
from biodance.registration import Limits, Registration, concluded, registered_folder, rival_delays, write_registered
from biodance.registration.alignment import Alignment, Forces, alignments, forces_of, registered_plates
from biodance.registration.refinement import floor_of, refined, with_height
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import Tolerances

if TYPE_CHECKING:
    import pandas as pd

    from biodance.dance.dance import Dance


Visit: TypeAlias = Session | SessionResult | str | Path
"""A session: as read, as examined, or its folder."""
Earlier: TypeAlias = SessionIdentification | Visit
"""An earlier session: as identified, or anything that can be."""
_Tell: TypeAlias = Callable[[str], None]


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
    tell: _Tell = lambda _: None,
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
    before = _earlier(reference, tell) if reference is not None else None
    result = followed_visit(session, reference=before, body=body, lab=lab, tell=tell)
    known = read_lab(lab).tolerances
    done = identified_visit(result, reference=before, tolerances=known, dance=dance, method=method, tell=tell)
    return identification_of(done)


def identified_visit(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    dance: "Dance | str | Path | None" = None,
    method: Literal["posterior", "paper"] = "posterior",
    tell: _Tell = lambda _: None,
) -> SessionResult:
    """Return a visit that was `followed` with what `identify` returns. Raises SessionRefused: there is no trial to
    identify from.
    """
    result, _ = diagnosed_and_corrected(result, reference=reference, tolerances=tolerances, tell=tell)
    result = by_paper(result) if method == "paper" else result
    identification_of(result)
    return result if dance is None else with_performance(result, dance)


def diagnose(
    session: Visit,
    *,
    reference: Earlier | None = None,
    effects: Chosen[Effect | DiscreteEffect | type[Effect | DiscreteEffect]] = None,
    tolerances: Tolerances | None = None,
    body: Body | str | Path | None = None,
    lab: str | Path | None = None,
    tell: _Tell = lambda _: None,
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
    result = followed_visit(session, reference=before, body=body, lab=lab, tell=tell)
    known = tolerances or read_lab(lab).tolerances
    result = result if before is None else _beside(result, before)
    return diagnose_session(result, reference=before, tolerances=known, effects=asked, tell=tell)


def compare_sessions(earlier: Earlier, later: Earlier, *, tell: _Tell = lambda _: None) -> SessionComparison:
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


def followed_visit(
    session: Visit,
    *,
    reference: SessionIdentification | None = None,
    body: Body | str | Path | None = None,
    lab: str | Path | None = None,
    tell: _Tell = lambda _: None,
) -> SessionResult:
    """Return the visit `followed`; one that was examined only where ``body`` or ``lab`` change it."""
    carried, known = read_lab(lab), known_body(body)
    # nothing that would change an examination that was made: it is not made again
    if isinstance(session, SessionResult) and known is None and not carried.corrections:
        return session if reference is None else _beside(session, reference)
    read = session.session if isinstance(session, SessionResult) else session
    read = read if isinstance(read, Session) else read_session(read, tell=tell)
    return followed(carried.corrected(read), reference=reference, known=known, tell=tell)


def _earlier(session: Earlier, tell: _Tell) -> SessionIdentification:
    return session if isinstance(session, SessionIdentification) else identify(session, tell=tell)


def _beside(result: SessionResult, before: SessionIdentification) -> SessionResult:
    """Return an examined visit with its load looked for against an earlier one."""
    found = result.identification
    if result.body is None or found is None or found.search.reference == f"session {before.name}":
        return result
    refuse_another_reference(before.identification.body, result.body, result.subject.mass, before.name)
    again = identify_result(result, result.body, before)
    return replace(result, identification=replace(again, corrected=found.corrected))


_RAISED = 0.03
"""m by which the height found under the feet may differ from the floor before lags are searched again."""


@dataclass(frozen=True, eq=False)
class _Moving:
    """The ``session`` of the markers, its trial as ``recorded`` and prepared, the ``body`` and its ``motion``."""

    session: Session
    recorded: Trial
    trial: Trial
    body: Body
    motion: Motion


@one_thread()
def register(
    markers: str | Path,
    forces: str | Path,
    out: str | Path | None = None,
    *,
    limits: Limits | None = None,
    rough: bool = False,
    force: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> Registration:
    """Find where the plates of a force file lie in the room of a marker file, and how late its clock is, from the
    movement itself.

    Parameters
    ----------
    markers : str or pathlib.Path
        A marker file (a static trial and session.toml beside it are used), or the folder of such a session.
    forces : str or pathlib.Path
        A force file in its own frame and clock; of several plates the places relative to one another are kept.
    out : str or pathlib.Path, optional
        Where to write the session with markers and plates in one C3D file; nothing is written where it is refused.
    limits : Limits, optional
        How exact the pose must be; by default 5 mm, 10 mm, 0.5 degrees and 5 ms.
    rough : bool
        Also write what is known less exactly than that.
    force : bool
        Overwrite a session that this function wrote.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    Registration
        FramePose of every plate and delay with standard deviations; `status` and `reason`.

    Raises
    ------
    FileRefused, SessionRefused, TrialRefused
        A file cannot be read, there is no body or no motion, or ``out`` may not be written.

    References
    ----------
    Procrustes alignment for every delay, then generalised least squares on the spectrum of the ground wrench and on the
    pressure in the feet; docs/derivations.md.

    Examples
    --------
    >>> registered = biodance.register("visit/dance_1.c3d", "visit/dance_1.c3d")
    >>> registered.status
    'registered'
    """
    folder = None if out is None else registered_folder(Path(out), force=force)
    tell("reading")
    recorded = read_trial(forces)
    moving = _moving(Path(markers), Path(forces), tell)
    measured = forces_of(recorded, moving.trial.settings)
    tell("looking for the delay")
    try:
        hypotheses = _hypotheses(moving, measured)
        tell("refining the pose")

        # what is no fault in a look, with the noise of its own cameras and of the plates as recorded
        def judge(window: TrialWindow) -> Tolerances:
            seen = replace(window.trial, plates=recorded.plates)
            return own_tolerances(moving.body, (window,), (seen,)).tolerances

        refine = partial(refined, moving.body, moving.trial, moving.motion, measured, tolerances=judge)
        found = refine(hypotheses[0].pose)
        others = rival_delays(hypotheses, found, refine)
    except TrialRefused as why:
        return Registration("refused", str(why))
    registration = concluded(measured, hypotheses[0], found, others, limits=limits or Limits(), rough=rough)
    if folder is not None and registration.status != "refused":
        tell("writing the session")
        assert registration.pose is not None
        plates = registered_plates(recorded.plates, registration.pose)
        write_registered(folder, moving.session, moving.recorded, plates, said=registration.document())
    return registration


def _moving(markers: Path, forces: Path, tell: Callable[[str], None]) -> _Moving:
    """Return the body and its motion in the marker file, or in the one moving trial of a folder."""
    session = read_session(markers if markers.is_dir() else markers.parent, tell=tell)
    chosen = _chosen(session, markers, forces)
    statics = [trial for trial in session.of_role("static") if trial is not chosen]
    bare = [replace(trial, plates=()) for trial in (*statics, replace(chosen, role="fit"))]
    read = tuple(prepare_trial(trial) for trial in bare)
    for one in read:
        if not one.usable:
            raise TrialRefused(one.steps[-1].text)
    tell("tracking the body")
    steps: list[Step] = []
    body, source = body_of(session.subject, read, session.settings, steps)
    if body is None:
        raise SessionRefused(f"{markers}: {source} {' '.join(step.text for step in steps)}".strip())
    return _Moving(session, chosen, read[-1].trial, body, track(body, read[-1].trial))


def _chosen(session: Session, markers: Path, forces: Path) -> Trial:
    """Return the trial of a marker file; in a folder the moving one called as the force file, else the only one."""
    if not markers.is_dir():
        same = [trial for trial in session if trial.source.path.resolve() == markers.resolve()]
        if not same:
            why = session.refused.get(markers.name, "it has the role skip, or another file of this name was read.")
            raise SessionRefused(f"{markers}: was not read: {why}")
        return same[0]
    moving = [trial for trial in session if trial.role != "static" and trial.markers is not None]
    alike = [trial for trial in moving if trial.name.lower() == forces.stem.lower()] or moving
    if len(alike) != 1:
        names = ", ".join(trial.name for trial in moving) or "none"
        raise SessionRefused(
            f"{markers}: holds {len(moving)} moving trials ({names}), and none is called {forces.stem}. Give the "
            "marker file that belongs to the forces."
        )
    return alike[0]


def _hypotheses(moving: _Moving, measured: Forces) -> tuple[Alignment, ...]:
    """Return the hypotheses with the height that the soles ask for."""
    needed, soles = predict_wrench(moving.body, moving.motion).value, soles_from_body(moving.body, moving.motion)
    floor = floor_of(soles)
    found = alignments(moving.motion, needed, measured, floor=floor)
    pose = with_height(found[0].pose, soles, measured)
    raised = float(pose.shift[2] - found[0].pose.shift[2])
    # the lags were searched with the soles on another floor than the plates turn out to have
    if abs(raised) > _RAISED:
        found = alignments(moving.motion, needed, measured, floor=floor + raised)
        pose = with_height(found[0].pose, soles, measured)
    return (replace(found[0], pose=pose), *found[1:])

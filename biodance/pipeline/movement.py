"""What moved in a visit, with the parameters that the visit identified; and what may be said to the person measured.

A mass is said to the person only where the session was identified, no check failed, no lasting doubt about the body is
left and the diagnosis found nothing wrong. A posture that the markers leave open is no such check: its frames are left
out of the identification, so that it makes intervals wider and no number wrong.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from biodance import display
from biodance.body.body import Body
from biodance.body.human.conventional import ConventionalModel, conventional_model
from biodance.cycles import TrialMovement
from biodance.cycles.scores import GaitScores, gait_scores, gait_vectors
from biodance.cycles.strides import STRIDE_UNITS
from biodance.cycles.summary import Repetitions, repetitions_of
from biodance.errors import BiodanceError
from biodance.identification.knowledge import SIGMAS, known_together
from biodance.lab.session.file import VisitEntry, read_session_file
from biodance.lab.session.read import read_session
from biodance.motion.newton import QuietStanding
from biodance.pipeline.lab_file import NO_LAB, HealthyReference, read_lab
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.session import examine
from biodance.pipeline.trial import OPEN, movement_of
from biodance.records import Session, Subject, by_name
from biodance.settings import STANDARD_GRAVITY
from biodance.threads import one_thread
from biodance.uncertainty.tolerances import shipped

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class SessionMovement:
    """What moved in a visit; ``moved["walk_1"]`` is one trial.

    Parameters
    ----------
    name : str
        Of the session.
    trials : tuple of TrialMovement
        Of all trials that give a motion.
    parameters : {"identified", "table"}
        Whose inertial parameters the moments and powers are computed with: the identified ones where trials kept from
        the fit prove them better (`SessionIdentification.proven`).
    mass : float
        kg that moments and powers are divided by: of that body.
    left_out : mapping
        Trial -> why nothing is told of its movement.
    healthy : HealthyReference
        Bands of the laboratory's own people to be shown behind, and what scores are told against (`learn_laboratory`).

    Examples
    --------
    >>> biodance.describe_movement(result)
    SessionMovement('visit': squat_1 3 squats)
    """

    name: str
    trials: tuple[TrialMovement, ...]
    parameters: str
    mass: float
    left_out: dict[str, str]
    healthy: HealthyReference = NO_LAB

    def __repr__(self) -> str:
        said = ", ".join(f"{one.trial} {one.told}" for one in self.trials if one.cycles)
        return f"SessionMovement({self.name!r}: {said or 'no repetition in any trial'})"

    def _repr_html_(self) -> str:
        return display.card(repr(self), self.spatiotemporal(), [f"{k}: {v}" for k, v in self.left_out.items()])

    def __getitem__(self, trial: str) -> TrialMovement:
        """Return the movement of one trial; UnknownName lists all names."""
        return by_name(self.trials, trial, f"trial with a movement of session {self.name}")

    def __iter__(self) -> Iterator[TrialMovement]:
        return iter(self.trials)

    @cached_property
    def repetitions(self) -> Mapping[str, Repetitions]:
        """All good repetitions over all trials, by kind ("gait", "squat", "sit_to_stand", "jump"), those there are."""
        kinds = dict.fromkeys(cycle.kind for one in self.trials for cycle in one.cycles)
        return {kind: repetitions_of(kind, self.trials) for kind in kinds}

    @property
    def gait(self) -> Repetitions | None:
        """All good gait cycles; None where nobody walks."""
        return self.repetitions.get("gait")

    @cached_property
    def scores(self) -> tuple[GaitScores | None, GaitScores | None, GaitScores | None]:
        """Gait scores of our angles, the files', and the conventional gait model's, over the cycles of which the files
        hold all angles where there are any; None without a reference.
        """
        if self.gait is None:
            return None, None, None
        ours = gait_scores(self.gait.curves, self.healthy.normal, self.healthy.deviation)
        beside = gait_scores(self.gait.file_curves, self.healthy.beside)
        same = gait_vectors(self.gait.file_curves)  # of the same steps, so that they can be compared
        conventional = [one for one in self.gait.conventional_curves if not same or one.cycle in same]
        return ours, beside, gait_scores(conventional, self.healthy.beside)

    def table(self) -> "pd.DataFrame":
        """Return mean and sd of every curve of every trial.

        Returns
        -------
        pandas.DataFrame
            As `TrialMovement.table`, with the trial in front.

        Examples
        --------
        >>> set(biodance.describe_movement(result).table()["trial"])
        {'squat_1'}
        """
        import pandas as pd

        parts = [one.table() for one in self.trials]
        for one, part in zip(self.trials, parts, strict=True):
            part.insert(0, "trial", one.trial)
        some = [part for part in parts if len(part)] or parts[:1]
        return pd.concat(some, ignore_index=True) if some else pd.DataFrame(columns=["trial"])

    def spatiotemporal(self) -> "pd.DataFrame":
        """Return the spatio-temporal values of walking.

        Returns
        -------
        pandas.DataFrame
            trial, quantity, unit, side, mean, sd, count; no rows where nobody walks.

        Examples
        --------
        >>> len(biodance.describe_movement(result).spatiotemporal())
        0
        """
        import pandas as pd

        rows = [{"trial": one.trial, **row} for one in self.trials for row in spatiotemporal_rows(one)]
        return pd.DataFrame(rows, columns=["trial", *_SPREAD])


_SPREAD = ("quantity", "unit", "side", "mean", "sd", "count")


def spatiotemporal_rows(one: TrialMovement) -> list[dict[str, Any]]:
    """Return the spatio-temporal values of a trial, a row for each quantity of both feet and of either."""
    return [
        dict(zip(_SPREAD, (name, STRIDE_UNITS[name], side, *values), strict=True))
        for side in ("both", "left", "right")
        for name, values in one.spatiotemporal(side).items()
    ]


@one_thread()
def describe_movement(
    session: Session | SessionResult | str | Path,
    *,
    lab: str | Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionMovement:
    """Return what moved in every trial of a visit: events, cycles, angles, moments, powers, spatio-temporal values.

    Parameters
    ----------
    session : Session, SessionResult, str or pathlib.Path
        The visit: as `read_session` or `examine` return it, or its folder.
    lab : str or pathlib.Path, optional
        The laboratory's lab.toml, for the normal bands that it learned.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionMovement
        ``moved["walk_1"].curve("knee_flexion", "left")`` holds all repetitions over 0 to 100 % with mean and sd, in
        degrees; moments in N·m/kg and powers in W/kg with what the inertial parameters leave uncertain in them.

    Raises
    ------
    SessionRefused
        The folder holds no session.

    See Also
    --------
    examine : All stages of a visit.

    References
    ----------
    Joint axes: Wu et al. 2002, doi:10.1016/S0021-9290(01)00222-6. Events: Zeni et al. 2008,
    doi:10.1016/j.gaitpost.2007.07.007. Pelvis: Baker 2001, doi:10.1016/S0966-6362(00)00083-7.

    Examples
    --------
    >>> moved = biodance.describe_movement(result)
    >>> bool(moved["squat_1"].curve("knee_flexion", "left").mean.max() > 60)
    True
    """
    if not isinstance(session, SessionResult):
        read = session if isinstance(session, Session) else read_session(session, tell=tell)
        session = examine(read, tell=tell)
    healthy, body = read_lab(lab), session.body
    sip = session.identification.proven if session.identification else None
    trials, left_out, conventional = [], {}, _conventional_model(session)
    for k, one in enumerate(session.trials, 1):
        tell(f"describing {one.name}, {k} of {len(session.trials)}")
        try:
            trials.append(movement_of(one, body, sip, conventional))
        except BiodanceError as why:
            left_out[one.name] = str(why)
    # moments and powers are divided by the mass of the body that they are computed with
    used = sip if sip is not None else body.sip if body else None
    kg = float(used.mass.sum()) if used is not None else float("nan")
    parameters = "table" if sip is None else "identified"
    return SessionMovement(session.session.folder.name, tuple(trials), parameters, kg, left_out, healthy)


def _conventional_model(session: SessionResult) -> ConventionalModel | None:
    """Return the conventional gait model by the first static trial that has what it needs; None without one."""
    for one in session.trials:
        if one.trial.role == "static":
            with suppress(BiodanceError):
                return conventional_model(session.subject, one.trial)
    return None


WHY_STOPPED, WHY_NOTHING, WHY_IMPOSSIBLE = "the run was stopped", "nothing to identify from", "no possible body"
WHY_DOUBTED, WHY_FAULTY = "doubts about the body", "something wrong in the recording"
"""Reasons for withholding beside the names of checks."""


@dataclass(frozen=True)
class PartMass:
    """The mass of ``segments`` (one, or several that are only known together): ``low`` to ``high`` kg, a 95 % interval,
    or ``measured`` False where the session does not tell it (then both are NaN); ``sure`` False where the table still
    says half of it.
    """

    segments: tuple[str, ...]
    low: float = float("nan")
    high: float = float("nan")
    sure: bool = True

    @property
    def measured(self) -> bool:
        """Whether there is a range to show."""
        return bool(np.isfinite(self.low))


@dataclass(frozen=True, eq=False)
class SubjectAccount:
    """All that the subject's page shows: ``subject`` and ``visit`` as declared; ``moved`` all good repetitions of what
    was done most, or None; ``weight`` kg, a 95 % interval of the
    whole body on the plates (NaN = not told); ``parts`` in the body's order, () where masses are withheld; ``together``
    of parts that are known only as a sum; ``withheld`` why no mass is said, () where they are; ``body`` to draw.
    """

    subject: Subject
    visit: VisitEntry
    weight: tuple[float, float] = (float("nan"), float("nan"))
    parts: tuple[PartMass, ...] = ()
    together: PartMass | None = None
    withheld: tuple[str, ...] = ()
    body: Body | None = field(default=None)
    moved: Repetitions | None = None


def account_for(
    result: SessionResult, diagnosis: SessionDiagnosis | None = None, movement: SessionMovement | None = None
) -> SubjectAccount:
    """Return what the subject may be told of a session, of its ``diagnosis`` and its ``movement`` where they were made.
    Raises SessionRefused: ``session.toml`` cannot be read.
    """
    visit = read_session_file(result.session.folder).visit
    withheld, kinds = _withheld(result, diagnosis), movement.repetitions.values() if movement else ()
    moved = max((one for one in kinds if one.good), key=lambda one: len(one.good), default=None)
    if withheld or result.identification is None:
        return SubjectAccount(result.subject, visit, withheld=withheld, body=result.body, moved=moved)
    one, standing = result.identification.identification, result.standing
    masses = tuple(  # none where the session cannot know it
        PartMass((known.segment,))
        if known.verdict == "cannot be known"
        else PartMass((known.segment,), max(known.interval[0], 0.0), known.interval[1], known.verdict == "known")
        for known in one.known
        if known.quantity == "mass"
    )
    weight = _weight(standing) if standing else SubjectAccount.weight
    sums = known_together(one.sip)
    together = None
    if sums and not masses[0].measured:
        pair, reach = sums[0], SIGMAS * sums[0].sd
        together = PartMass(pair.segments, pair.mass - reach, pair.mass + reach)
    return SubjectAccount(result.subject, visit, weight, masses, together, body=result.body, moved=moved)


def _weight(standing: QuietStanding) -> tuple[float, float]:
    """Return the 95 % interval, kg, of who stands: plates sway with the person, and err by their gains and zeros."""
    known = shipped()
    # sd² = sway² + (gain m)² + P (zero / g)²: the readings of all P plates are summed.
    zeros = np.sqrt(len(standing.plates)) * known.size("plate_offset Fz") / STANDARD_GRAVITY
    sd = np.linalg.norm([standing.mass_sd, standing.mass * known.size("plate_gain Fz"), zeros])
    reach = SIGMAS * float(sd)
    return standing.mass - reach, standing.mass + reach


def _withheld(result: SessionResult, diagnosis: SessionDiagnosis | None) -> tuple[str, ...]:
    """Return every reason why no mass may be said: failed checks by name, each once."""
    found = result.identification
    reasons = [WHY_STOPPED] if result.stopped else []
    if found is None:
        reasons.append(WHY_NOTHING)
    elif found.identification.status == "failed":
        reasons.append(WHY_IMPOSSIBLE)
    reasons += [check.what for check in result.all_checks if not check.inside and check.what != OPEN]
    reasons += [WHY_DOUBTED] if result.doubts else []
    if diagnosis and not diagnosis.diagnosis.is_clean:
        reasons.append(WHY_FAULTY)
    return tuple(dict.fromkeys(reasons))

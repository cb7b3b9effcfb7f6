"""What may be said to the person who was measured: which body parts' masses the session carries, or why none is said.

The rule is one of withholding: a mass stands here only where the session was identified, no check failed, no lasting
doubt about the body is left and the diagnosis found nothing wrong. A posture that the markers leave open is no such
check: its frames are left out of the identification, so that it makes intervals wider and no number wrong.
"""

from dataclasses import dataclass, field

import numpy as np

from biodance.body.body import Body
from biodance.cycles.summary import Repetitions
from biodance.identification.knowledge import SIGMAS, known_together
from biodance.lab.session.file import VisitEntry, read_session_file
from biodance.motion.newton import QuietStanding
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.pipeline.trial_result import OPEN
from biodance.records import Subject
from biodance.settings import STANDARD_GRAVITY
from biodance.uncertainty.tolerances import shipped

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

"""What a diagnosis ends with and why it says no more: enums, which are compared; words are made for the reader alone
(`pipeline.words`).
"""

from collections.abc import Collection
from enum import StrEnum


class DiagnosisStatus(StrEnum):
    """Nothing is wrong, something is named, something is wrong that nobody can name, or nobody can tell."""

    CLEAN = "clean"
    NAMED = "named"
    UNKNOWN = "unknown"
    CANNOT_TELL = "cannot tell"


class Reason(StrEnum):
    """Why a diagnosis says no more than it does."""

    ONLY_STANDING = "only standing"
    """Nothing but quiet standing could be compared with the whole body: it names no cause that has a size."""
    NOT_COMPARED = "not compared"
    """No movement could be compared with a body."""
    MOVEMENT_NOT_JUDGED = "movement not judged"
    """None of the movement could be judged, not even by its steps."""
    PERSON_UNKNOWN = "person unknown"
    """Mass or stature is not known, so there is no body."""
    BODY_NOT_SCALED = "body not scaled"
    """No static trial scales the body: its joints lie where stature or one frame of a movement puts them."""
    BODY_DOUBTFUL = "body doubtful"
    """What was measured or declared of the body contradicts itself; forces fit a wrong body as well."""
    UNDESCRIBED_JOINTS = "undescribed joints"
    """The body moves at joints for which nobody has learned yet what is usual."""
    TOLERANCES_DO_NOT_HOLD = "tolerances do not hold"
    """The markers move more on the body than where tolerances were learned."""
    CONTRADICTED = "contradicted"
    """What the simulation would name is contradicted by Newton or by kept data, or rests on a single step."""
    NOT_SURE = "not sure"
    """That something matters is more probable than not, and no cause is probable enough to be named."""
    UNUSUAL_BODY = "unusual body"
    """The forces fit only a body that is more unlike the table than people are."""
    OUTSIDE_TOLERANCES = "outside tolerances"
    """They fit only if something that is small in every laboratory is many times as large here."""
    LIMIT_BROKEN = "limit broken"
    """Forces, markers or weight are outside their limit, and no finding explains it."""
    FORCES_LEFT = "forces left"
    """What is left of the forces matters and is unlike sessions without fault."""


DOUBTS = frozenset(
    (
        Reason.ONLY_STANDING,
        Reason.NOT_COMPARED,
        Reason.MOVEMENT_NOT_JUDGED,
        Reason.PERSON_UNKNOWN,
        Reason.BODY_NOT_SCALED,
        Reason.BODY_DOUBTFUL,
        Reason.UNDESCRIBED_JOINTS,
        Reason.TOLERANCES_DO_NOT_HOLD,
        Reason.CONTRADICTED,
        Reason.NOT_SURE,
    )
)
"""Reasons for which no cause can be told, whatever is left."""
STRANGE = frozenset((Reason.UNUSUAL_BODY, Reason.OUTSIDE_TOLERANCES))
"""Reasons that alone speak of nothing wrong: how unlike the table people are, and how large what is small everywhere,
was learned from few laboratories, and clean sessions of others are beyond it.
"""


def status_of(reasons: Collection[Reason], *, named: bool, clean: bool) -> DiagnosisStatus:
    """Return what a diagnosis ends with: whether anything is ``named``, nothing is wrong (``clean``), or why neither
    is. Forces left beside a strange body or stretched tolerances are judged by norms that do not hold there: they prove
    something wrong only once a limit is broken.
    """
    if named or clean:
        return DiagnosisStatus.NAMED if named else DiagnosisStatus.CLEAN
    if Reason.LIMIT_BROKEN in reasons:
        return DiagnosisStatus.UNKNOWN
    unsure = not (STRANGE | DOUBTS).isdisjoint(reasons)
    return DiagnosisStatus.CANNOT_TELL if unsure else DiagnosisStatus.UNKNOWN

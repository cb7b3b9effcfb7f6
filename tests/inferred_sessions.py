"""What the posterior says of sessions without files: of trials as `diagnosed_sessions` makes them, and of what
observers hear.
"""

from collections.abc import Sequence

from biodance.body.body import Body
from biodance.diagnosis.diagnosis import Diagnosis
from biodance.diagnosis.problem import TrialWindow
from biodance.diagnosis.witness_evidence import ObservedEvidence, collect_evidence
from biodance.discovery import Chosen
from biodance.effects import DiscreteEffect, Effect, causes
from biodance.inference.decision import Inferred
from biodance.inference.session import judge, see
from biodance.records import Session, Sip
from biodance.uncertainty.tolerances import Tolerances, shipped

SILENT = ObservedEvidence((), {}, {}, {})
"""Nothing observed."""
BARE = Diagnosis(False, ())
"""Before any judgement."""


def inferred(
    body: Body,
    some: Sequence[TrialWindow],
    *,
    tolerances: Tolerances,
    effects: Chosen[Effect | DiscreteEffect] = None,
    evidence: ObservedEvidence = SILENT,
    prior: Sip | None = None,
) -> Inferred:
    """Return what trials say of the causes ``effects``, with the observations of an ``evidence``."""
    asked = causes(effects)
    seen = see(body, tuple(some), tolerances, asked, prior)
    return judge(seen, evidence, tolerances, asked, BARE)


def heard(session: Session, effects: Chosen[Effect | DiscreteEffect] = None) -> Inferred:
    """Return what the observations of a session say alone."""
    return heard_in(collect_evidence(session, effects), effects)


def heard_in(evidence: ObservedEvidence, effects: Chosen[Effect | DiscreteEffect] = None) -> Inferred:
    """Return what observations say alone."""
    return judge(None, evidence, shipped(), causes(effects), BARE)

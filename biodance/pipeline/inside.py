"""What the diagnosis proves to be wrong with signs, zeros, clocks and gains of the plates, taken off before the body is
fitted. What is only suspected stays as it was recorded.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.repairs import failed_check
from biodance.inference.decision import NAMED
from biodance.inference.hypotheses import Key
from biodance.lab.plates.faults import DELAY, GAIN, OFFSET
from biodance.pipeline.diagnosis import SessionDiagnosis, diagnosed
from biodance.pipeline.front_dance import performance_of
from biodance.pipeline.gains import accepted_corrections
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine, identification_of
from biodance.uncertainty.tolerances import Tolerances

if TYPE_CHECKING:
    from biodance.dance.dance import Dance

_KINDS = (OFFSET.name, DELAY.name, GAIN.name)
"""Causes that statistics find and that are taken off: zeros, clocks, gains."""


def diagnosed_and_corrected(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[SessionResult, SessionDiagnosis | None]:
    """Return an examined session identified without what its diagnosis proves to be wrong, and the diagnosis of the
    session as it was recorded (None where the recordings cannot carry one).
    """
    found = diagnosed(result, reference=reference, tolerances=tolerances, tell=tell)
    if found is None or result.corrections:
        return result, found
    return with_proven_corrections(result, found, reference=reference, tell=tell), found


def identified_visit(
    result: SessionResult,
    *,
    reference: SessionIdentification | None = None,
    tolerances: Tolerances | None = None,
    dance: "Dance | str | Path | None" = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return an examined session identified without what is proven to be wrong, and how well a ``dance`` was danced.

    Raises
    ------
    SessionRefused
        There is no identification; the message says why.
    """
    result, _ = diagnosed_and_corrected(result, reference=reference, tolerances=tolerances, tell=tell)
    found = identification_of(result)
    danced = found if dance is None else replace(found, performance=performance_of(result, dance))
    return replace(result, identification=danced)


def with_proven_corrections(
    result: SessionResult,
    found: SessionDiagnosis,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return the session examined again without what its diagnosis ``found`` proves: what checks undid in a copy, and
    zeros, delays and gains that are `proven`. Each of the latter is as unsure in the fit as the diagnosis says; the
    identification names them all (``corrected``). The same session where nothing is proven.
    """
    checks = found.mended.checks if found.mended else ()
    if any(one.alike for one in checks):
        return result
    undone = tuple(failed_check(one) for one in checks if not one.ok)
    named = {(one.effect, one.target) for one in undone}
    findings = found.inferred.diagnosis.findings if found.inferred else ()
    prior = found.inferred.search.prior if found.inferred else {}
    own = tuple(one for one in findings if proven(one, prior) and (one.effect, one.target) not in named)
    if not (undone or own):
        return result
    base = found.mended.result if found.mended else result
    if own:
        tell("identifying without what is proven to be wrong")
        corrections = accepted_corrections(own, f"session {result.session.folder.name}")
        base = examine(base.session, reference=reference, known=result.known, corrections=corrections)
    if base.identification is None:
        return result
    return replace(base, identification=replace(base.identification, corrected=(*undone, *own)))


def proven(one: Finding, prior: Mapping[Key, float]) -> bool:
    """Return whether a finding is taken off before the fit: a zero, a delay or a gain without which data that were not
    used for it fit better, and which is there with the probability `NAMED` rather than another cause of its set (of
    log ``prior`` probabilities by effect and target).
    """
    if one.effect not in _KINDS or one.gain is None or not one.gain.proven:
        return False
    logs = np.array([alias.log_bayes_factor + prior.get((alias.effect, alias.target), 0.0) for alias in one.set])
    same = np.array([alias.effect == one.effect for alias in one.set])
    shares = np.exp(logs - logs.max())
    return bool(one.probability * shares[same].sum() / shares.sum() >= NAMED)

"""What accepting the findings changes: the body is identified again from the corrected trials, and every finding gains
on its own what is lost on data that were not used when all findings but this one are accepted.

Those data are the trials that were kept; where none was, each half of the movement, judged with the body that the
other half gives. What makes them worse is no repair; where nobody moves, or the finding changes nothing, they tell
nothing of it.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import compress

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.accept import Residuals, accept, case_fit, gain_by_naming, join_residuals, residuals_of
from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.gain import Gain
from biodance.diagnosis.repairs import failed_check
from biodance.display import cause_in_words, spaced
from biodance.effects import Case, NamedCause
from biodance.errors import BiodanceError, NotSolved, TrialRefused
from biodance.identification.identification import Identification, identify_body
from biodance.identification.statistics import Fit, standing_point
from biodance.identification.unloaded_body import tables_by_sides
from biodance.inference.decision import NAMED, Inferred
from biodance.inference.hypotheses import Key
from biodance.inference.session import is_moving
from biodance.lab.corrections import PlateCorrection
from biodance.lab.plates.faults import DELAY, GAIN, OFFSET, PLATE_FAULTS
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES, SessionIdentification
from biodance.pipeline.judged_trials import cases_of, windows
from biodance.pipeline.results import MendedCopy, SessionDiagnosis, SessionResult
from biodance.pipeline.session import examine
from biodance.records import Array, Role, Sip

_Mend = Callable[[Case], Case]
_Fits = tuple[Fit, ...]
_SAME = 0.01
"""N, N·m: residuals that differ nowhere by more are the same."""


@dataclass(frozen=True, eq=False)
class _Corrected:
    """A session corrected for some causes: the body ``identified``, and what bodies leave of the data that were
    ``used`` for them and of those that were not (``kept``; both None where the movement is too short to be parted).
    """

    identified: Identification
    used: Residuals | None
    kept: Residuals | None


def accepted_corrections(findings: Iterable[Finding], source: str) -> tuple[PlateCorrection, ...]:
    """Return the ``findings`` that can be corrected in recordings, found in ``source``."""
    out = []
    for one in findings:
        fault = PLATE_FAULTS.get(one.effect)
        size = {p.name: p for p in one.parameters}.get(fault.parameter) if fault else None
        if size is not None and np.isfinite(size.value):
            out.append(PlateCorrection(one.effect, one.target, size.value, size.sd, source, one.trials))
    return tuple(out)


_INSIDE = (OFFSET.name, DELAY.name, GAIN.name)
"""Causes that statistics find and that are taken off before the body is fitted: zeros, clocks, gains."""


def with_proven_corrections(
    result: SessionResult,
    inferred: Inferred | None,
    mended: MendedCopy | None,
    *,
    reference: SessionIdentification | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> SessionResult:
    """Return the session examined again without what is proven: what checks undid in the copy ``mended``, and the
    zeros, delays and gains that are `proven` in ``inferred`` or known there as tolerances
    (`Inferred.known_tolerances`), each as unsure in the fit as there; a proven limb that is lighter than the other is
    fitted as a declared one. The identification names them all (``corrected``). The same session where there are none;
    what is only suspected stays.
    """
    checks = mended.checks if mended else ()
    if any(one.alike for one in checks):
        return result
    undone = tuple(failed_check(one) for one in checks)
    own: tuple[Finding, ...] = ()
    if inferred is not None:
        named = (f for f in inferred.diagnosis.findings if proven(f, inferred.search.prior))
        own = (*named, *(f for f in inferred.known_tolerances() if f.effect in _INSIDE))
    own = tuple(one for one in own if (one.effect, one.target) not in {(c.effect, c.target) for c in checks})
    base = mended.result if mended else result
    if own:
        tell("identifying without what is proven to be wrong")
        corrections = accepted_corrections(own, f"session {result.session.folder.name}")
        subject = reduce(lambda who, one: one.cause.declared(who, one.target), own, base.session.subject)
        session = replace(base.session, subject=subject)
        base = examine(session, reference=reference, known=result.known, corrections=corrections, earlier=base)
    if not (undone or own) or base.identification is None:
        return result
    return replace(base, identification=replace(base.identification, corrected=(*undone, *own)))


def proven(one: Finding, prior: Mapping[Key, float]) -> bool:
    """Return whether a finding is taken off before the fit: a zero, a delay, a gain or an unequal limb without which
    data that were not used for it fit better, and which is there with the probability `NAMED` rather than another cause
    of its set (of log ``prior`` probabilities by effect and target).
    """
    if not (one.effect in _INSIDE or one.cause.of_person()) or one.gain is None or not one.gain.proven:
        return False
    logs = np.array([alias.log_bayes_factor + prior.get((alias.effect, alias.target), 0.0) for alias in one.set])
    same = np.array([alias.effect == one.effect for alias in one.set])
    shares = np.exp(logs - logs.max())
    return bool(one.probability * shares[same].sum() / shares.sum() >= NAMED)


def accepted(result: SessionResult, inferred: Inferred, before: Identification) -> SessionDiagnosis:
    """Return the diagnosis with what accepting its findings changes against the identification ``before``. A finding
    whose own gain lies wholly at or below zero is taken back, the worst first, and the rest accepted again.
    """
    while inferred.diagnosis.findings:
        try:
            found = _accepted(result, inferred, before)
        except TrialRefused as why:  # named in standing, and no movement to identify from
            inferred = noted(inferred, f"What accepting the findings changes is not known. {why}")
            break
        except NotSolved as why:
            failures = {"what accepting changes": str(why)}
            return SessionDiagnosis(inferred.diagnosis, inferred, before, failures=failures)
        worst = _worthless(found.findings)
        if worst is None or found.inferred is None:
            return found
        inferred = noted(found.inferred.without(worst), _taken_back_words(found.findings[worst]))
    return SessionDiagnosis(inferred.diagnosis, inferred, before)


def noted(inferred: Inferred, *notes: str) -> Inferred:
    """Return the same with more ``notes`` for the reader."""
    return replace(inferred, diagnosis=replace(inferred.diagnosis, notes=(*inferred.diagnosis.notes, *notes)))


def _worthless(findings: tuple[Finding, ...]) -> int | None:
    """Return the finding with the lowest gain of those that only make worse what was not used; None without any."""
    gains = {k: one.gain.ci95 for k, one in enumerate(findings) if one.gain and one.gain.ci95[1] <= 0}
    return min(gains, key=lambda k: sum(gains[k])) if gains else None


def _phi(result: SessionResult, found: Inferred) -> Array:
    """Return the parameters (10N,) in use: those of the posterior, the table's where only observations judge."""
    assert result.body is not None
    phi = found.phi
    return phi if phi.size else result.body.sip.phi


def _taken_back_words(gone: Finding) -> str:
    """Return why a finding was taken back."""
    assert gone.gain is not None
    low, high = (-100 * x for x in reversed(gone.gain.ci95))
    name = cause_in_words(gone.effect, gone.target)
    return f"{name} was taken back: accepting it makes data that were not used {low:.0f} to {high:.0f} % worse."


def _accepted(result: SessionResult, inferred: Inferred, before: Identification) -> SessionDiagnosis:
    """Return what accepting the findings changes, with all gains."""
    phi, every = _phi(result, inferred), inferred.named
    found = _corrected(result, partial(accept, named=every), phi)
    as_is = _corrected(result, partial(accept, named=()), phi, before)
    findings = tuple(replace(one, changes=_changes(before, found.identified)) for one in inferred.diagnosis.findings)
    single, habits = len(every) == 1, (None,) * (len(findings) - len(every))  # a habit is nothing to accept
    gains = [
        _gain_of_person(result, inferred, k, before) if one.effect.of_person()
        else _gain(as_is if single else _without(result, inferred, k), found) if _acts(result, one) else None
        for k, one in enumerate(every)
    ]  # fmt: skip
    findings = tuple(replace(one, gain=gain) for one, gain in zip(findings, (*gains, *habits), strict=True))
    told = replace(inferred, diagnosis=replace(inferred.diagnosis, findings=findings))
    left = (as_is.kept, found.kept) if as_is.kept and found.kept else None
    gain = gains[0] if single else _gain(as_is, found)
    return SessionDiagnosis(told.diagnosis, told, before, found.identified, left, gain=gain)


def _gain_of_person(result: SessionResult, inferred: Inferred, index: int, before: Identification) -> Gain | None:
    """Return what a finding of the person gains against sides alike: by the halves of the movement, as trials that are
    kept move both sides alike (squats), and show nothing of one.
    """
    alike, rest = tables_by_sides(before)[0][0], inferred.without(index)
    try:
        return _gain(
            _corrected(result, partial(accept, named=rest.named), _phi(result, rest), prior=alike, halves=True),
            _corrected(result, partial(accept, named=inferred.named), _phi(result, inferred), halves=True),
        )
    except NotSolved:
        return None


def _without(result: SessionResult, inferred: Inferred, index: int) -> _Corrected | None:
    """Return the session corrected for all findings but one, their sizes fitted again; None where no body fits."""
    rest = inferred.without(index)
    try:
        return _corrected(result, partial(accept, named=rest.named), _phi(result, rest))
    except NotSolved:
        return None


def _acts(result: SessionResult, one: NamedCause) -> bool:
    """Return whether a cause does anything in the data by which its gain is judged: a touch that came and went before
    has nothing to gain there, and nothing to lose.
    """
    judged = windows(result.trials, KEPT_ROLES) or windows(result.trials, FITTED_ROLES)
    return not one.course or any(window.trial.name in one.course for window in judged)


def _gain(before: _Corrected | None, after: _Corrected) -> Gain | None:
    """Return what the second gains against the first on the data not used; None where these are too few, or the same
    is left of them.
    """
    if before is None or before.kept is None or after.kept is None or before.used is None or after.used is None:
        return None
    if all(np.allclose(a, b, rtol=0, atol=_SAME) for a, b in zip(before.kept.left, after.kept.left, strict=True)):
        return None
    try:
        return gain_by_naming(before.kept, after.kept, fitted=(before.used, after.used))
    except BiodanceError:
        return None


def _corrected(
    result: SessionResult, mend: _Mend, phi: Array, as_is: Identification | None = None, *,
    prior: Sip | None = None, halves: bool = False,
) -> _Corrected:  # fmt: skip
    """Return the session with every trial mended, seen with the parameters ``phi`` (10N,), and identified again, after
    ``prior`` where that is given; judged by the ``halves`` of the movement also where trials were kept. ``as_is``: the
    body identified from the trials as they are, where it is known.
    """
    body, fitted, judged = _mended(result, FITTED_ROLES, mend, phi)
    kept = () if halves else _mended(result, KEPT_ROLES, mend, phi)[2]
    found = as_is or identify_body(body, fitted, prior=prior)
    about = standing_point(kept or fitted)
    if not kept:
        return _Corrected(found, *(_by_halves(body, judged, about, prior) if judged else (None, None)))
    return _Corrected(found, *(residuals_of(found.identified, some, about) for some in (fitted, kept)))


def _mended(result: SessionResult, roles: tuple[Role, ...], mend: _Mend, phi: Array) -> tuple[Body, _Fits, _Fits]:
    """Return the body, the trials of the ``roles``, mended, and those of them by which a gain is judged, as causes are:
    somebody moves (sway and another body look like any fault of a plate while one stands), for a second and more.
    """
    assert result.body is not None
    found = windows(result.trials, roles)
    cases = [mend(replace(case, phi=phi)) for case in cases_of(result.body, found)]
    fits = tuple(case_fit(case, window.use) for case, window in zip(cases, found, strict=True))
    judged = [is_moving(case) and window.seconds > 0 for case, window in zip(cases, found, strict=True)]
    return (cases[0].body if cases else result.body), fits, tuple(compress(fits, judged))


def _by_halves(body: Body, fits: _Fits, about: Array, prior: Sip | None) -> tuple[Residuals | None, Residuals | None]:
    """Return what the body that each half of the movement gives leaves of that half, and of the other one; nothing
    where a half gives none.
    """
    first = np.cumsum(np.concatenate([fit.use for fit in fits]))
    early = np.split(2 * first <= first[-1], np.cumsum([fit.use.size for fit in fits])[:-1])
    parts = [
        tuple(replace(fit, use=fit.use & (there == now)) for fit, there in zip(fits, early, strict=True))
        for now in (True, False)
    ]
    halves = [tuple(fit for fit in half if fit.use.any()) for half in parts]
    try:
        bodies = [identify_body(body, half, prior=prior).identified for half in halves]
    except (TrialRefused, NotSolved):
        return None, None
    used, kept = (
        join_residuals(*(residuals_of(one, half, about) for one, half in zip(bodies, some, strict=True)))
        for some in (halves, halves[::-1])
    )
    return used, kept


def _changes(before: Identification, after: Identification) -> tuple[str, ...]:
    """Say which segment masses change most when the findings are accepted."""
    then, now = (dict(zip(one.sip.segments, one.sip.mass.tolist(), strict=True)) for one in (before, after))
    change = {name: now.get(name, 0.0) - mass for name, mass in then.items()}
    most = sorted(change, key=lambda name: -abs(change[name]))[:3]
    return tuple(
        f"{spaced(name)}: {then[name]:.2f} kg becomes {now.get(name, 0.0):.2f} kg"
        for name in most
        if abs(change[name]) >= 0.01
    )

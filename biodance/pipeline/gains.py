"""What accepting the findings changes: the body is identified again from the corrected trials, and every finding gains
on its own what is lost on data that were not used when all findings but this one are accepted.

Those data are the trials that were kept; where none was, each half of the movement, judged with the body that the
other half gives. What makes them worse is no repair, whoever named it (`combined_with_witnesses`).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.accept import Residuals, accept, case_fit, gain_by_naming, join_residuals, residuals_of
from biodance.diagnosis.combine_witnesses import SimulatedSize, combine_findings
from biodance.diagnosis.diagnosis import Diagnosis, Finding
from biodance.diagnosis.engine import Examined, without_name
from biodance.diagnosis.gain import Gain
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.naming import cause_key
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.diagnosis.witness_inference import infer_causes
from biodance.effects import Case
from biodance.errors import BiodanceError, NotSolved, TrialRefused
from biodance.identification.identification import Identification, identify_body
from biodance.identification.statistics import Fit, standing_point
from biodance.lab.corrections import PARAMETER_OF, PlateCorrection, corrected_trial
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES
from biodance.pipeline.judged_trials import cases_of, windows
from biodance.pipeline.results import SessionResult
from biodance.records import Array, Role

_Mend = Callable[[Case], Case]
_Fits = tuple[Fit, ...]


@dataclass(frozen=True, eq=False)
class Accepted:
    """A diagnosis whose findings were accepted: ``examined`` with the gain of each of them, the body ``identified``
    then (None without findings), what the body in use and this one ``left`` of the data not used, the ``gain`` of all
    together, and what could not be computed (``failures``).
    """

    examined: Examined
    identified: Identification | None = None
    left: tuple[Residuals, Residuals] | None = None
    gain: Gain | None = None
    failures: Mapping[str, str] = field(default_factory=dict)


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
        size = {p.name: p for p in one.parameters}.get(PARAMETER_OF.get(one.effect, ""))
        if size is not None and np.isfinite(size.value):
            out.append(PlateCorrection(one.effect, one.target, size.value, size.sd, source))
    return tuple(out)


def accepted(result: SessionResult, examined: Examined, before: Identification) -> Accepted:
    """Return what accepting the findings changes against the identification ``before``. A finding whose own gain lies
    wholly at or below zero is taken back, the worst first, and the rest accepted again.
    """
    while examined.diagnosis.findings:
        try:
            found = _accepted(result, examined, before)
        except TrialRefused as why:  # named in standing, and no movement to identify from
            return Accepted(noted(examined, f"What accepting the findings changes is not known. {why}"))
        except NotSolved as why:
            return Accepted(examined, failures={"what accepting changes": str(why)})
        worst = _worthless(found.examined.diagnosis.findings)
        if worst is None:
            return found
        examined = _taken_back(found.examined, worst)
    return Accepted(examined)


def noted(examined: Examined, *notes: str) -> Examined:
    """Return the same with more ``notes`` for the reader."""
    return replace(examined, diagnosis=replace(examined.diagnosis, notes=(*examined.diagnosis.notes, *notes)))


def _worthless(findings: tuple[Finding, ...]) -> int | None:
    """Return the finding with the lowest gain of those that only make worse what was not used; None without any."""
    gains = {k: one.gain.ci95 for k, one in enumerate(findings) if one.gain and one.gain.ci95[1] <= 0}
    return min(gains, key=lambda k: sum(gains[k])) if gains else None


def _taken_back(examined: Examined, index: int) -> Examined:
    """Return the diagnosis without one finding, which is only resembled, and say so."""
    return noted(without_name(examined, index), _taken_back_words(examined.diagnosis.findings[index]))


def _taken_back_words(gone: Finding) -> str:
    """Return why a finding was taken back."""
    assert gone.gain is not None
    low, high = (-100 * x for x in reversed(gone.gain.ci95))
    said = f"{gone.effect.replace('_', ' ')} {gone.target}".strip()
    return f"{said} was taken back: accepting it makes data that were not used {low:.0f} to {high:.0f} % worse."


def _accepted(result: SessionResult, examined: Examined, before: Identification) -> Accepted:
    """Return what accepting the findings changes, with all gains."""
    phi, every = examined.naming.found.phi, examined.named
    found = _corrected(result, partial(accept, named=every), phi)
    as_is = _corrected(result, partial(accept, named=()), phi, before)
    findings = tuple(replace(one, changes=_changes(before, found.identified)) for one in examined.diagnosis.findings)
    single = len(findings) == 1
    gains = [
        _gain(as_is if single else _without(result, examined, k), found) if _acts(result, every[k]) else None
        for k in range(len(findings))
    ]
    findings = tuple(replace(one, gain=gain) for one, gain in zip(findings, gains, strict=True))
    told = replace(examined, diagnosis=replace(examined.diagnosis, findings=findings))
    left = (as_is.kept, found.kept) if as_is.kept and found.kept else None
    return Accepted(told, found.identified, left, _gain(as_is, found))


def _without(result: SessionResult, examined: Examined, index: int) -> _Corrected | None:
    """Return the session corrected for all findings but one, their sizes fitted again; None where no body fits."""
    rest = without_name(examined, index)
    try:
        return _corrected(result, partial(accept, named=rest.named), rest.naming.found.phi)
    except NotSolved:
        return None


def _acts(result: SessionResult, one: NamedCause) -> bool:
    """Return whether a cause does anything in the data by which its gain is judged: a touch that came and went before
    has nothing to gain there, and nothing to lose.
    """
    judged = windows(result.trials, KEPT_ROLES) or windows(result.trials, FITTED_ROLES)
    return not one.course or any(window.trial.name in one.course for window in judged)


def combined_with_witnesses(
    result: SessionResult,
    one: Diagnosis,
    examined: Examined | None,
    evidence: ObservedEvidence,
    measured: Mapping[tuple[str, str], SimulatedSize],
) -> Diagnosis:
    """Return the diagnosis with what the witnesses name (`combine_findings`), every correction of a plate or a clock
    with its gain; one that only makes worse what was not used is taken back, the worst first.
    """
    said, notes = infer_causes(evidence), one.notes
    while True:
        told = replace(one, notes=notes)
        whole = combine_findings(told, said, evidence, judged=examined is not None, measured=measured)
        findings = whole.findings if examined is None else _with_gains(result, examined, whole.findings)
        worst = _worthless(findings)
        gone = None if worst is None else findings[worst]
        rest = tuple(f for f in said.findings if gone is None or (f.effect, f.target) != (gone.effect, gone.target))
        if gone is None or len(rest) == len(said.findings):
            return replace(whole, findings=findings)
        said, notes = replace(said, findings=rest), (*notes, _taken_back_words(gone))


def _with_gains(result: SessionResult, examined: Examined, findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return the findings with the gain of those that nobody has judged yet and that a recording can be corrected for
    (`accepted_corrections`): all corrections made, against all but this one.
    """
    asked = [k for k, one in enumerate(findings) if one.gain is None and accepted_corrections((one,), "")]
    corrections = accepted_corrections(findings, "")
    taken = {(one.effect, one.target) for one in corrections}
    named = tuple(one for one in examined.named if cause_key(one) not in taken)

    def left(without: tuple[str, str] | None = None) -> _Corrected:
        made = tuple(one for one in corrections if (one.effect, one.target) != without)

        def mend(case: Case) -> Case:
            case = accept(case, named)
            return replace(case, trial=corrected_trial(case.trial, made))

        return _corrected(result, mend, examined.naming.found.phi)

    told = list(findings)
    try:
        every = left() if asked else None
        for k in asked:
            gain = None if every is None else _gain(left((findings[k].effect, findings[k].target)), every)
            told[k] = replace(findings[k], gain=gain)
    except (TrialRefused, NotSolved):
        return findings
    return tuple(told)


def _gain(before: _Corrected | None, after: _Corrected) -> Gain | None:
    """Return what the second gains against the first on the data not used; None where these are too few."""
    if before is None or before.kept is None or after.kept is None or before.used is None or after.used is None:
        return None
    try:
        return gain_by_naming(before.kept, after.kept, fitted=(before.used, after.used))
    except BiodanceError:
        return None


def _corrected(result: SessionResult, mend: _Mend, phi: Array, as_is: Identification | None = None) -> _Corrected:
    """Return the session with every trial mended, seen with the parameters ``phi`` (10N,), and identified again.
    ``as_is``: the body identified from the trials as they are, where it is known.
    """
    body, fitted = _mended(result, FITTED_ROLES, mend, phi)
    kept = _mended(result, KEPT_ROLES, mend, phi)[1]
    found = as_is or identify_body(body, fitted)
    about = standing_point(kept or fitted)
    if not kept:
        return _Corrected(found, *_by_halves(body, fitted, about))
    return _Corrected(found, *(residuals_of(found.identified, some, about) for some in (fitted, kept)))


def _mended(result: SessionResult, roles: tuple[Role, ...], mend: _Mend, phi: Array) -> tuple[Body, _Fits]:
    """Return the body and the trials of the ``roles``, mended."""
    assert result.body is not None
    found = windows(result.trials, roles)
    cases = [mend(replace(case, phi=phi)) for case in cases_of(result.body, found)]
    fits = tuple(case_fit(case, window.use) for case, window in zip(cases, found, strict=True))
    return (cases[0].body if cases else result.body), fits


def _by_halves(body: Body, fits: _Fits, about: Array) -> tuple[Residuals | None, Residuals | None]:
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
        bodies = [identify_body(body, half).identified for half in halves]
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
        f"{name.replace('_', ' ')}: {then[name]:.2f} kg becomes {now.get(name, 0.0):.2f} kg"
        for name in most
        if abs(change[name]) >= 0.01
    )

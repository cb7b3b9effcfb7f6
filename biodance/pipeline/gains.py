"""What accepting the findings changes: the body is identified again from the corrected trials, and every finding gains
on its own what is lost on the kept trials when all findings but this one are accepted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from biodance.diagnosis.accept import Residuals, accept, case_fit, gain_by_naming, residuals_of
from biodance.diagnosis.diagnosis import Finding
from biodance.diagnosis.engine import Examined, without_name
from biodance.diagnosis.gain import Gain
from biodance.errors import BiodanceError, NotSolved, TrialRefused
from biodance.identification.identification import Identification, identify_body
from biodance.identification.statistics import standing_point
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES
from biodance.pipeline.judged_trials import cases_of, windows
from biodance.pipeline.results import SessionResult


@dataclass(frozen=True, eq=False)
class Accepted:
    """A diagnosis whose findings were accepted: ``examined`` with the gain of each of them, the body ``identified``
    then (None without findings), what the body in use and this one ``left`` of the kept trials, the ``gain`` of all
    together, and what could not be computed (``failures``).
    """

    examined: Examined
    identified: Identification | None = None
    left: tuple[Residuals, Residuals] | None = None
    gain: Gain | None = None
    failures: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Corrected:
    """A session corrected for some causes: the body ``identified`` and what it leaves of the trials ``used`` and
    ``kept``.
    """

    identified: Identification
    used: Residuals
    kept: Residuals | None


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
    gone = examined.diagnosis.findings[index]
    assert gone.gain is not None
    low, high = (-100 * x for x in reversed(gone.gain.ci95))
    said = f"{gone.effect.replace('_', ' ')} {gone.target}".strip()
    return noted(
        without_name(examined, index),
        f"{said} was taken back: accepting it makes trials that were not used {low:.0f} to {high:.0f} % worse.",
    )


def _accepted(result: SessionResult, examined: Examined, before: Identification) -> Accepted:
    """Return what accepting the findings changes, with all gains."""
    found, as_is = _corrected(result, examined), _corrected(result, examined, before)
    findings = tuple(replace(one, changes=_changes(before, found.identified)) for one in examined.diagnosis.findings)
    single = len(findings) == 1
    gains = [
        _gain(as_is if single else _without(result, examined, k), found) if found.kept else None
        for k in range(len(findings))
    ]
    findings = tuple(replace(one, gain=gain) for one, gain in zip(findings, gains, strict=True))
    told = replace(examined, diagnosis=replace(examined.diagnosis, findings=findings))
    left = (as_is.kept, found.kept) if as_is.kept and found.kept else None
    return Accepted(told, found.identified, left, gains[0] if single else _gain(as_is, found))


def _without(result: SessionResult, examined: Examined, index: int) -> _Corrected | None:
    """Return the session corrected for all findings but one, their sizes fitted again; None where no body fits."""
    try:
        return _corrected(result, without_name(examined, index))
    except NotSolved:
        return None


def _gain(before: _Corrected | None, after: _Corrected) -> Gain | None:
    """Return what the second gains against the first on the kept trials; None where these are too few."""
    if before is None or before.kept is None or after.kept is None:
        return None
    try:
        return gain_by_naming(before.kept, after.kept, fitted=(before.used, after.used))
    except BiodanceError:
        return None


def _corrected(result: SessionResult, examined: Examined, as_is: Identification | None = None) -> _Corrected:
    """Return the session corrected for the named causes and identified again; nominal with the body ``as_is``."""
    assert result.body is not None
    named, phi = (() if as_is else examined.named), examined.naming.found.phi
    both = []
    for roles in (FITTED_ROLES, KEPT_ROLES):
        found = windows(result.trials, roles)
        cases = [replace(case, phi=phi) for case in cases_of(result.body, found)]
        both.append([(case, accept(case, named), window.use) for case, window in zip(cases, found, strict=True)])
    fits, kept = (tuple(case_fit(case, use) for _, case, use in some) for some in both)
    body = as_is or identify_body(both[0][0][1].body, fits)
    about = standing_point(tuple(case_fit(case, use) for case, _, use in both[1] or both[0]))
    left = residuals_of(body.identified, kept, about) if kept else None
    return _Corrected(body, residuals_of(body.identified, fits, about), left)


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

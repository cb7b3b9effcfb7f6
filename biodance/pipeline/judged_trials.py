"""Which trials of a session the diagnosis looks at, and why it leaves others out."""

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.problem import TrialWindow
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.effects import Case, QualityCheck, check_quality
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial_result import TrialResult
from biodance.records import Role
from biodance.records.attention import Judged

_ENOUGH = 10.0
"""s of fully measured movement beside which quiet standing tells nothing more."""
TOO_SHORT = f"no {SHORTEST_RUN:g} s in which the plates measure all ground contact without a break."
"""Why a trial with measured contact is not looked at."""
_STATIC = "quiet standing tells nothing beside so much movement"
_KEPT = "kept to measure what a finding gains"
_NEVER = "it holds no measured ground contact"


def windows(results: tuple[TrialResult, ...], roles: tuple[Role, ...]) -> tuple[TrialWindow, ...]:
    """Return the trials of the given roles that have motion and measured contact, each at its place in the session's
    time; static trials belong to that time only where they are asked for.
    """
    moving = [one for one in results if one.motion is not None and (one.trial.role != "static" or "static" in roles)]
    seconds = [float(np.ptp(one.motion.time[[0, -1]])) for one in moving if one.motion is not None]
    ends = np.cumsum(seconds)
    found = []
    for one, long, end in zip(moving, seconds, ends, strict=True):
        if one.comparison is None or one.motion is None or one.trial.role not in roles or not one.comparison.used.any():
            continue
        found.append(TrialWindow(one.trial, one.motion, one.comparison.used, (end - long) / ends[-1], end / ends[-1]))
    return tuple(found)


def chosen_windows(results: tuple[TrialResult, ...]) -> tuple[TrialWindow, ...]:
    """Return the trials to look at: those to fit, else those kept, and quiet standing beside them where they are
    short.
    """
    roles = FITTED_ROLES if windows(results, FITTED_ROLES) else KEPT_ROLES
    moving = windows(results, roles)
    return moving if sum(window.seconds for window in moving) >= _ENOUGH else windows(results, ("static", *roles))


def all_windows(results: tuple[TrialResult, ...]) -> tuple[TrialWindow, ...]:
    """Return the trials that checks look at: those to look at, and those kept."""
    return (*chosen_windows(results), *windows(results, KEPT_ROLES))


def cases_of(body: Body | None, found: tuple[TrialWindow, ...]) -> tuple[Case, ...]:
    """Return the trials as effects see them, at the rate of the markers, with the table's parameters."""
    return () if body is None else tuple(window.case(body, body.sip.phi) for window in found)


def failed_checks(result: SessionResult) -> tuple[QualityCheck, ...]:
    """Return the checks of the recordings (units, signs, labels, clocks) that failed; trials without plates are looked
    at by their markers alone.
    """
    measured = tuple(window for window in all_windows(result.trials) if window.trial.plates)
    checks = check_quality(result.session, cases_of(result.body, measured))
    return tuple(quality for quality in checks if not quality.ok)


def left_out(results: tuple[TrialResult, ...]) -> tuple[str, ...]:
    """Say of every trial that is not looked at, though it should be, why."""
    return tuple(
        f"{name} was left out{'. ' if why[:1].isupper() else ': '}{why}" if why else f"{name} was left out."
        for name, why in reasons_left_out(results).items()
    )


def reasons_left_out(results: tuple[TrialResult, ...]) -> dict[str, str]:
    """Return by name why a trial is not looked at, though it should be."""
    seen = {window.trial.name: window.seconds for window in windows(results, ("static", *FITTED_ROLES))}
    wanted = [one for one in results if one.trial.role in FITTED_ROLES and not seen.get(one.name, 0.0)]
    return {one.name: TOO_SHORT if one.name in seen else " ".join(one.reasons) for one in wanted}


def judged_trials(result: SessionResult, used: tuple[TrialWindow, ...]) -> tuple[Judged, ...]:
    """Return for every trial and refused file of a session how many seconds of it are judged in ``used``, or why it
    is not.
    """
    seconds = {window.trial.name: window.seconds for window in used if window.seconds > 0}
    why = reasons_left_out(result.trials)
    roles = {window.trial.role for window in used if window.trial.name in seconds}
    rows = []
    for one in result.trials:
        name, role = one.trial.name, one.trial.role
        if name in seconds:
            rows.append(Judged(name, seconds[name]))
        elif "fit" in roles and role not in ("fit", "static"):
            rows.append(Judged(name, 0.0, _KEPT))
        elif role == "static" and roles:
            rows.append(Judged(name, 0.0, _STATIC))
        else:
            short = TOO_SHORT if one.comparison is not None and one.comparison.used.any() else _NEVER
            rows.append(Judged(name, 0.0, why.get(name) or " ".join(one.reasons) or short, missed=True))
    return (*rows, *(Judged(file, 0.0, reason, missed=True) for file, reason in result.session.refused.items()))


def identified_trials(result: SessionResult) -> tuple[Judged, ...]:
    """Return for every trial to identify from how many measured seconds it holds, or why none."""
    used = set(result.identification.identification.trials) if result.identification else set()
    rows = []
    for one in result.trials:
        if one.trial.role != "fit":
            continue
        here = one.comparison if one.name in used else None
        seconds = float(here.used.sum() * np.median(np.diff(here.time))) if here and here.time.size > 1 else 0.0
        rows.append(Judged(one.name, seconds, "" if seconds else " ".join(one.reasons) or _NEVER, missed=not seconds))
    return tuple(rows)

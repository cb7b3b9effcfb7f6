"""Which trials of a session the diagnosis looks at, and why it leaves others out."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.diagnosis.problem import TrialWindow
from biodance.diagnosis.spectrum import SHORTEST_RUN
from biodance.effects import Case, QualityCheck, Recorded, check_quality
from biodance.lab.markers.time_axis import of_postures
from biodance.motion.half_steps import half_steps, stances, told_of, without
from biodance.pipeline.identification import FITTED_ROLES, KEPT_ROLES
from biodance.pipeline.results import SessionResult
from biodance.pipeline.trial import TrialResult, compared
from biodance.pipeline.words import first_upper
from biodance.records import LeftOut, LeftOutSpan, Plate, Role, Trial, Wrench
from biodance.records.attention import Judged

_ENOUGH = 10.0
"""s of fully measured movement beside which quiet standing tells nothing more."""
TOO_SHORT = f"no {SHORTEST_RUN:g} s in which the plates measure all ground contact without a break."
"""Why a trial with measured contact is not looked at."""
_POSTURES = "its rows are postures: identified from, and nothing told of movement, clocks or plates"
_DIFFERENT = "plates and motion differ by more than a wrong body can make of it, in most of what is measured."


def windows(results: tuple[TrialResult, ...], roles: tuple[Role, ...]) -> tuple[TrialWindow, ...]:
    """Return trials of some roles with motion and contact, each at its place in time; no rows of postures."""
    asked = [one for one in results if one.trial.role != "static" or "static" in roles]
    # rows of postures have no time between them: nothing moves, and no clock can be late
    moving = [(one, one.motion) for one in asked if one.motion is not None and not of_postures(one.motion.time)]
    seconds = [float(np.ptp(motion.time[[0, -1]])) for _, motion in moving]
    # from 0 to 1 through all trials in turn: what drifts in a session goes on from one to the next
    ends = np.cumsum(seconds)
    every = {plate.name: plate for one in results for plate in one.trial.plates}
    return tuple(
        TrialWindow(
            _with_every_plate(one.trial, every), motion, one.comparison.used, (end - long) / ends[-1], end / ends[-1]
        )
        for (one, motion), long, end in zip(moving, seconds, ends, strict=True)
        if one.comparison is not None and one.trial.role in roles and one.comparison.used.any()
    )


def _with_every_plate(trial: Trial, every: Mapping[str, Plate]) -> Trial:
    """Return a trial with all plates of its session: one that its reader left out carried nothing there."""
    own = {plate.name: plate for plate in trial.plates}
    if not own or own.keys() == every.keys():
        return trial
    nothing = Wrench(trial.wrench.time, np.zeros_like(trial.wrench.value))
    plates = (
        own.get(name) or replace(plate, wrench=nothing, zero=np.full(3, np.nan), loaded=np.empty((0, 2)))
        for name, plate in sorted(every.items())
    )
    return replace(trial, plates=tuple(plates))


def half_steps_left_out(results: Sequence[TrialResult], body: Body | None, mass: float) -> list[TrialResult]:
    """Return the examined trials of a session without the steps of feet that may be partly beside a plate whose place
    the file does not tell (`half_steps`); ``mass`` kg of the body, NaN = unknown.
    """
    every = [
        stances(one.trial, one.contact, weight=one.trial.settings.gravity * mass) if one.contact is not None else ()
        for one in results
    ]
    found = list(results)
    for k, some in enumerate(half_steps(every)):
        one, contact = results[k], results[k].contact
        if some and contact is not None:
            text = f"{first_upper(told_of(some))}. Give their corners in session.toml ([plates]), or check them."
            trial = replace(one.trial, warnings=(*one.trial.warnings, text))
            found[k] = compared(replace(one, trial=trial, contact=without(contact, some)), body)
    return found


def half_spans(results: Sequence[TrialResult]) -> dict[str, tuple[LeftOutSpan, ...]]:
    """Return by trial when a foot may stand partly beside a plate whose place the file does not tell."""
    return {one.name: one.contact.half for one in results if one.contact is not None}


def chosen_windows(results: tuple[TrialResult, ...]) -> tuple[TrialWindow, ...]:
    """Return the trials to look at: to fit, else kept, and where they are short quiet standing beside them."""
    roles = FITTED_ROLES if windows(results, FITTED_ROLES) else KEPT_ROLES
    moving = windows(results, roles)
    names = {window.trial.name for window in moving}
    enough = sum(one.compared_s for one in results if one.name in names) >= _ENOUGH
    return moving if enough else windows(results, ("static", *roles))


def all_windows(results: tuple[TrialResult, ...]) -> tuple[TrialWindow, ...]:
    """Return the trials that checks look at: those to look at, and those kept, each once."""
    chosen = chosen_windows(results)
    names = {window.trial.name for window in chosen}
    return (*chosen, *(one for one in windows(results, KEPT_ROLES) if one.trial.name not in names))


def cases_of(body: Body | None, found: tuple[TrialWindow, ...]) -> tuple[Case, ...]:
    """Return the trials as effects see them, at the rate of the markers, with the table's parameters."""
    return () if body is None else tuple(window.case(body, body.sip.phi) for window in found)


def recorded_of(result: SessionResult) -> Recorded:
    """Return what the checks look at in an examined session."""
    return _recorded(result, all_windows(result.trials))


def failed_checks(result: SessionResult) -> tuple[QualityCheck, ...]:
    """Return the failed checks of the recordings; trials without plates are seen by their markers alone."""
    measured = tuple(window for window in all_windows(result.trials) if window.trial.plates)
    return tuple(quality for quality in check_quality(_recorded(result, measured)) if not quality.ok)


def _recorded(result: SessionResult, seen: tuple[TrialWindow, ...]) -> Recorded:
    contacts = {one.name: one.contact for one in result.trials if one.contact is not None}
    return Recorded(result.session, cases_of(result.body, seen), contacts)


def left_out(results: tuple[TrialResult, ...]) -> tuple[str, ...]:
    """Say of every trial that is not looked at, though it should be, why."""
    return tuple(
        f"{name} was left out{'. ' if why[:1].isupper() else ': '}{why}" if why else f"{name} was left out."
        for name, why in reasons_left_out(results).items()
    )


def reasons_left_out(results: tuple[TrialResult, ...]) -> dict[str, str]:
    """Return by name why a trial is not looked at, though it should be."""
    seen, why = {window.trial.name: window.seconds for window in windows(results, ("static", *FITTED_ROLES))}, {}
    for one in (one for one in results if one.trial.role in FITTED_ROLES and not seen.get(one.name, 0.0)):
        postures = one.motion is not None and of_postures(one.motion.time)
        why[one.name] = TOO_SHORT if one.name in seen else _POSTURES if postures else " ".join(one.reasons)
    return why


def judged_trials(result: SessionResult, looked_at: Set[str]) -> tuple[Judged, ...]:
    """Return by trial and refused file how many seconds are judged of those ``looked_at``, or why none."""
    why = reasons_left_out(result.trials)
    roles = {one.trial.role for one in result.trials if one.name in looked_at}
    rows = []
    for one in result.trials:
        name, role, missed = one.trial.name, one.trial.role, False
        if name in looked_at:
            reason = ""
        elif "fit" in roles and role not in ("fit", "static"):
            reason = "kept to measure what a finding gains"
        elif role == "static" and roles:
            reason = "quiet standing tells nothing beside so much movement"
        else:
            reason, missed = why.get(name) or " ".join(one.reasons) or _no_frame(one), True
        rows.append(Judged(name, one.compared_s if name in looked_at else 0.0, reason, missed, one.left_out))
    return (*rows, *(Judged(file, 0.0, reason, missed=True) for file, reason in result.session.refused.items()))


def _no_frame(one: TrialResult) -> str:
    """Return why nothing of a trial that gives no other reason is looked at."""
    if one.comparison is None or not one.comparison.used.any():
        return "it holds no measured ground contact"
    largest = max(one.left_out, key=lambda reason: one.left_out[reason], default=LeftOut.SHORT_RUN)
    return _DIFFERENT if largest is LeftOut.FORCES_DIFFER else TOO_SHORT


def identified_trials(result: SessionResult) -> tuple[Judged, ...]:
    """Return for every trial to identify from how many measured seconds it holds, or why none."""
    used = set(result.identification.identification.trials) if result.identification else set()
    rows = []
    for one in result.trials:
        if one.trial.role != "fit":
            continue
        left: dict[LeftOut, float] = {reason: s for reason, s in one.left_out.items() if reason != LeftOut.SHORT_RUN}
        # a run too short for slow errors of the plates tells of masses all the same
        seconds = one.compared_s + one.left_out.get(LeftOut.SHORT_RUN, 0.0) if one.name in used else 0.0
        why = "" if seconds > 0 else " ".join(one.reasons) or _no_frame(one)
        rows.append(Judged(one.name, seconds, why, missed=bool(why), left_out=left))
    return tuple(rows)

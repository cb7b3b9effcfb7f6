"""The findings of the witnesses beside those of the simulation: one diagnosis.

Errors of the two are independent: the witnesses look at feet, clocks and weights, the simulation at the wrench that the
whole body needs. A cause that both name has one size, weighted by their precisions; what the witnesses name explains
what the simulation could only resemble; a size that they exclude is taken back.
"""

from dataclasses import replace

import numpy as np

from biodance.diagnosis.constancy import WEIGHTLESS
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Verdict
from biodance.diagnosis.heard import Testimony
from biodance.diagnosis.testimony import SOMEWHERE, Verdicts, size_by

_FAR = 3.0
"""Standard deviations between two sizes of one cause from which they contradict each other."""
_PLAIN = 3.0
"""Times its limit: a cause so large is seen by the simulation, whatever else it cannot explain."""
_EXCLUDED = "what the simulation would explain by a {} is none, as feet, clocks and weights show"
"""Why nothing can be told where the only cause of the simulation is excluded by the witnesses."""
_STANDING = {"standing_place"}
"""Witnesses of a habit: no law says where over their feet people stand."""
_INSTANTS = {"force_onset", "force_end"}
"""Witnesses of single instants: a clock that runs late moves the forces of the whole movement, too."""
_WEIGHING = {"standing_force", "stride_force"}
"""Witnesses of mean forces: what only weighs shows in no moment and in no band but the slowest."""
_NOT_MOVED = "Standing and single steps alone look like a {}; the movement, which would show it, shows none."
"""What is said of a cause that witnesses suggest in a session in whose movement nothing is wrong."""
_RAW = ("clipping", "axis_error", "unit_error", "frame_rate")
"""Causes that a check finds in the raw channels: what witnesses measure in such recordings has no size."""


def with_witnesses(one: Diagnosis, said: Verdicts, heard: Testimony, *, judged: bool) -> Diagnosis:
    """Return the diagnosis with what the witnesses found; ``judged``: whether the simulation could be asked at all."""
    one = replace(one, witnesses=heard if heard.observations else None)
    raw = any(finding.effect in _RAW for finding in one.findings)
    if raw:
        known = {(finding.effect, finding.target) for finding in one.findings}
        signs = tuple(f for f in said.findings if f.effect in _RAW and (f.effect, f.target) not in known)
        return replace(one, findings=(*one.findings, *signs))
    if not said.findings:
        return _checked(one, heard)
    checked = _checked(one, heard) if judged else one
    mine, shadows = [], []
    joined: list[Finding | None] = []
    for finding in said.findings:
        alike = next((f for alias in finding.set for f in checked.findings if _covers(alias, f)), None)
        if alike is not None and alike in joined:
            continue  # two things that witnesses tell apart are one to the simulation, which told it already
        joined.append(alike)
        if (
            alike is None
            and judged
            and (_explained_without(finding, checked, heard) or _habit(finding, checked, heard))
        ):
            shadows.append(finding)
        else:
            mine.append(_together(finding, alike))
    known = {_names(f) for f in checked.resembles}
    shadows = [shadow for shadow in shadows if _names(shadow) not in known]
    if not mine and checked.verdict == "nothing wrong":
        notes = (_NOT_MOVED.format(" of ".join(filter(None, _names(each))).replace("_", " ")) for each in shadows)
        return replace(checked, notes=(*checked.notes, *notes))
    if not mine:
        return replace(checked, resembles=(*checked.resembles, *shadows))
    names = {_names(alias) for finding in mine for alias in finding.set}
    rest = tuple(f for f in checked.findings if _names(f) not in names)
    told: Verdict = "named, incomplete"
    if judged and not rest and one.verdict in ("nothing wrong", "named, complete") and not one.doubt:
        told = "named, complete"
    kept = tuple(f for f in checked.resembles if _names(f) not in names)
    return replace(checked, verdict=told, findings=(*mine, *rest), resembles=(*kept, *shadows))


def _names(one: Finding | Alias) -> tuple[str, str]:
    """Return effect and target."""
    return one.effect, one.target


def _covers(alias: Alias, one: Finding | Alias) -> bool:
    """Return whether an alias is a cause, or a load somewhere and that the same on a segment."""
    return _names(alias) == _names(one) or (_names(alias) == SOMEWHERE and one.effect == alias.effect)


def _explained_without(finding: Finding, one: Diagnosis, heard: Testimony) -> bool:
    """Return whether the simulation found something else wrong, though it would see a cause of this size: a load is
    weight to the plates, and a hand that carries it moves where people stand; or found this very cause to have no one
    size where the witnesses look (`_weighed_alike`). Exchanged labels are nothing to the plates. Where it doubts what
    it found, it still has to have seen some of a cause that is `_PLAIN`.
    """
    hanging = [other for other in one.resembles if _names(other) == _names(finding) and other.hangs_on]
    if hanging:
        return not _weighed_alike(finding, hanging[0], heard)
    labels = one.findings and all(other.effect == "labels_swapped" for other in one.findings)
    if not finding.parameters or one.verdict == "nothing wrong" or labels:
        return False
    times = _times_its_limit(finding, one)
    if one.doubt:
        return times > _PLAIN and _evidence(finding, one) <= 0.0
    return times > 1.0


def _weighed_alike(finding: Finding, hanging: Finding, heard: Testimony) -> bool:
    """Return whether a cause that only weighing shows has the same size in the simulation, and hangs there on nothing
    that weighs: what the plates weigh they weigh, however the movement's fast bands and moments depart.
    """
    alone = _names(finding) in heard.causes and set(heard.seen_by(_names(finding))) <= _WEIGHING
    return alone and hanging.hangs_on in WEIGHTLESS and _same_size(finding, hanging)


def _same_size(finding: Finding, other: Finding) -> bool:
    """Return whether two sizes of one cause do not contradict each other."""
    if not (finding.parameters and other.parameters):
        return False
    mine, its = finding.parameters[0], other.parameters[0]
    return bool(abs(mine.value - its.value) <= _FAR * np.hypot(mine.sd, its.sd))


def _habit(finding: Finding, one: Diagnosis, heard: Testimony) -> bool:
    """Return whether only the way in which the person stands says so, or only single instants, and a movement without
    fault shows nothing of it, which would show that size: who stands beside the middle has no plate beside its place,
    and forces that fit the movement throughout do not come late.
    """
    by = set(heard.seen_by(_names(finding))) if _names(finding) in heard.causes else {""}
    alone = by <= _STANDING or by <= _INSTANTS
    seen = alone and one.verdict == "nothing wrong" and _times_its_limit(finding, one) > 1.0
    return seen and _evidence(finding, one) <= 0.0


def _times_its_limit(finding: Finding, one: Diagnosis) -> float:
    """Return the size of a finding over the limit from which the simulation sees it; 0 where it does not."""
    limits = {(row.effect, row.target): row.limit for row in one.limits}
    return abs(finding.parameters[0].value) / limits.get(_names(finding), float("inf")) if finding.parameters else 0.0


def _evidence(finding: Finding, one: Diagnosis) -> float:
    """Return the log Bayes factor of a cause for the simulation alone, before any was named; infinite where it was not
    asked.
    """
    return next((a.log_bayes_factor for a in one.candidates if _names(a) == _names(finding)), float("inf"))


def _together(by_witnesses: Finding, by_simulation: Finding | None) -> Finding:
    """Return a finding with the size from both, where both named it; what the simulation tells from its look-alikes
    is named as it does, and so is a load that only weighs the same.
    """
    if by_simulation is not None and _names(by_simulation) != _names(by_witnesses):
        return by_simulation
    if by_simulation is None or not by_simulation.parameters or not by_witnesses.parameters:
        return by_witnesses
    first, last = by_witnesses.parameters[0], by_simulation.parameters[0]
    if not (first.sd > 0 and last.sd > 0) or first.unit != last.unit:
        return by_witnesses
    weight = np.array([first.sd**-2, last.sd**-2])
    value = float(weight @ [first.value, last.value] / weight.sum())
    loads = any(alias.effect == SOMEWHERE[0] for alias in by_simulation.set)
    alike = (alias for alias in by_witnesses.set[1:] if loads or _names(alias) != SOMEWHERE)
    bayes = by_witnesses.log_bayes_factor + max(0.0, by_simulation.log_bayes_factor)
    return replace(
        by_simulation,
        parameters=(
            Estimate(first.name, value, float(weight.sum() ** -0.5), first.unit),
            *by_simulation.parameters[1:],
        ),
        set=(Alias(by_witnesses.effect, by_witnesses.target, bayes), *alike),
        advice=by_witnesses.advice,
    )


def _checked(one: Diagnosis, heard: Testimony) -> Diagnosis:
    """Return the diagnosis without the sizes that the witnesses exclude."""
    gone = tuple(finding for finding in one.findings if _excluded(finding, heard))
    if not gone:
        return one
    left = tuple(finding for finding in one.findings if finding not in gone)
    said = "{} {} was taken back: feet and weight on the plates exclude its size."
    notes = tuple(said.format(finding.effect.replace("_", " "), finding.target) for finding in gone)
    told: Verdict = "named, incomplete" if left else "unexplained"
    doubt = one.doubt or ("" if left or one.verdict != "named, complete" else _EXCLUDED.format(gone[0].effect))
    return replace(
        one,
        verdict=told,
        findings=left,
        resembles=(*gone, *one.resembles),
        notes=(*one.notes, *notes),
        doubt=doubt.replace("_", " "),
    )


def _excluded(finding: Finding, heard: Testimony) -> bool:
    """Return whether the witnesses measure the size of a finding well enough to say that it is another one."""
    mine = size_by(heard, (finding.effect, finding.target))
    if mine is None or not finding.parameters:
        return False
    size, sd = finding.parameters[0].value, finding.parameters[0].sd
    return bool(abs(size) > _FAR * mine[1] and abs(size - mine[0]) > _FAR * np.hypot(mine[1], sd if sd == sd else 0.0))

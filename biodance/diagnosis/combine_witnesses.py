"""Combination of the witnesses' findings with those of the simulation into one diagnosis.

The errors of the two are independent: witnesses use feet, clocks and weights, the simulation uses the wrench of the
whole body. The size of a cause that both name is their precision-weighted mean. A cause named by the witnesses replaces
its look-alikes from the simulation, and a size that the witnesses exclude is withdrawn.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from biodance.diagnosis.delay_contradicted import is_contradicted, without_contradicted
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding, Verdict
from biodance.diagnosis.reasons import Reason
from biodance.diagnosis.size_dependence import WEIGHTLESS
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.diagnosis.witness_fit import is_beyond_usual
from biodance.diagnosis.witness_inference import UNPLACED_LOAD, WitnessFindings, size_from_witnesses
from biodance.diagnosis.witness_landmark import with_habits
from biodance.effects import Effect, causes
from biodance.effects.labels_swapped import LabelsSwapped

_FAR = 3.0
"""Standard deviations between two sizes of one cause that contradict each other."""
_PLAIN = 3.0
"""Times its limit: the simulation sees a cause so large, whatever else it cannot explain."""
_WEIGHING = {"standing_force", "stride_force"}
"""Witnesses of mean forces: what only weighs shows in no moment and in no band but the slowest."""
_STANDING = {*_WEIGHING, "standing_place"}
"""Witnesses of a mean wrench, of which a movement on the same plates has one, too."""
_NOT_MOVED = "Feet, clocks and weights alone look like a {}; the movement, which would show it, shows none."
"""What is said of a cause that witnesses suggest in a session in whose movement nothing is wrong."""
_ANYWAY = {"standing_twist"}
"""Witnesses to whom other channels hardly matter: heard beside a wrong one."""


class SimulatedSize(NamedTuple):
    """What the simulation tells of a cause where nothing was named: ``size`` of the first parameter, its standard
    deviation ``sd`` (NaN: not measured), and the log evidence that is ``lacking`` for a name (negative: to spare).
    """

    size: float
    sd: float
    lacking: float


def combine_findings(
    one: Diagnosis,
    by_witnesses: WitnessFindings,
    evidence: ObservedEvidence,
    *,
    judged: bool,
    measured: Mapping[tuple[str, str], SimulatedSize] = MappingProxyType({}),
) -> Diagnosis:
    """Return the diagnosis combined with the findings of the witnesses; ``judged``: whether the simulation was
    available; ``measured``: by effect and target what it tells of every cause where nothing was named (empty: it
    looked for none, or is not believed). What is a habit of the laboratory is told beside it and changes no verdict.
    """
    habits = tuple(finding for finding in by_witnesses.findings if finding.cause.habit)
    faults = replace(by_witnesses, findings=tuple(f for f in by_witnesses.findings if f not in habits))
    one = replace(one, witnesses=evidence if evidence.observations else None)
    found = _with_faults(one, faults, evidence, judged, measured)
    return found if any(one.cause.raw for one in found.findings) else with_habits(found, habits)


def _with_faults(
    one: Diagnosis,
    by_witnesses: WitnessFindings,
    evidence: ObservedEvidence,
    judged: bool,
    measured: Mapping[tuple[str, str], SimulatedSize],
) -> Diagnosis:
    """Return the diagnosis with what the witnesses find wrong, see `combine_findings`."""
    by_witnesses = without_contradicted(by_witnesses, evidence)
    if any(finding.cause.raw for finding in one.findings):
        known = {_names(finding) for finding in one.findings}
        told = (f for f in by_witnesses.findings if f.cause.raw or _is_shown_by(f, evidence, _ANYWAY))
        return replace(one, findings=(*one.findings, *(f for f in told if _names(f) not in known)))
    if not by_witnesses.findings:
        return _without_excluded(one, evidence)
    checked = _without_excluded(one, evidence) if judged else one
    kept_findings, doubtful = [], []
    matched: list[Finding | None] = []
    for finding in by_witnesses.findings:
        alike = next((f for alias in finding.set for f in checked.findings if _same_cause(alias, f)), None)
        if alike is not None and alike in matched:
            continue  # two things that witnesses tell apart are one to the simulation, which told it already
        matched.append(alike)
        if (
            alike is None
            and judged
            and (
                _simulation_disagrees(finding, checked, evidence)
                or _movement_shows_none(finding, checked, evidence, measured)
            )
        ):
            doubtful.append(finding)
        else:
            kept_findings.append(_merged(finding, alike))
    known = {_names(f) for f in checked.resembles}
    doubtful = [shadow for shadow in doubtful if _names(shadow) not in known]
    if not kept_findings and checked.verdict == "nothing wrong":
        notes = (_NOT_MOVED.format(" of ".join(filter(None, _names(each))).replace("_", " ")) for each in doubtful)
        return replace(checked, notes=(*checked.notes, *notes))
    if not kept_findings:
        return replace(checked, resembles=(*checked.resembles, *doubtful))
    names = {_names(alias) for finding in kept_findings for alias in finding.set}
    rest = tuple(f for f in checked.findings if _names(f) not in names)
    verdict: Verdict = "named, incomplete"
    if judged and not rest and one.verdict in ("nothing wrong", "named, complete") and not one.doubted:
        verdict = "named, complete"
    kept = tuple(f for f in checked.resembles if _names(f) not in names)
    return replace(checked, verdict=verdict, findings=(*kept_findings, *rest), resembles=(*kept, *doubtful))


def _names(one: Finding | Alias) -> tuple[str, str]:
    """Return effect and target."""
    return one.effect, one.target


def _same_cause(alias: Alias, one: Finding | Alias) -> bool:
    """Return whether an alias is the same cause; an unplaced load matches a load on any segment."""
    return _names(alias) == _names(one) or (_names(alias) == UNPLACED_LOAD and one.effect == alias.effect)


def _simulation_disagrees(finding: Finding, one: Diagnosis, evidence: ObservedEvidence) -> bool:
    """Return whether the simulation contradicts a finding of the witnesses. It does if it found something else wrong
    although it would detect a cause of this size, if it found this cause with a size that depends on what the
    witnesses observe (`_weighing_agrees`), at several targets though it is believed only alone (`Effect.single`), or
    with a body that is unlike people beside it, where the witnesses see its weight alone: to weigh the same plates
    twice is no second opinion on which mass it is. Exchanged labels do not affect the plates and do not count. If the
    simulation doubts its own result, it must have some evidence of a cause that is `_PLAIN`.
    """
    same = [other for other in one.resembles if _names(other) == _names(finding)]
    hanging = [other for other in same if other.varies_with]
    if hanging:
        return not _weighing_agrees(finding, hanging[0], evidence)
    if same and Reason.UNUSUAL_BODY in one.why and _is_shown_by(finding, evidence, _WEIGHING):
        return True
    if same and Reason.SEVERAL_CROSSTALKS in one.why and _is_believed_alone(finding):
        return True
    labels = one.findings and all(other.effect == LabelsSwapped.name for other in one.findings)
    if not finding.parameters or one.verdict == "nothing wrong" or labels:
        return False
    times = _size_over_limit(finding, one)
    if one.doubted:
        return times > _PLAIN and _evidence(finding, one) <= 0.0
    return times > 1.0


def _weighing_agrees(finding: Finding, hanging: Finding, evidence: ObservedEvidence) -> bool:
    """Return whether a cause that only weighing witnesses detect has the same size in the simulation, where that size
    depends only on moments and fast bands: these do not affect the mean force.
    """
    weighed = _is_shown_by(finding, evidence, _WEIGHING)
    return weighed and hanging.varies_with in WEIGHTLESS and _same_size(finding, hanging)


def _is_believed_alone(finding: Finding) -> bool:
    """Return whether a cause is believed at one target at a time only."""
    kind = causes().get(finding.effect)
    return isinstance(kind, Effect) and kind.single


def _is_shown_by(finding: Finding, evidence: ObservedEvidence, witnesses: set[str]) -> bool:
    """Return whether some ``witnesses`` alone see the cause of a finding."""
    return _names(finding) in evidence.causes and set(evidence.detected_by(_names(finding))) <= witnesses


def _same_size(finding: Finding, other: Finding) -> bool:
    """Return whether two sizes of one cause do not contradict each other."""
    if not (finding.parameters and other.parameters):
        return False
    kept_findings, its = finding.parameters[0], other.parameters[0]
    return bool(abs(kept_findings.value - its.value) <= _FAR * np.hypot(kept_findings.sd, its.sd))


def _movement_shows_none(
    finding: Finding,
    one: Diagnosis,
    evidence: ObservedEvidence,
    measured: Mapping[tuple[str, str], SimulatedSize],
) -> bool:
    """Return whether a movement in which nothing is wrong, and that would show a cause of this size, measures no such
    size: not of the cause, and not of any look-alike of it. People may stand off centre on a plate that is in its
    place, and forces that fit the movement throughout are not late. Standing alone excludes nothing. What only the
    mean wrench shows has to fit a movement with a doubt, too: joints for which nobody knows what is usual change none.

    Two sources of one cause add up their evidence. Where the movement measures it better than the witnesses, theirs
    must make up what is lacking for a name there.
    """
    heard = _is_shown_by(finding, evidence, _STANDING) if one.doubted else one.verdict == "nothing wrong"
    if not heard or not finding.parameters or _size_over_limit(finding, one) <= 1.0:
        return False
    own = finding.parameters[0]
    for alias in (alias for alias in finding.set if _names(alias) in measured):
        names = _names(alias)
        size = (own.value, own.sd) if names == _names(finding) else size_from_witnesses(evidence, names)
        if size and _fits_the_movement(alias, size, measured[names], evidence):
            return False
    return _names(finding) in measured


def _fits_the_movement(
    cause: Alias, said: tuple[float, float], moved: SimulatedSize, evidence: ObservedEvidence
) -> bool:
    """Return whether the size of a cause that the witnesses ``said`` and the one that the simulation measured are one
    size, with the evidence of both enough for a name, and more than laboratories have without a fault; a cause has only
    one. A size that the simulation did not measure (standard deviation NaN), or measures worse than the witnesses,
    fits.
    """
    (a, b), (size, sd, lacking) = said, moved
    if not sd < b:
        return True
    if abs(a - size) > _FAR * np.hypot(b, sd) or cause.log_bayes_factor < lacking:
        return False
    weight, both = np.array([b**-2, sd**-2]), np.array([a, size])
    return is_beyond_usual(evidence, _names(cause), float(weight @ both / weight.sum()), float(weight.sum() ** -0.5))


def _size_over_limit(finding: Finding, one: Diagnosis) -> float:
    """Return the size of a finding relative to the detection limit of the simulation; 0 if it cannot detect it."""
    limits = {(row.effect, row.target): row.limit for row in one.limits}
    return abs(finding.parameters[0].value) / limits.get(_names(finding), float("inf")) if finding.parameters else 0.0


def _evidence(finding: Finding, one: Diagnosis) -> float:
    """Return the log Bayes factor of a cause in the simulation before any cause was named; infinite if not computed."""
    return next((a.log_bayes_factor for a in one.candidates if _names(a) == _names(finding)), float("inf"))


def _merged(by_witnesses: Finding, by_simulation: Finding | None) -> Finding:
    """Return a finding with the size combined from witnesses and simulation, and the set of the simulation: it knows
    what the witnesses see and more, so what it tells apart is no look-alike, and what it does not tell apart is one. If
    it distinguishes look-alikes that the witnesses do not, or places a load that only weighs the same, its finding is
    returned.
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
    return replace(
        by_simulation,
        parameters=(
            Estimate(first.name, value, float(weight.sum() ** -0.5), first.unit),
            *by_simulation.parameters[1:],
        ),
        set=tuple(_with_witnesses(alias, by_witnesses) for alias in by_simulation.set),
        advice=by_witnesses.advice,
    )


def _with_witnesses(one: Alias, by_witnesses: Finding) -> Alias:
    """Return a look-alike with the evidence that the witnesses have for it, if any."""
    said = (alias.log_bayes_factor for alias in by_witnesses.set if _same_cause(alias, one))
    return replace(one, log_bayes_factor=one.log_bayes_factor + next(said, 0.0))


def _without_excluded(one: Diagnosis, evidence: ObservedEvidence) -> Diagnosis:
    """Return the diagnosis without findings whose size the witnesses exclude."""
    gone = tuple(f for f in one.findings if is_contradicted(f, evidence) or _excluded(f, evidence))
    if not gone:
        return one
    left = tuple(finding for finding in one.findings if finding not in gone)
    sentence = "{} {} was taken back: feet and weight on the plates exclude its size."
    notes = tuple(sentence.format(finding.effect.replace("_", " "), finding.target) for finding in gone)
    verdict: Verdict = "named, incomplete" if left else "unexplained"
    doubted = one.doubted or left or one.verdict != "named, complete"
    return replace(
        one,
        verdict=verdict,
        findings=left,
        resembles=(*gone, *one.resembles),
        notes=(*one.notes, *notes),
        why=one.why if doubted else {**one.why, Reason.EXCLUDED_BY_WITNESSES: (gone[0].effect.replace("_", " "),)},
    )


def _excluded(finding: Finding, evidence: ObservedEvidence) -> bool:
    """Return whether the witnesses measure the size of this cause precisely enough to exclude that of the finding."""
    measured = size_from_witnesses(evidence, (finding.effect, finding.target))
    if measured is None or not finding.parameters:
        return False
    size, sd = finding.parameters[0].value, finding.parameters[0].sd
    return bool(
        abs(size) > _FAR * measured[1]
        and abs(size - measured[0]) > _FAR * np.hypot(measured[1], sd if sd == sd else 0.0)
    )

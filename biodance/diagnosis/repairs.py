"""What is wrong in the body and was put right before any force was looked at: a joint that the movement puts elsewhere
than the static trial, a marker that has moved since. They leave nothing in the forces, and are findings all the same.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from biodance.body.body import Body
from biodance.body.human.scaling import tilted_joints
from biodance.body.parts import JointError
from biodance.diagnosis.consequence import LIMIT, matters
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import DOUBTS
from biodance.discovery import Chosen
from biodance.effects import Case, DiscreteEffect, Effect, QualityCheck, effects
from biodance.effects.joint_centre import JointCentre
from biodance.effects.labels_swapped import LabelsSwapped
from biodance.effects.marker_misplaced import MarkerMisplaced
from biodance.motion.ik.joint_unknowns import centre_sd
from biodance.motion.kinematics import chains
from biodance.uncertainty.tolerances import Tolerances, key_of

_EXPLAINS = 0.5
"""Share of the way that a joint seemed to have gone by which a marker beside it must have moved, to explain it."""


def with_repairs(
    diagnosis: Diagnosis, cases: tuple[Case, ...], known: Tolerances, chosen: Chosen[Effect | DiscreteEffect] = None
) -> Diagnosis:
    """Return the diagnosis with what was put right in the body of ``cases`` named first, sized under the tolerances
    ``known`` and limited to ``chosen`` effects; as it is where more is wrong that nobody can name, or where markers
    carry each other's names: that body was placed by wrong ones.
    """
    exchanged, family = any(one.effect == LabelsSwapped.name for one in diagnosis.findings), effects(chosen)
    carried = frozenset(
        joint for one in diagnosis.findings if one.effect in family for joint in family[one.effect].carries
    )
    found = () if exchanged else tuple(repairs(cases, known, family, carried))
    if not found or not (diagnosis.explained or diagnosis.faults):
        return diagnosis
    # what is left may be too small to matter and still no normal band
    explained = diagnosis.explained and (diagnosis.faults or all(row.z <= LIMIT for row in diagnosis.adequacy))
    new = {(one.effect, one.target) for one in found}
    rest = tuple(one for one in diagnosis.findings if (one.effect, one.target) not in new)
    return replace(diagnosis, explained=bool(explained), findings=(*found, *rest))


def repairs(
    cases: tuple[Case, ...], known: Tolerances, family: Mapping[str, Effect], carried: frozenset[str] = frozenset()
) -> Iterator[Finding]:
    """Yield what was put right in the body of ``cases``: a marker that has moved with how far it lies from its place
    in postures that do not follow it, a joint with how far the movement puts it from the static trial's place, if that
    is more than it may be wrong by (the body's own warning stays). Joints that a named cause has ``carried`` along were
    placed without it, and accuse nothing.
    """
    for error in cases[0].body.joint_errors:
        if error.joint in carried:
            continue
        if error.spared and MarkerMisplaced.name in family:
            yield from _marker(family[MarkerMisplaced.name], error, cases, known)
        elif error.contradicted and JointCentre.name in family:
            found = _joint(family[JointCentre.name], error, cases[0].body.markers.names)
            if any(one.known for one in found.parameters):
                yield found


def _marker(effect: Effect, error: JointError, cases: tuple[Case, ...], known: Tolerances) -> Iterator[Finding]:
    """Yield a marker that has moved, if it lies so far from its place in the static trial that this explains where the
    joint seemed to be, and farther than by itself (two standard deviations); one that was wrong in the static trial,
    too, is a joint elsewhere, and where that trial contradicts itself beside the marker, nobody knows
    (`unplaced_markers`).
    """
    if error.spared not in effect.targets(cases[0]) or error.spared in unplaced_markers(cases[0].body):
        return
    own = replace(effect, target=error.spared)
    shift = own.measured(np.zeros(3), *cases)
    alike = max(known.size(f"shown {own.name}"), known.size(key_of(own.name, error.spared)))
    sd = np.hypot(alike, own.size_error * np.linalg.norm(shift))
    if matters(own, shift) and np.linalg.norm(shift) >= max(_EXPLAINS * error.moved, 2 * sd):
        yield _named(own, [(p.name, v) for p, v in zip(own.parameters, shift, strict=True)], float(sd))


def unplaced_markers(body: Body) -> frozenset[str]:
    """Return the markers of which the static trial tells no place: those of the segments beside a joint that stands
    away from its axes there. What lies elsewhere than in that trial need not have moved since.
    """
    tilted, segments = tilted_joints(body), set()
    for chain in chains(body):
        first, last = body.joints[chain[0]], body.joints[chain[-1]]
        if first.name.rsplit("_", 1)[0] in tilted:
            segments |= {body.joints[first.parent].segment if first.parent >= 0 else 0, last.segment}
    return frozenset(name for name, on in zip(body.markers.names, body.markers.segment, strict=True) if on in segments)


def _joint(effect: Effect, error: JointError, markers: tuple[str, ...]) -> Finding:
    """Return a joint that lies elsewhere as far as movement shows it, no surer than static trials place joints."""
    far, shown = (error.reach, error.reach_sd) if error.reach else (error.moved, error.centre)
    sd = float(np.hypot(centre_sd(error.joint), shown))
    found = _named(replace(effect, target=error.joint), [("shift", far)], sd)
    alike = (Alias(*names, float("inf")) for names in JointCentre.looks_like(error.joint, markers))
    return replace(found, set=(*found.set, *alike))


def _named(effect: Effect, sizes: list[tuple[str, float]], sd: float) -> Finding:
    """Return a finding that needs no evidence of forces."""
    parameters = tuple(Estimate(name, float(size), sd, "m") for name, size in sizes)
    cause = Alias(effect.name, effect.target, float("inf"))
    return Finding(effect.name, effect.target, parameters, (cause,), 1.0, advice=effect.advice)


def with_failed(failed: tuple[QualityCheck, ...], left: Diagnosis) -> Diagnosis:
    """Return the diagnosis of a session in which checks ``failed``: what they found, and nothing that the simulation of
    unmended recordings would say; what feet, clocks and weights show stays.
    """
    note = (
        "A check named its cause before any statistics. Mend it and diagnose again: nothing is fitted to "
        "recordings that are wrong."
    )
    told = tuple(map(failed_check, failed))
    known = {(one.effect, one.target) for one in told}
    rest = tuple(one for one in left.findings if (one.effect, one.target) not in known)
    raw = tuple(one for one in told if one.cause.raw)
    return replace(
        left,
        findings=(*raw, *rest, *(one for one in told if one not in raw)),
        notes=(note, *left.notes),
        why={reason: about for reason, about in left.why.items() if reason not in DOUBTS},
    )


def failed_check(quality: QualityCheck) -> Finding:
    """Return a failed check as a finding."""
    size = () if np.isnan(quality.size) else (Estimate(quality.quantity, quality.size, quality.sd, quality.unit),)
    alike = tuple(Alias(*names, float("inf")) for names in ((quality.effect, quality.target), *quality.alike))
    advice = f"{quality.text} {quality.advice}".strip()
    return Finding(quality.effect, quality.target, size, alike, 1.0, advice=advice, trials=quality.trials)


def named_first(diagnosis: Diagnosis, checks: tuple[QualityCheck, ...], *notes: str) -> Diagnosis:
    """Return the diagnosis with what was put right before all else was judged named first; what was only left out of
    the recordings (`QualityCheck.mended`) comes behind what is wrong in the rest.
    """
    found = tuple(failed_check(quality) for quality in checks)
    if not found:
        return diagnosis
    named = {(one.effect, one.target) for one in found}
    rest = tuple(one for one in diagnosis.findings if (one.effect, one.target) not in named)
    return replace(
        diagnosis,
        findings=(*rest, *found) if all(quality.mended for quality in checks) else (*found, *rest),
        notes=(*notes, *diagnosis.notes),
    )

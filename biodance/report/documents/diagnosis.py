"""What the diagnosis found, under keys whose unit is their suffix or stands beside them; channels in the order Fx Fy
Fz Mx My Mz.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from biodance.diagnosis.diagnosis import Estimate, Finding
from biodance.diagnosis.foresight import TOLD, Foresight
from biodance.diagnosis.gain import Gain
from biodance.diagnosis.witness_evidence import ObservedEvidence, cause_visibilities
from biodance.identification.identification import Identification
from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.records.attention import Attention, Judged
from biodance.report.documents.plain import keyed

_ALIAS = "effect target log_bayes_factor"
_GAIN = "rms_before rms_after ci95 trials log_density_per_s=score log_density_se=score_se"
_LIMIT = "effect target limit unit told_from typical"
_ADEQUACY = "channel band_hz z size unit matters trial around_s=second"
_OBSERVED = "what value sd unit expected expected_sd z trial counts"


def _gain(found: Gain | None) -> dict[str, Any] | None:
    return keyed(found, _GAIN) if found else None


def attention_document(found: Sequence[Attention]) -> list[dict[str, Any]]:
    """Return what a person must see, strongest first."""
    return [keyed(one, "level text trial about") for one in found]


def judged_document(found: Sequence[Judged]) -> list[dict[str, Any]]:
    """Return what a verdict rests on, and of what it does not why; ``missed``: it should have; ``left_out`` s by
    reason.
    """
    return [
        keyed(one, "trial seconds left_out_s")
        | {"why_not": one.why_not or None, "missed": one.missed, "left_out": dict(one.left_out)}
        for one in found
    ]


def _finding(one: Finding) -> dict[str, Any]:
    return {
        **keyed(one, "effect target"),
        "parameters": _parameters(one.parameters),
        "set": [keyed(alias, _ALIAS) for alias in one.set],
        "probability": one.probability,
        "visible_fraction": one.visible_fraction,
        "gain": _gain(one.gain),
        **keyed(one, "changes advice trials"),
    }


def _parameters(found: Sequence[Estimate]) -> dict[str, Any]:
    """Return every parameter by its name, and what has three axes (``shift_x`` ...) as a vector under the name without
    axis, too.
    """
    rows = {one.name: keyed(one, "value sd unit ci95=interval") for one in found}
    stems = [name.removesuffix("_x") for name in rows if name.endswith("_x")]
    for stem in stems:
        axes = [rows.get(f"{stem}_{axis}") for axis in "xyz"]
        if all(axes):
            rows[stem] = {key: [one[key] for one in axes if one] for key in ("value", "sd", "ci95")}
            rows[stem]["unit"] = rows[f"{stem}_x"]["unit"]
    return rows


_SEATED = (
    "This dance is for somebody who sits: squats, hops, lunges and standing are not asked of that person. What "
    "concerns the plate and the cameras alone somebody else can do in their place."
)


def foresight_document(found: Foresight, *, seated: bool = False, plates: str = "") -> dict[str, Any]:
    """Return what a movement will be able to see; ``separation`` the smallest expected log Bayes factor between two
    causes it sees; ``care`` what must not be asked of whoever dances ``seated``; ``plates`` a sentence on how much
    plate the dance needs.
    """
    pairs = [
        {"cause": " ".join(p.cause).strip(), "other": " ".join(p.other).strip(), "log_bayes_factor": p.difference}
        for p in found.confusions
    ]
    return {
        "limits": [keyed(row, _LIMIT) for row in found.limits],
        "unobservable": [keyed(row, _LIMIT) for row in found.hidden],
        "confusions": pairs,
        "separation": found.separation,
        "summary": foresight_summary(found),
        "care": _SEATED if seated else "",
        "plates": plates,
        "changes": [
            {"do": one.do, **{key: [" ".join(c).strip() for c in getattr(one, key)] for key in ("unseen", "confused")}}
            for one in found.changes
        ],
    }


def foresight_summary(found: Foresight) -> str:
    """Return in two sentences what a movement will see and confuse."""
    mixed = sum(pair.difference < TOLD for pair in found.confusions)
    mixed_up = (
        f"{mixed} of them {'looks' if mixed == 1 else 'look'} like another one"
        if mixed
        else "all of them are told from each other"
    )
    return (
        f"Of {len(found.limits)} causes that a diagnosis looks for, this movement will see {len(found.seen)} at their "
        f"typical size; {mixed_up}."
    )


def _masses(found: Identification | None) -> list[dict[str, Any]] | None:
    if found is None or found.status == "failed":
        return None
    sd = np.sqrt(np.diag(found.sip.covariance)[::10])
    return [
        {"name": n, "mass_kg": m, "mass_sd_kg": s}
        for n, m, s in zip(found.sip.segments, found.sip.mass, sd, strict=True)
    ]


def diagnosis_document(found: SessionDiagnosis) -> dict[str, Any]:
    """Return all that the diagnosis found; null where a number is not finite (a limit of null: never seen)."""
    one = found.diagnosis
    return {
        "attention": attention_document(one.attention),
        "judged": judged_document(one.judged),
        "verdict": one.verdict,
        "told": one.told,
        "status": one.status,
        "probability": one.probability,
        "reasons": tuple(one.why),
        "findings": [_finding(finding) for finding in one.findings],
        "resembles": [_finding(finding) for finding in one.resembles],
        "within_tolerance": [_finding(finding) for finding in one.tolerated],
        "gates": [keyed(quality, "check ok text effect target size") for quality in one.checks],
        "adequacy": [keyed(row, _ADEQUACY) for row in one.adequacy],
        "unobservable": [keyed(row, _LIMIT) for row in one.unobservable],
        "limits": [keyed(row, _LIMIT) for row in one.limits],
        "candidates": [keyed(alias, _ALIAS) for alias in one.candidates],
        "gain": _gain(found.gain),
        "masses": {"before": _masses(found.before), "accepted": _masses(found.accepted)},
        "failures": found.failures,
        "notes": one.notes,
        "witnesses": _witnesses(one.witnesses),
        "witness_table": _visibilities(one.witnesses),
    }


def _witnesses(evidence: ObservedEvidence | None) -> list[dict[str, Any]]:
    """Return every observation; ``cause`` is the one to which it responds most, "" where to none."""
    return [
        {"witness": o.observer, "cause": " ".join(filter(None, evidence.strongest(i))), **keyed(o, _OBSERVED)}
        for i, o in enumerate(evidence.observations if evidence else ())
        if evidence
    ]


def _visibilities(evidence: ObservedEvidence | None) -> list[dict[str, Any]]:
    """Return how well each cause was seen; an ``sd`` of null: nothing responds to it."""
    return [
        keyed(one, "effect target sd unit")
        | {
            "witnesses": one.observers,
            "alike": [f"{effect} {target}".strip() for effect, target in one.alike],
            "would_be_seen_by": one.would,
        }
        for one in (cause_visibilities(evidence) if evidence else ())
    ]

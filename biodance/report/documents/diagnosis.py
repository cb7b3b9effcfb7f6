"""What the diagnosis found, under keys whose unit is their suffix or stands beside them; channels in the order Fx Fy
Fz Mx My Mz.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from biodance.diagnosis.diagnosis import Alias, Estimate, Finding, Gain, Unobservable
from biodance.diagnosis.foresight import TOLD, Foresight
from biodance.diagnosis.heard import Testimony, sights
from biodance.identification.identification import Identification
from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.records.attention import Attention, Judged


def _alias(one: Alias) -> dict[str, Any]:
    return {"effect": one.effect, "target": one.target, "log_bayes_factor": one.log_bayes_factor}


def _gain(found: Gain | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "rms_before": found.rms_before,
        "rms_after": found.rms_after,
        "ci95": found.ci95,
        "trials": found.trials,
        "log_density_per_s": found.score,
        "log_density_se": found.score_se,
    }


def attention_document(found: Sequence[Attention]) -> list[dict[str, Any]]:
    """Return what a person must see, strongest first."""
    return [{"level": one.level, "text": one.text, "trial": one.trial, "about": one.about} for one in found]


def judged_document(found: Sequence[Judged]) -> list[dict[str, Any]]:
    """Return what a verdict rests on, and of what it does not why; ``missed``: it should have."""
    return [
        {"trial": one.trial, "seconds": one.seconds, "why_not": one.why_not or None, "missed": one.missed}
        for one in found
    ]


def _finding(one: Finding) -> dict[str, Any]:
    return {
        "effect": one.effect,
        "target": one.target,
        "parameters": _parameters(one.parameters),
        "set": [_alias(a) for a in one.set],
        "visible_fraction": one.visible_fraction,
        "gain": _gain(one.gain),
        "changes": one.changes,
        "advice": one.advice,
    }


def _parameters(found: Sequence[Estimate]) -> dict[str, Any]:
    """Return every parameter by its name, and what has three axes (``shift_x`` ...) as a vector under the name without
    axis, too.
    """
    rows = {p.name: {"value": p.value, "sd": p.sd, "unit": p.unit, "ci95": p.interval} for p in found}
    stems = [name.removesuffix("_x") for name in rows if name.endswith("_x")]
    for stem in stems:
        axes = [rows.get(f"{stem}_{axis}") for axis in "xyz"]
        if all(axes):
            rows[stem] = {key: [one[key] for one in axes if one] for key in ("value", "sd", "ci95")}
            rows[stem]["unit"] = rows[f"{stem}_x"]["unit"]
    return rows


def _limit(row: Unobservable) -> dict[str, Any]:
    return {
        "effect": row.effect,
        "target": row.target,
        "limit": row.limit,
        "unit": row.unit,
        "told_from": row.told_from,
        "typical": row.typical,
    }


_SEATED = (
    "This dance is for somebody who sits: squats, hops, lunges and standing are not asked of that person. What "
    "concerns the plate and the cameras alone somebody else can do in their place."
)


def foresight_document(found: Foresight, *, seated: bool = False) -> dict[str, Any]:
    """Return what a movement will be able to see; ``separation`` the smallest expected log Bayes factor between two
    causes it sees; ``care`` what must not be asked of whoever dances ``seated``.
    """
    pairs = [
        {"cause": " ".join(p.cause).strip(), "other": " ".join(p.other).strip(), "log_bayes_factor": p.difference}
        for p in found.confusions
    ]
    return {
        "limits": [_limit(row) for row in found.limits],
        "unobservable": [_limit(row) for row in found.hidden],
        "confusions": pairs,
        "separation": found.separation,
        "summary": foresight_summary(found),
        "care": _SEATED if seated else "",
        "changes": [
            {"do": one.do, **{key: [" ".join(c).strip() for c in getattr(one, key)] for key in ("unseen", "confused")}}
            for one in found.changes
        ],
    }


def foresight_summary(found: Foresight) -> str:
    """Return in two sentences what a movement will see and confuse."""
    mixed = sum(pair.difference < TOLD for pair in found.confusions)
    mixed_up = f"{mixed} of them look like another one" if mixed else "all of them are told from each other"
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
        "findings": [_finding(finding) for finding in one.findings],
        "resembles": [_finding(finding) for finding in one.resembles],
        "within_tolerance": [_finding(finding) for finding in one.tolerated],
        "gates": [
            {"check": g.check, "ok": g.ok, "text": g.text, "effect": g.effect, "target": g.target, "size": g.size}
            for g in one.gates
        ],
        "adequacy": [
            {
                "channel": a.channel,
                "band_hz": a.band_hz,
                "z": a.z,
                "size": a.size,
                "unit": a.unit,
                "matters": a.matters,
                "trial": a.trial,
                "around_s": a.second,
            }
            for a in one.adequacy
        ],
        "unobservable": [_limit(row) for row in one.unobservable],
        "limits": [_limit(row) for row in one.limits],
        "candidates": [_alias(a) for a in one.candidates],
        "gain": _gain(found.gain),
        "masses": {"before": _masses(found.before), "accepted": _masses(found.accepted)},
        "failures": found.failures,
        "notes": one.notes,
        "witnesses": _witnesses(one.witnesses),
        "witness_table": _sights(one.witnesses),
    }


def _witnesses(heard: Testimony | None) -> list[dict[str, Any]]:
    """Return every observation; ``cause`` is the one that it sees best, "" where it is blind to all."""
    return [
        {
            "witness": o.witness,
            "cause": " ".join(filter(None, heard.strongest(i))),
            "what": o.what,
            "value": o.value,
            "sd": o.sd,
            "unit": o.unit,
            "expected": o.expected,
            "expected_sd": o.expected_sd,
            "z": o.z,
            "trial": o.trial,
            "counts": o.counts,
        }
        for i, o in enumerate(heard.observations if heard else ())
        if heard
    ]


def _sights(heard: Testimony | None) -> list[dict[str, Any]]:
    """Return how well each cause was seen; an ``sd`` of null: every witness was blind to it."""
    return [
        {
            "effect": s.effect,
            "target": s.target,
            "sd": s.sd,
            "unit": s.unit,
            "witnesses": s.witnesses,
            "alike": [f"{effect} {target}".strip() for effect, target in s.alike],
            "would_be_seen_by": s.would,
        }
        for s in (sights(heard) if heard else ())
    ]

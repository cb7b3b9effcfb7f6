"""What was designed or played, under keys whose unit is their suffix."""

from pathlib import Path
from typing import Any

import numpy as np

from biodance.dance.cues import dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.problem.footprint import room_on_plates
from biodance.dance.rehearsal import Rehearsal
from biodance.pipeline.dance_result import DanceResult
from biodance.report.documents.plain import keyed

_CURVE = "segments duration_s=duration mass_kg=mass com_m=com inertia_kgm2=inertia"


def dance_document(result: DanceResult) -> dict[str, Any]:
    """Return what `biodance dance` promises as results.json (see docs/guide/dance.md); SI units by suffix."""
    dance, account, expectation = result.dance, result.account, result.expectation
    criterion = account and keyed(account, "static static_bound dynamic dynamic_bound hardly_excited=hardly")
    rows = []
    if expectation is not None:
        for i, name in enumerate(expectation.segments):
            ends = {"mass_kg": expectation.mass, "com_m": expectation.com, "inertia_kgm2": expectation.inertia}
            now = {key: values[-1, i] for key, values in ends.items()}
            before = {key.replace("_", "_table_", 1): values[0, i] for key, values in ends.items()}
            rows.append({"segment": name, **now, **before, "information": expectation.share[-1, i]})
    return {
        "protocol": result.plan.name,
        "postures": int(dance.counted.sum()) if dance else 0,
        "transitions": len(dance.move) if dance else 0,
        "duration_s": dance.duration if dance else 0.0,
        "criterion": criterion,
        "margins": [keyed(margin, "limit worst where_s unit what") for margin in result.margins],
        "feasible": result.feasible,
        "reason": result.reason,
        "expected_sd": rows,
        "expected_curve": expectation and keyed(expectation, _CURVE),
        "for": result.plan.whom,
        "instructions": _counted(dance),
        "performers": result.performers,
        "plate_m": dance.plate if dance else None,
        "room_on_plates_m": room_on_plates(dance.stances) if dance else None,
        "simplicity_price": _price(result),
        "emphasis": result.emphasis,
        "warnings": result.warnings,
        "notes": (*result.notes, *(dance.notes if dance else ())),
        "seed": dance.seed if dance else None,
        "compute_s": result.seconds,
    }


def _price(result: DanceResult) -> dict[str, Any] | None:
    """Return the expected standard deviations (root mean square over the segments) with the dance as it is, and if the
    same postures were chosen freely.
    """
    if result.expectation is None or result.freely is None:
        return None
    both = {"with": result.expectation, "without": result.freely}
    return {
        f"{key}_{unit}": {name: float(np.sqrt(np.mean(getattr(one, key)[-1] ** 2))) for name, one in both.items()}
        for key, unit in (("mass", "kg"), ("com", "m"))
    } | {"sentence": result.price}


def _counted(dance: Dance | None) -> dict[str, float] | None:
    """Return how many things are called at once, on average and at most."""
    if dance is None:
        return None
    counts = [len(said) for said in dance_instructions(dance)]
    return {"mean": float(np.mean(counts)), "max": max(counts)}


def playback_document(found: Rehearsal, film: Path) -> dict[str, Any]:
    """Return what became of a dance that was played: until when it stands, and how far it is from its plan."""
    p = found.playback
    return {
        "film": str(film),
        "stays_up": p.stays_up,
        "fell_s": p.fell,
        "kept": not found.broken,
        "broken": found.broken,
        "touched": [{"part": part, "at_s": at} for part, at in p.touched.items()],
        "played_s": float(p.time[-1]),
        "angle_rms_rad": float(np.sqrt(np.mean(p.angle_error**2))),
        "tilt_worst_rad": float(p.tilt_error.max()),
        "pelvis_worst_m": float(p.root_error.max()),
        "cop_rms_m": float(np.sqrt(np.nanmean(p.zmp_error**2))),
        "cop_inside_least_m": float(np.nanmin(found.inside)),
    }

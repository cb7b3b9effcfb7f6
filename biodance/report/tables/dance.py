"""What was designed, or played."""

from pathlib import Path

import numpy as np

from biodance.dance.cues import dance_instructions
from biodance.dance.playback import Rehearsal
from biodance.dance.problem.feet import room_on_plates
from biodance.pipeline.dance_result import DanceResult
from biodance.report.tables.schema import Row, Schema

MARGIN_ROW = Schema(
    "limit worst where_s unit what",
    shown="limit: {limit:name} | least margin: {worst:.4g} | unit: {unit} | at, s: {where_s:.2f} | of: {what:name}",
)
"""What is left of a limit where it is tightest."""
EXPECTED_ROW = Schema(
    "segment mass_kg com_m inertia_kgm2 mass_table_kg com_table_m inertia_table_kgm2 information",
    shown="segment: {segment:name} | mass (kg): {mass_kg:2} | with the table: {mass_table_kg:2} | "
    "centre of mass (mm): {com_m:mm1} | by the table: {com_table_m:mm1}",
)
"""Expected standard deviations of a segment after a dance, and those of the table."""


def _expected(made: DanceResult) -> list[Row]:
    known = made.expectation
    if known is None:
        return []
    curves = (known.mass, known.com, known.inertia)
    columns = (*(curve[-1] for curve in curves), *(curve[0] for curve in curves), known.share[-1])
    return [dict(zip(EXPECTED_ROW.places, row, strict=True)) for row in zip(known.segments, *columns, strict=True)]


def _price(made: DanceResult) -> Row | None:
    """Return the expected standard deviations (root mean square over the segments) with the dance as it is, and if the
    same postures were chosen freely.
    """
    if made.expectation is None or made.freely is None:
        return None
    both = {"with": made.expectation, "without": made.freely}
    return {
        f"{key}_{unit}": {name: float(np.sqrt(np.mean(getattr(one, key)[-1] ** 2))) for name, one in both.items()}
        for key, unit in (("mass", "kg"), ("com", "m"))
    } | {"sentence": made.price}


def _counted(made: DanceResult) -> Row | None:
    """Return how many things are called at once, on average and at most."""
    if made.dance is None:
        return None
    counts = [len(said) for said in dance_instructions(made.dance)]
    return {"mean": float(np.mean(counts)), "max": max(counts)}


_DANCE = Schema(
    "protocol=plan.name feasible reason for=plan.whom performers plate_m=dance.plate emphasis warnings seed=dance.seed "
    "compute_s=seconds",
    {
        "postures": lambda made: int(made.dance.counted.sum()) if made.dance else 0,
        "transitions": lambda made: len(made.dance.move) if made.dance else 0,
        "duration_s": lambda made: made.dance.duration if made.dance else 0.0,
        "criterion": Schema("static static_bound dynamic dynamic_bound hardly_excited=hardly").at("account"),
        "margins": MARGIN_ROW,
        "expected_sd": _expected,
        "expected_curve": Schema("segments duration_s=duration mass_kg=mass com_m=com inertia_kgm2=inertia").at(
            "expectation"
        ),
        "instructions": _counted,
        "room_on_plates_m": lambda made: room_on_plates(made.dance.stances) if made.dance else None,
        "simplicity_price": _price,
        "notes": lambda made: (*made.notes, *(made.dance.notes if made.dance else ())),
    },
)


def dance_document(result: DanceResult) -> Row:
    """Return what `biodance dance` promises as results.json (see docs/guide/dance.md)."""
    return _DANCE.row(result)


def playback_document(found: Rehearsal, film: Path) -> Row:
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

"""The section of the report on how the person moved: figures, tables and sentences of one record; computes nothing.

All good repetitions of all trials together, one part for each kind; the window of the laboratory shows the same.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from biodance.cycles import EMG
from biodance.cycles.scores import SCORE_ANGLES, GaitScores, NormalCurve
from biodance.cycles.summary import (
    ANGLE_PANELS,
    GROUND_PEAKS,
    LOAD_PANELS,
    KeySummary,
    LeftOutBecause,
    Repetitions,
    Spread,
)
from biodance.display import spaced
from biodance.pipeline.movement import SessionMovement
from biodance.pipeline.words import first_upper
from biodance.records import SIDES
from biodance.report.figures.session import GROUND_PANELS, consistency_figure, pressure_figure, repetitions_figure
from biodance.report.pages.template import render
from biodance.report.tables.schema import Row, Schema
from biodance.report.tables.session import FILE_ANGLE_ROW
from biodance.report.wording import format_number, millimetres

CYCLE_KINDS = {"gait": "Walking", "squat": "Squats", "sit_to_stand": "Rises from a chair", "jump": "Jumps"}
_UPRIGHT = {"gait": "foot off", "squat": "lowest", "sit_to_stand": "off the seat", "jump": "take-off"}
_COUNTED = {"gait": "gait cycles", "squat": "squats", "sit_to_stand": "rises", "jump": "jumps"}
_BECAUSE = {
    LeftOutBecause.SHARED_PLATE: "in {n} both feet may have been on one plate for a part, which has no loads",
    LeftOutBecause.SPIKE: "{n} curve{s} with a spike left out",
    LeftOutBecause.TURN: "{n} left out because the person turned",
}
_DIGITS = {"m": 3, "m/s": 2, "s": 2, "steps/min": 0, "N·m/kg": 2, "W/kg": 2, "kN/m": 1, "%/s": 0}
_FIRST = (
    *("hip_flexion_maximum", "hip_flexion_minimum", "hip_adduction_maximum"),
    *("knee_flexion_at_strike", "knee_flexion_maximum", "knee_flexion_range"),
    *("ankle_dorsiflexion_maximum", "ankle_dorsiflexion_minimum", "foot_progression_mean"),
    *("knee_flexion_moment_maximum", "ankle_dorsiflexion_moment_minimum", "ankle_power_maximum"),
    *("ground_reaction_up_first_peak", "ground_reaction_up_second_peak", "ground_reaction_up_maximum"),
    *("ground_reaction_forward_braking_peak", "ground_reaction_forward_pushing_peak"),
)
"""Key values of walking that are seen at once; all others are folded."""


_KEYS = Schema(
    "", shown="value: {value} | right: {right} | left: {left} | right less left: {apart} | symmetry (%): {symmetry}"
)
_FILE_KEYS = Schema("", shown=f"{_KEYS.shown} | plug-in gait right: {{file_right}} | left there: {{file_left}}")


def movement_section(moved: SessionMovement) -> str:
    """Return the section as HTML text; "" where no trial holds a repetition and none has another program's angles."""
    parts = [_part(one, moved.healthy.normal) for one in moved.repetitions.values() if one.good]
    compared = [one for one in moved if one.file_angles]
    if not parts and not compared:
        return ""
    beside = bool(moved.gait and moved.gait.beside)
    return render(
        "movement.html.j2",
        filters={"beside": _beside, "first_upper": first_upper},
        schemas={
            "strides": Schema("", shown="value: {value} | right: {right} | left: {left} | both: {both}"),
            "keys": _FILE_KEYS if beside else _KEYS,
            "file_angle": FILE_ANGLE_ROW,
            "profile": Schema("", shown="score: {value} | right: {right} | left: {left}"),
        },
        parts=parts,
        **_scores(*moved.scores),
        compared=compared,
        file_angles=[row for one in compared for row in FILE_ANGLE_ROW.rows(one.file_angles, trial=one.trial)],
        notes=list(dict.fromkeys(note for one in moved if one.cycles for note in one.notes)),
        moved=moved,
    )


def _part(found: Repetitions, normal: Sequence[NormalCurve]) -> dict[str, Any]:
    """Return all repetitions of one kind as the page shows them: what is drawn ("" nothing), and rows of tables."""
    title = "Running" if found.runs else CYCLE_KINDS[found.kind]
    rows = {one.name: _key(one) for one in found.keys}
    ranges = tuple(one.name for one in found.keys if one.key == "range" and not one.middle)
    first = _FIRST if found.kind == "gait" else ranges
    ground = repetitions_figure(found, GROUND_PANELS, f"{title}: ground reaction, left beside right", normal)
    muscles = tuple(dict.fromkeys(one.quantity for one in found.groups if one.quantity.endswith(EMG)))
    both, left, right = (found.spatiotemporal(side) for side in ("both", "left", "right"))
    values = [
        {"value": f"{spaced(name)} ({unit})"}
        | {side: _said(some.get(name), unit) for side, some in (("left", left), ("right", right), ("both", both))}
        for name, unit in found.units.items()
        if name in both
    ]
    return {
        "title": title,
        "told": _told(found, both),
        "upright": _UPRIGHT[found.kind],
        "counted": f"{'Steps and strides' if found.kind == 'gait' else title}: mean (standard deviation; number).",
        "flags": _flags(found),
        "angles": repetitions_figure(found, ANGLE_PANELS, f"{title}: joint angles, left beside right", normal),
        "loads": repetitions_figure(found, LOAD_PANELS, f"{title}: moments and powers, left beside right", normal),
        "ground": ground.removesuffix("</div></div>") + f"{pressure_figure(found)}</div></div>" if ground else "",
        "emg": repetitions_figure(found, muscles, f"{title}: muscle activity, left beside right"),
        "consistency": consistency_figure(found),
        "trials": found.trials,
        "values": values,
        "keys": [rows[name] for name in first if name in rows],
        "more_keys": [row for name, row in rows.items() if name not in first],
    }


def _told(found: Repetitions, values: Mapping[str, Spread]) -> str:
    """Return in one sentence how much was measured, and how fast somebody walked."""
    counts = Counter(one.side for one in found.good)
    sides = ", ".join(f"{counts[side]} {side}" for side in SIDES if counts[side])
    trials = f"{len(found.trials)} trial{'s' * (len(found.trials) != 1)}"
    what = _COUNTED[found.kind].removesuffix("s" if len(found.good) == 1 else "")
    number, pace = f"{sides or len(found.good)} {what}", ""
    if "speed" in values:
        speed, cadence = format_number(values["speed"].mean, 2), format_number(values["cadence"].mean, 0)
        pace = f"{speed} m/s, {cadence} steps a minute: "
    return f"{pace}{number} of {trials}."


def _flags(found: Repetitions) -> list[str]:
    """Return what counts in no mean, and why, each reason once with the trials."""
    told = []
    for because, said in _BECAUSE.items():
        some = [one for one in found.left_out if one.because is because]
        if some:
            names = dict.fromkeys(one.cycle.trial for one in some)
            everywhere = len(names) > 2 and names.keys() == {one.trial for one in found.cycles}
            trials = "all trials" if everywhere else ", ".join(names)
            what = ", ".join(dict.fromkeys(spaced(one.quantity) for one in some if because is LeftOutBecause.SPIKE))
            counted = said.format(n=len(some), s="s" * (len(some) != 1))
            told.append(f"{counted}{f' ({what})' if what else ''}: {trials}")
    if found.speeds:
        slow, fast = (format_number(one, 1) for one in found.speeds)
        told.append(f"the trials differ in speed ({slow} to {fast} m/s), so that one mean of them is of neither")
    return told


def _key(one: KeySummary) -> Row:
    """Return one key value as a row of text."""
    other, apart, unit = (
        one.beside or one.conventional,
        "–",
        "% of weight" if one.quantity in GROUND_PEAKS else one.unit,
    )
    if one.right and one.left:
        apart = _number(one.difference, one.unit)
        apart += f" ± {_number((one.ci95[1] - one.ci95[0]) / 2, one.unit)}" if one.ci95 else ""
    return {
        "value": f"{spaced(one.name)} ({unit}{', middle' * (one.middle is not None)})",
        "right": _said(one.middle or one.right, one.unit),
        "left": _said(one.middle or one.left, one.unit),
        "apart": apart,
        "symmetry": format_number(one.symmetry, 0) if np.isfinite(one.symmetry) else "–",
        **{f"file_{side}": _number(other[side].mean, one.unit) if side in other else "–" for side in SIDES},
    }


def _number(value: float, unit: str) -> str:
    return format_number(value, _DIGITS.get(unit, 1))


def _said(found: Spread | None, unit: str) -> str:
    """Return mean (sd; number) as text; "–" for none."""
    if found is None:
        return "–"
    about = f"{_number(found.sd, unit)}; {found.count}" if found.count > 1 else "1"
    return f"{_number(found.mean, unit)} ({about})"


def _scores(ours: GaitScores | None, files: GaitScores | None, here: GaitScores | None) -> dict[str, Any]:
    """Return the scores of both sides and the profile as rows of text, none without a reference."""
    if ours is None:
        return {"scores": ()}
    rows = [_score("gait profile score (deg)", ours.gps)]
    if (theirs := files or here) is not None:
        rows.append(_score("the same of plug-in gait's angles, against its own reference", theirs.gps))
    if ours.gdi:
        rows.append(_score("gait deviation index (100 = healthy)", ours.gdi))
    by_side = [(name, {side: told for (n, side), told in ours.variables.items() if n == name}) for name in SCORE_ANGLES]
    profile = [_score(spaced(name), told) for name, told in by_side]
    return {"scores": rows, "profile": profile, "people": ours.people, "overall": ours.overall}


def _score(name: str, found: Mapping[str, Spread]) -> Row:
    return {"value": name, **{side: _said(found.get(side), "deg") for side in SIDES}}


def _beside(late: float) -> str:
    """Return how much later than the file's ours are: ``6 ms earlier``, ``at the same time``."""
    if abs(late) < 0.0005:
        return "at the same time"
    return f"{millimetres(abs(late), 0)} ms {'later' if late > 0 else 'earlier'}"

"""Write a designed dance into a folder: for programs, for the motion-capture screen, for the robot, for the person
who calls it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from biodance.dance.cues import cue_sheet, dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.problem.stance import Stance, stance_words
from biodance.display import spaced
from biodance.lab.c3d.write import write_c3d
from biodance.lab.plain_text import for_spreadsheet
from biodance.pipeline.dance_result import DanceResult, not_safe
from biodance.pipeline.preview import held_postures, preview_markers, preview_parameters, setpoints
from biodance.pipeline.still import posture_still
from biodance.records import SIDES
from biodance.report.figures.dance import criterion_figure, expectation_figure, postures_figure, zmp_figure
from biodance.report.figures.solid import sheet_png
from biodance.report.files import write_files
from biodance.report.pages.dance import cards_page
from biodance.report.tables.dance import MARGIN_ROW, dance_document
from biodance.report.tables.schema import markdown_table, plain_values, to_text

DOTS = 160
"""Dots per inch of the figures."""


def write_dance(result: DanceResult, folder: Path, *, despite: bool = False) -> dict[str, Any]:
    """Write all files of a dance into ``folder`` (which exists) and return the content of ``results.json``.

    A dance that does not keep every limit is not written: then ``results.json`` alone says why. Of one that imprecise
    people cannot dance safely what leads a person is only written ``despite`` that.
    """
    found: dict[str, Any] = plain_values(dance_document(result))
    texts: dict[str, str] = {}
    if result.dance is not None and result.account is not None and result.expectation is not None:
        dance = result.dance
        dance.save(folder / "dance.npz")
        if despite or not dance.unsafe:
            texts |= _leading(result, dance, folder)
        texts["margins.md"] = _MARGINS.format(markdown_table(MARGIN_ROW, found["margins"]))
        counted = np.flatnonzero(dance.counted).tolist()
        titles = tuple(f"{p + 1} {_short(dance.stances[p])}" for p in counted)
        postures = held_postures(dance, counted).q
        drawn = {
            "postures": postures_figure(dance.body, postures, titles),
            "criterion": criterion_figure(result.account.dynamic, result.account.dynamic_bound),
            "zmp": zmp_figure(result.account.paths),
            "expectation": expectation_figure(result.expectation),
        }
        for name, figure in drawn.items():
            figure.savefig(folder / f"{name}.png", dpi=DOTS, metadata={"Software": None})
        stills = [posture_still(dance.body, q, title) for q, title in zip(postures, titles, strict=True)]
        if picture := sheet_png(stills):
            (folder / "postures_3d.png").write_bytes(picture)
    write_files(folder, {**texts, "results.json": to_text(found)})
    return found


_MARGINS = """# What is left of every limit

Checked on the finished dance, every 0.01 s, by other code than its design.

{}"""


def _leading(result: DanceResult, dance: Dance, folder: Path) -> dict[str, str]:
    """Write dance.c3d; return what leads a person, or a robot, through the dance by file; NOT SAFE comes first."""
    texts = {"cues.md": cues(dance, (*not_safe(dance), *result.about))}
    if not dance.body.markers.names:
        return texts | {"dance.csv": angle_table(dance)}
    write_preview(dance, folder / "dance.c3d")
    return texts | {"cues.html": cards_page(result)}


def _short(stance: Stance) -> str:
    return {"parallel": "feet parallel", "right_forward": "right forward", "seated": "seated"}.get(
        stance.name, f"on the {stance.name.removeprefix('single_')}"
    )


def write_preview(dance: Dance, path: Path) -> None:
    """Write the dance as virtual markers."""
    write_c3d(path, markers=preview_markers(dance), parameters=preview_parameters(dance))


def cues(dance: Dance, about: tuple[str, ...] = ()) -> str:
    """Return the cue sheet of all postures, those in between included: in words for a person, joint angles for a
    robot without markers; ``about`` sentences that stand before them.
    """
    if not dance.body.markers.names:
        return angle_sheet(dance)
    return cue_sheet(
        dance.body,
        held_postures(dance).q[:, 7:],
        tuple(stance_words(s) for s in dance.stances),
        tuple(tuple(SIDES[side] for side in s.planted) for s in dance.stances),
        tempo=(float(np.median(dance.move)), float(np.max(dance.hold))),
        said=dance_instructions(dance),
        names=dance.names,
        about=about,
    )


def angle_table(dance: Dance) -> str:
    """Return a robot's joint angles over time as CSV (`setpoints`)."""
    names, rows = setpoints(dance)
    lines = [",".join(str(for_spreadsheet(name)) for name in names)]
    return "\n".join([*lines, *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"


def angle_sheet(dance: Dance) -> str:
    """Return the postures as a Markdown table of joint angles, degrees."""
    angles = np.degrees(held_postures(dance).q[:, 7:])
    joints = [spaced(joint.name) for joint in dance.body.joints]
    lines = [
        "# The dance, posture by posture",
        "",
        f"Angles in degrees. {float(np.median(dance.move)):g} s to get to each posture (`dance.csv` says how), then "
        f"{float(dance.hold.max()):g} s of standing still. Feet that stand are flat and point straight ahead.",
        "",
        f"| | feet | {' | '.join(joints)} |",
        "|---" * (len(joints) + 2) + "|",
    ]
    for number, (stance, row) in enumerate(zip(dance.stances, angles, strict=True), start=1):
        lines.append(f"| {number} | {stance_words(stance)} | {' | '.join(f'{angle + 0.0:.1f}' for angle in row)} |")
    return "\n".join(lines) + "\n"

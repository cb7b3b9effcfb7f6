"""Write a designed dance into a folder: for programs, for the motion-capture screen, for the robot, for the person
who calls it.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from biodance.dance.cues import cue_sheet, dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.problem.stance import Stance, stance_words
from biodance.dance.verify import Margin
from biodance.lab.c3d.write import FileValue, write_c3d
from biodance.lab.plain_text import for_spreadsheet
from biodance.motion.kinematics import poses
from biodance.pipeline.dance_result import DanceResult, not_safe
from biodance.pipeline.still import posture_still
from biodance.records import SIDES, Array, Markers
from biodance.report.documents.dance import dance_document
from biodance.report.documents.plain import plain_values, to_text
from biodance.report.figures.dance import criterion_figure, expectation_figure, postures_figure, zmp_figure
from biodance.report.figures.solid import sheet_png
from biodance.report.pages.dance import cards_page

_RATE = 100.0
"""Hz of the preview's markers."""
DOTS = 160
"""Dots per inch of the figures."""


def write_dance(result: DanceResult, folder: Path, *, despite: bool = False) -> dict[str, Any]:
    """Write all files of a dance into ``folder`` (which exists) and return the content of ``results.json``.

    A dance that does not keep every limit is not written: then ``results.json`` alone says why. Of one that imprecise
    people cannot dance safely what leads a person is only written ``despite`` that.
    """
    found: dict[str, Any] = plain_values(dance_document(result))
    if result.dance is not None and result.account is not None and result.expectation is not None:
        dance = result.dance
        dance.save(folder / "dance.npz")
        if despite or not dance.unsafe:
            _write_leading(result, dance, folder)
        (folder / "margins.md").write_text(margin_table(result.margins), encoding="utf-8", newline="\n")
        counted = np.flatnonzero(dance.counted).tolist()
        titles = tuple(f"{p + 1} {_short(dance.stances[p])}" for p in counted)
        still = dance.chain.motion(np.arange(len(counted), dtype=float), *(_held(dance, counted)))
        drawn = {
            "postures": postures_figure(dance.body, still.q, titles),
            "criterion": criterion_figure(result.account.dynamic, result.account.dynamic_bound),
            "zmp": zmp_figure(result.account.paths),
            "expectation": expectation_figure(result.expectation),
        }
        for name, figure in drawn.items():
            figure.savefig(folder / f"{name}.png", dpi=DOTS, metadata={"Software": None})
        stills = [posture_still(dance.body, q, title) for q, title in zip(still.q, titles, strict=True)]
        if picture := sheet_png(stills):
            (folder / "postures_3d.png").write_bytes(picture)
    (folder / "results.json").write_text(to_text(found), encoding="utf-8", newline="\n")
    return found


def _write_leading(result: DanceResult, dance: Dance, folder: Path) -> None:
    """Write what leads a person, or a robot, through the dance; NOT SAFE comes first."""
    if dance.body.markers.names:
        write_preview(dance, folder / "dance.c3d")
        (folder / "cues.html").write_text(cards_page(result), encoding="utf-8", newline="\n")
    else:
        write_angles(dance, folder / "dance.csv")
    text = cues(dance, (*not_safe(dance), *result.about))
    (folder / "cues.md").write_text(text, encoding="utf-8", newline="\n")


def _held(dance: Dance, chosen: Sequence[int]) -> tuple[Any, Any, Any]:
    """Return coordinates, rates and accelerations (K, n) of the chosen postures."""
    x = np.array(
        [
            dance.chain.plant(dance.postures[p][None], dance.stances[p].planted, dance.stances[p].ankle)[0]
            for p in chosen
        ]
    )
    return x, np.zeros_like(x), np.zeros_like(x)


def _short(stance: Stance) -> str:
    return {"parallel": "feet parallel", "right_forward": "right forward", "seated": "seated"}.get(
        stance.name, f"on the {stance.name.removeprefix('single_')}"
    )


def cues(dance: Dance, about: tuple[str, ...] = ()) -> str:
    """Return the cue sheet of all postures, those in between included: in words for a person, joint angles for a
    robot without markers; ``about`` sentences that stand before them.
    """
    if not dance.body.markers.names:
        return angle_sheet(dance, _held(dance, range(len(dance.stances)))[0][:, 6:])
    words = tuple(stance_words(s) for s in dance.stances)
    angles = _held(dance, range(len(dance.stances)))[0][:, 6:]
    planted = tuple(tuple(SIDES[side] for side in s.planted) for s in dance.stances)
    return cue_sheet(
        dance.body,
        angles,
        words,
        planted,
        tempo=(float(np.median(dance.move)), float(np.max(dance.hold))),
        said=dance_instructions(dance),
        names=dance.names,
        about=about,
    )


def write_preview(dance: Dance, path: Path) -> None:
    """Write the dance as virtual markers at 100 Hz: what the cameras will see of a person who dances it exactly."""
    motion, markers = dance.motion(_RATE), dance.body.markers
    xyz = poses(dance.body, motion.q).points(list(markers.segment), markers.position)
    weight = float(dance.body.sip.mass.sum())
    path.unlink(missing_ok=True)
    write_c3d(
        path,
        markers=Markers(markers.names, motion.time, xyz),
        parameters={
            "PROCESSING": {"Bodymass": weight},
            "SUBJECTS": {"NAMES": ["designed dance"]},
            "EVENT": _events(dance),
            "DANCE": _phases(dance),
        },
    )


def _events(dance: Dance) -> dict[str, FileValue]:
    """Return the events of a dance as C3D files hold them (times in minutes and seconds): postures by their number, and
    feet that leave the ground or come back.
    """
    found = [(phase.start, "General", f"Posture {phase.posture + 1}") for phase in dance.phases if phase.kind == "hold"]
    for before, after in pairwise(dance.phases):
        for side, name in enumerate(SIDES):
            down = [side in phase.stance.planted for phase in (before, after)]
            if down[0] != down[1]:
                found.append((after.start, name.capitalize(), "Foot Strike" if down[1] else "Foot Off"))
    time = np.array([one[0] for one in sorted(found)])
    contexts, labels = ([one[k] for one in sorted(found)] for k in (1, 2))
    minutes = np.stack([time // 60, time % 60])
    return {"USED": np.int16(len(found)), "CONTEXTS": contexts, "LABELS": labels, "TIMES": minutes}


def _phases(dance: Dance) -> dict[str, FileValue]:
    """Return the support phases: from when to when (s), on which feet."""
    feet = [" and ".join(SIDES[side] for side in phase.stance.planted) or "stool" for phase in dance.phases]
    times = np.array([[phase.start, phase.end] for phase in dance.phases]).T
    return {"SUPPORT": feet, "SUPPORT_TIMES": times}


def margin_table(margins: Sequence[Margin]) -> str:
    """Return the margins as a Markdown table: what is left of every limit where it is tightest."""
    lines = [
        "# What is left of every limit",
        "",
        "Checked on the finished dance, every 0.01 s, by other code than its design.",
        "",
    ]
    lines += ["| limit | least margin | unit | at, s | of |", "|---|---|---|---|---|"]
    lines += [f"| {_plain(m.limit)} | {m.worst:.4g} | {m.unit} | {m.where_s:.2f} | {_plain(m.what)} |" for m in margins]
    return "\n".join(lines) + "\n"


def _plain(name: str) -> str:
    return name.replace("_", " ")


def print_dance(found: dict[str, Any]) -> None:
    """Print what was designed on the terminal: its size, its criteria, the margins and what will be known."""
    from rich.table import Table

    from biodance.report.terminal import SafeConsole

    console = SafeConsole()
    if found["feasible"]:
        criterion = found["criterion"]
        console.print(
            f"{found['postures']} postures, {found['transitions']} moves, {found['duration_s']:.0f} s "
            f"({found['protocol']})"
        )
        console.print(
            f"static criterion {criterion['static']:.1f} kg, {criterion['static'] / criterion['static_bound']:.2f} of "
            f"its bound"
        )
        for rows, keys, title in (
            (found["margins"], ("limit", "worst", "unit", "where_s", "what"), "least margins"),
            (
                found["expected_sd"],
                ("segment", "mass_kg", "mass_table_kg", "com_m", "com_table_m"),
                "expected standard deviations",
            ),
        ):
            table = Table(box=None, pad_edge=False, title=title, title_justify="left")
            for key in keys:
                table.add_column(key)
            for row in rows:
                table.add_row(*(f"{row[key]:.3g}" if isinstance(row[key], float) else str(row[key]) for key in keys))
            console.print(table)
        if criterion["hardly_excited"]:
            console.print(f"hardly tilted: {', '.join(criterion['hardly_excited'])}", markup=False)
    if found["simplicity_price"]:
        console.print(found["simplicity_price"]["sentence"], markup=False)
    for note in (*found["warnings"], *found["emphasis"], *found["notes"]):
        console.print(f"look: {note}", markup=False)


SETPOINT_RATE = 100.0
"""Hz of the table of joint angles."""


def write_angles(dance: Dance, path: Path) -> None:
    """Write time (s), place of the root (m), its quaternion x y z w, and all joint angles (rad) at 100 Hz as CSV,
    lab frame, z up.
    """
    motion = dance.motion(SETPOINT_RATE)
    names = ["time_s", *(f"root_{axis}_m" for axis in "xyz"), *(f"root_q{axis}" for axis in "xyzw")]
    names += [str(for_spreadsheet(f"{joint.name}_rad")) for joint in dance.body.joints]
    table = np.column_stack([motion.time, motion.q])
    lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in table)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def angle_sheet(dance: Dance, angles: Array) -> str:
    """Return the postures as a Markdown table of joint angles, degrees: ``angles`` (P, n) rad of all postures of the
    dance.
    """
    joints = [joint.name for joint in dance.body.joints]
    lines = [
        "# The dance, posture by posture",
        "",
        f"Angles in degrees. {float(np.median(dance.move)):g} s to get to each posture (`dance.csv` says how), then "
        f"{float(dance.hold.max()):g} s of standing still. Feet that stand are flat and point straight ahead.",
        "",
        f"| | feet | {' | '.join(name.replace('_', ' ') for name in joints)} |",
        "|---" * (len(joints) + 2) + "|",
    ]
    for number, (stance, row) in enumerate(zip(dance.stances, np.degrees(angles), strict=True), start=1):
        lines.append(f"| {number} | {stance_words(stance)} | {' | '.join(f'{angle + 0.0:.1f}' for angle in row)} |")
    return "\n".join(lines) + "\n"

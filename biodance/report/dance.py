"""A designed dance: numbers, files for the screen, the robot and the caller, cards, and what is printed."""

from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from biodance.body.body import Body
from biodance.dance.cues import REST, cue_sheet, dance_instructions, rests
from biodance.dance.dance import Dance
from biodance.dance.playback import Rehearsal
from biodance.dance.problem.feet import room_on_plates
from biodance.dance.problem.stance import Stance, stance_words
from biodance.display import spaced
from biodance.lab.c3d.write import write_c3d
from biodance.lab.plain_text import for_spreadsheet
from biodance.pipeline.dance import (
    DanceResult,
    before_cues,
    held_postures,
    not_safe,
    preview_markers,
    preview_parameters,
    setpoints,
)
from biodance.pipeline.still import posture_still, props, silhouettes
from biodance.records import Array
from biodance.report.figures.dance import criterion_figure, expectation_figure, postures_figure, zmp_figure
from biodance.report.figures.solid import sheet_png
from biodance.report.figures.style import SIDE_COLOURS
from biodance.report.files import write_results
from biodance.report.pages.language import ENGLISH, N_, posture_said, read_language
from biodance.report.pages.template import render
from biodance.report.tables.schema import Row, Schema, markdown_table, plain_values, shown
from biodance.report.terminal import print_line, print_table

_Eyes = tuple[tuple[str, tuple[float, float]], ...]
_VIEWS: _Eyes = ((N_("from the front"), (1.0, 0.0)), (N_("from the right"), (0.0, -1.0)))
"""Where the eye is in the horizontal plane, for a person who faces lab x."""
_TALL, _GAP, _LABEL = 150.0, 12.0, 70.0
"""Height of the picture in its own units, what is left between the views, and the room that their words take."""


def mannequin_svg(body: Body, q: Array, title: str, eyes: _Eyes = _VIEWS, stance: Stance | None = None) -> str:
    """Return the picture of the posture ``q`` (nq,) by ``eyes``, with stool and grips of the ``stance``; ``title`` is
    read to who cannot see it.
    """
    views = [(words, silhouettes(body, q, eye), props(stance, eye)) for words, eye in eyes]
    height = max(float(outline[..., 1].max()) for _, outline, _ in views[0][1])
    # the first view's height fills the picture; a small robot or a child stays smaller than that
    scale, drawn, left = _TALL / max(height, 1.2), list[str](), 0.0
    for words, parts, lines in views:
        across = np.concatenate([outline[:, 0] for outline in (*(part[1][0] for part in parts), *lines)])
        wide = scale * float(np.ptp(across))
        room = max(wide, _LABEL)
        start = left + (room - wide) / 2 - scale * float(across.min())

        def path(points: Array, start: float = start) -> str:
            return " ".join(f"{start + scale * u:.1f},{_TALL - scale * z:.1f}" for u, z in points)

        drawn += [f'<polyline points="{path(line)}" fill="none" stroke="#46535f" stroke-width="2"/>' for line in lines]
        for name, (outline,), _ in sorted(parts, key=lambda one: float(one[2][0])):
            side = name.partition("_")[0]
            colour = "#8d99a6" if side not in SIDE_COLOURS or side == "middle" else SIDE_COLOURS[side][0]
            drawn.append(f'<polygon points="{path(outline)}" fill="{colour}"/>')
        drawn.append(f'<text x="{left + room / 2:.0f}" y="{_TALL + 14:.0f}">{words}</text>')
        left += room + _GAP
    return (
        f'<svg role="img" aria-label="{title}" viewBox="-3 -6 {left:.0f} {_TALL + 22:.0f}" stroke="#fff" '
        f'stroke-width="0.8">{"".join(drawn)}</svg>'
    )


def cards_page(result: DanceResult, language: str | Path = ENGLISH) -> str:
    """Return the page (HTML) of a dance that keeps its limits, in a ``language`` of `read_language`."""
    from markupsafe import Markup

    dance, words = result.dance, read_language(language)
    assert dance is not None
    say, postures, cues, pauses = words.say, held_postures(dance).q, [], rests(dance)
    for p, (said, stance) in enumerate(zip(dance_instructions(dance, say), dance.stances, strict=True)):
        name = posture_said(dance.names[p], say) if dance.names else say("posture")
        feet = say(stance_words(stance))
        title = f"{p + 1}. {name}, {feet}"
        views = tuple((say(view), eye) for view, eye in _VIEWS)
        picture = Markup(mannequin_svg(dance.body, postures[p], str(Markup.escape(title)), views, stance))
        called = {"number": p + 1, "name": name[:1].upper() + name[1:], "feet": feet, "said": said}
        cues.append(called | {"picture": picture, "rest": say(REST) if pauses[p] else ""})
    return render(
        "cues.html.j2",
        language=words.tag,
        say=say,
        name=dance.protocol,
        count=len(cues),
        minutes=words.count("about %(number)s minute", "about %(number)s minutes", max(1, round(dance.duration / 60))),
        move=words.short(float(np.median(dance.move))),
        hold=words.short(float(np.max(dance.hold))),
        about=before_cues(result, say, words.number),
        care=[say(one) for one in dance.care],
        unsafe=not_safe(dance, say, words.number),
        cues=cues,
    )


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
    """Return the expected standard deviations (RMS over segments) of the dance, and of postures chosen freely."""
    if made.expectation is None or made.freely is None:
        return None
    both = {"with": made.expectation, "without": made.freely}
    return {
        f"{key}_{unit}": {name: float(np.sqrt(np.mean(getattr(one, key)[-1] ** 2))) for name, one in both.items()}
        for key, unit in (("mass", "kg"), ("com", "m"))
    } | {"sentence": made.price}


def _counted(made: DanceResult) -> Row | None:
    """Return how many things are called at once, on average and at most."""
    counts = [len(said) for said in dance_instructions(made.dance)] if made.dance else []
    return {"mean": float(np.mean(counts)), "max": max(counts)} if counts else None


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
        "notes": lambda made: made.left_out,
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


def write_dance(
    result: DanceResult, folder: Path, *, despite: bool = False, language: str | Path = ENGLISH
) -> dict[str, Any]:
    """Write all files of a dance into ``folder`` (which exists) and return the content of ``results.json``; the cards
    in a ``language``.

    A dance that does not keep every limit is not written: then ``results.json`` alone says why. Of one that imprecise
    people cannot dance safely what leads a person is only written ``despite`` that.
    """
    found: dict[str, Any] = plain_values(dance_document(result))
    texts: dict[str, str] = {}
    if result.dance is not None and result.account is not None and result.expectation is not None:
        dance = result.dance
        dance.save(folder / "dance.npz")
        if despite or not dance.unsafe:
            texts |= _leading(result, dance, folder, language)
        said = ("", "# What was left out or corrected", *result.left_out)
        left_out = "\n\n".join(said) + "\n" if result.left_out else ""
        checked = "Checked on the finished dance, every 0.01 s, by other code than its design."
        margins = markdown_table(MARGIN_ROW, found["margins"])
        texts["margins.md"] = f"# What is left of every limit\n\n{checked}\n\n{margins}{left_out}"
        counted = np.flatnonzero(dance.counted).tolist()
        words = {"parallel": "feet parallel", "right_forward": "right forward", "seated": "seated"}
        names = [dance.stances[p].name for p in counted]
        stood = [words.get(name, f"on the {name.removeprefix('single_')}") for name in names]
        titles = tuple(f"{p + 1} {said}" for p, said in zip(counted, stood, strict=True))
        postures = held_postures(dance, counted).q
        drawn = {
            "postures": postures_figure(dance.body, postures, titles),
            "criterion": criterion_figure(result.account.dynamic, result.account.dynamic_bound),
            "zmp": zmp_figure(result.account.paths),
            "expectation": expectation_figure(result.expectation),
        }
        for name, figure in drawn.items():
            figure.savefig(folder / f"{name}.png", dpi=160, metadata={"Software": None})
        stills = [posture_still(dance.body, q, title) for q, title in zip(postures, titles, strict=True)]
        if picture := sheet_png(stills):
            (folder / "postures_3d.png").write_bytes(picture)
    return write_results(folder, found, texts)


def _leading(result: DanceResult, dance: Dance, folder: Path, language: str | Path) -> dict[str, str]:
    """Write dance.c3d; return what leads a person, or a robot, through the dance by file; NOT SAFE comes first."""
    if not dance.body.markers.names:
        return {"cues.md": angle_sheet(dance), "dance.csv": angle_table(dance)}
    path = folder / "dance.c3d"
    write_c3d(path, markers=preview_markers(dance), parameters=preview_parameters(dance))
    words = read_language(language)
    say = words.say
    cues = cue_sheet(
        dance_instructions(dance, say),
        tuple(say(stance_words(s)) for s in dance.stances),
        tempo=(float(np.median(dance.move)), float(np.max(dance.hold))),
        names=tuple(posture_said(name, say) for name in dance.names),
        about=(
            *not_safe(dance, say, words.number),
            *(say(one) for one in dance.care),
            *before_cues(result, say, words.number),
        ),
        rests=rests(dance),
        say=say,
        short=words.short,
    )
    return {"cues.md": cues, "cues.html": cards_page(result, language)}


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
        f"# The dance, posture by posture\n\nAngles in degrees. {float(np.median(dance.move)):g} s to get to each "
        f"posture (`dance.csv` says how), then {float(dance.hold.max()):g} s of standing still. Feet that stand are "
        "flat and point straight ahead.\n",
        f"| | feet | {' | '.join(joints)} |\n{'|---' * (len(joints) + 2)}|",
    ]
    for number, (stance, row) in enumerate(zip(dance.stances, angles, strict=True), start=1):
        lines.append(f"| {number} | {stance_words(stance)} | {' | '.join(f'{angle + 0.0:.1f}' for angle in row)} |")
    return "\n".join(lines) + "\n"


def print_dance(found: Row, console: Console) -> None:
    """Print what was designed: its size, its criteria, the margins and what will be known."""
    if found["feasible"]:
        criterion = found["criterion"]
        print_line(console, shown("{postures} postures, {transitions} moves, {duration_s:0} s ({protocol})", found))
        share = criterion["static"] / criterion["static_bound"]
        print_line(console, f"static criterion {criterion['static']:.1f} kg, {share:.2f} of its bound")
        print_table(MARGIN_ROW, found["margins"], console, title="least margins")
        print_table(EXPECTED_ROW, found["expected_sd"], console, title="expected standard deviations")
        if criterion["hardly_excited"]:
            print_line(console, f"hardly tilted: {', '.join(criterion['hardly_excited'])}")
    if found["simplicity_price"]:
        print_line(console, found["simplicity_price"]["sentence"])
    for note in (*found["warnings"], *found["emphasis"], *found["notes"]):
        print_line(console, f"look: {note}")

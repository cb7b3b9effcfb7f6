"""The page that shows visits of one person side by side: the sentence, curves of all visits, every quantity."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from biodance.cycles.curves import ANGLE_PANELS, LOAD_PANELS, CurveGroup
from biodance.cycles.cut import PERCENT
from biodance.display import BLUE, GREY, RED
from biodance.pipeline.visits import VisitComparison
from biodance.report.figures.curves import Curve, CurveFigure, Strip
from biodance.report.figures.vector import Stroke
from biodance.report.files import for_spreadsheets, write_files
from biodance.report.pages.movement import CYCLE_AXES, CYCLE_KINDS, LEAST_SPANS, curve_title
from biodance.report.pages.template import print_sheet, render, template_text
from biodance.report.tables.schema import Row, plain_values, to_text
from biodance.report.tables.visits import (
    QUANTITY_ROW,
    quantities_frame,
    shown_quantities,
    visit_place,
    visits_document,
)
from biodance.report.wording import millimetres, moment
from biodance.uncertainty.visits import placement_sizes
from biodance.version import __version__

COMPARE_PAGE = "compare.html"
_COLOURS = {"right": BLUE, "left": RED, "middle": BLUE}
_DASHES = ("5 3", "2 2", "8 3 2 3", "1 3")
"""Of all visits but the last, in turn."""


def _looks(count: int, side: str) -> list[Stroke]:
    """Return how the curves of each visit look: the last one full in the side's colour, the others grey, dashed."""
    return [*(Stroke(GREY, _DASHES[k % len(_DASHES)]) for k in range(count - 1)), Stroke(_COLOURS[side], "", 1.6)]


def visits_figure(found: VisitComparison, kind: str, side: str, quantities: Sequence[str]) -> str:
    """Return one panel for each quantity of the cycles of a ``kind`` on a ``side``: the mean of every visit with one
    standard deviation between its cycles, and how many they are; "" where no quantity is known in two visits.
    """
    looks, cells = _looks(len(found.visits), side), []
    by_visit = [{(one.kind, one.quantity, one.side): one for one in groups} for groups in found.curves()]
    for quantity in quantities:
        some = [groups.get((kind, quantity, side)) for groups in by_visit]
        known = [one for one in some if one is not None and np.isfinite(one.mean).any()]
        if len(known) > 1:
            curves = [
                Curve(visit.name, one.mean, look, one.sd if np.isfinite(one.sd).any() else None)
                for visit, one, look in zip(found.visits, some, looks, strict=True)
                if one is not None and np.isfinite(one.mean).any()
            ]
            title = f"{curve_title(known[0])}, n = {_counts(some)}"
            cells.append([Strip(title, curves, least=LEAST_SPANS.get(known[0].unit, 0.0))])
    if not cells:
        return ""
    about = f"{CYCLE_KINDS[kind]}, {side} side, all visits on one plot"
    return CurveFigure(PERCENT, cells, about, label=CYCLE_AXES[kind], band="± 1 sd between cycles").html()


def _counts(some: Sequence[CurveGroup | None]) -> str:
    return ", ".join("0" if one is None else str(len(one.values)) for one in some)


def _figures(found: VisitComparison) -> list[tuple[str, str, str]]:
    """Return title, angles and loads of every kind of cycle and side that is known in two visits."""
    drawn = []
    for kind, said in CYCLE_KINDS.items():
        for side in ("right", "left", "middle"):
            angles, loads = (visits_figure(found, kind, side, some) for some in (ANGLE_PANELS, LOAD_PANELS))
            if angles or loads:
                drawn.append((f"{said}, {'trunk and pelvis' if side == 'middle' else side}", angles, loads))
    return drawn


def placement_words() -> str:
    """Return what placing the markers anew is taken to add, in words, from the table of sizes."""
    size = placement_sizes()
    turn, axis = (f"{np.degrees(size[name]):.0f} degrees" for name in ("frame", "knee axis"))
    hip, knee, ankle, marker, slide, event = (
        millimetres(size[name], 0) for name in ("hip", "knee", "ankle", "marker", "skin", "event")
    )
    return (
        f"a segment's frame turns by {turn} (judgement), that of the thigh also by {axis} with the axis between the "
        f"epicondyles (Della Croce 1999); the centres of hip, knee and ankle move by {hip}, {knee} and {ankle} mm "
        f"(Harrington 2007; judgement); a heel's place at a strike by {marker} mm, skin over pelvis and trunk by "
        f"{slide} mm per radian of the limbs (Leardini 2005); a strike by {event} ms"
    )


def visits_page(found: VisitComparison, document: Row) -> str:
    """Return the page as HTML text."""
    from markupsafe import Markup

    names = [one.name for one in found.visits]
    rows, title = shown_quantities(found), f"Visits {' and '.join((names[0], names[-1]))}"
    sheet = print_sheet(title, {}, f"biodance {__version__}, {moment(document['created_utc'])}")
    return render(
        "visits.html.j2",
        scripts=[template_text("curves.js")],
        sheet=Markup(sheet),
        title=title,
        version=__version__,
        document=document,
        schema=QUANTITY_ROW,
        placed=placement_words(),
        told=[row for row in rows if row["changed"]],
        others=[row for row in rows if not row["changed"]],
        figures=[(said, Markup(angles), Markup(loads)) for said, angles, loads in _figures(found)],
        attention=[(visit_place(one), one["text"]) for one in document["attention"]],
    )


def write_visits(found: VisitComparison, folder: Path) -> Row:
    """Write ``compare.html``, ``results.json`` and ``quantities.csv`` into ``folder`` (which exists) and return the
    numbers.
    """
    document = visits_document(found)
    texts = {
        "results.json": to_text(document),
        COMPARE_PAGE: visits_page(found, document),
        "quantities.csv": for_spreadsheets(quantities_frame(found)).to_csv(index=False, lineterminator="\n"),
    }
    write_files(folder, texts)
    return dict(plain_values(document))

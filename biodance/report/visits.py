"""What changed between visits of one person: numbers, the page, and what `biodance compare` prints."""

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from biodance.cycles.cut import PERCENT
from biodance.cycles.summary import ANGLE_PANELS, LOAD_PANELS
from biodance.display import BLUE, GREY, RED, spaced
from biodance.pipeline.saved_results import now, provenance
from biodance.pipeline.visits import ComparedQuantity, Untested, VisitComparison
from biodance.report.figures import vector as svg
from biodance.report.figures.session import CYCLE_AXES, LEAST_SPANS, curve_title
from biodance.report.files import csv_text, write_results
from biodance.report.pages.movement import CYCLE_KINDS
from biodance.report.pages.template import print_sheet, render, template_text
from biodance.report.tables.diagnosis import ATTENTION_ROW
from biodance.report.tables.schema import Row, Schema, table_of
from biodance.report.terminal import print_line, print_table
from biodance.report.wording import changed, millimetres, sized_together
from biodance.uncertainty.visits import FEWEST_STRIDES, placement_sizes

if TYPE_CHECKING:
    from pandas import DataFrame


QUANTITY_ROW = Schema(
    "name kind quantity key side unit values ci95 counts change change_ci95 p placement_sd changed why",
    shown="quantity: {told} | by visit: {by_visit} | change: {change:change} | 95 % interval: {interval} | "
    "cycles: {counted}",
)
"""A quantity in all visits; ``changed`` beyond chance (false discovery rate 5 %)."""
_UNTESTED = {
    Untested.NO: "",
    Untested.FEW_CYCLES: f"fewer than {FEWEST_STRIDES} cycles in a visit",
    Untested.NOT_KNOWN: "not known from these visits",
}
_VISIT = Schema("session=name date trials=#moved.trials")


def visits_document(found: VisitComparison) -> Row:
    """Return all that was found: the sentence, every visit, every quantity, and what needs a person."""
    made = now()
    visits = [_VISIT.row(one) | {"provenance": provenance(one.result, created=made)} for one in found.visits]
    return {
        "text": comparison_sentence(found),
        "visits": visits,
        "changed_count": len(found.changed),
        "tested_count": found.tested,
        "false_discovery_rate": 0.05,
        "quantities": QUANTITY_ROW.rows(found.quantities),
        "notes": list(found.notes),
        "attention": [row for one in found.visits for row in ATTENTION_ROW.rows(one.attention, session=one.name)],
        "created_utc": made,
    }


def comparison_sentence(found: VisitComparison) -> str:
    """Return in one sentence what changed: how many quantities, and the largest beside its uncertainty."""
    untested = len(found.quantities) - found.tested
    if not found.tested:
        return "Nothing can be told to have changed: no quantity has an interval in the first and the last visit."
    if not found.changed:
        few = f"None of the {found.tested} quantities that could be tested ({len(found.quantities)} in all)"
        return f"{few if untested else 'Nothing'} changed beyond its uncertainty."
    one, count = found.changed[0], len(found.changed)
    assert one.change_ci95 is not None
    return (
        f"{count} of {found.tested} quantities changed beyond {'their' if count > 1 else 'its'} uncertainty"
        f"{', most clearly' if count > 1 else ':'} {quantity_in_words(one)}, by {changed(one.change, one.unit)} "
        f"(95 % interval {_interval(one.change_ci95, one.unit)})."
    )


def quantity_in_words(one: ComparedQuantity) -> str:
    """Return a quantity as a person says it: ``left knee flexion, maximum``; a squat's or a rise's says so."""
    side = f"{one.side} " if one.side in ("left", "right") else ""
    kind = {"squat": " (squat)", "sit_to_stand": " (rise)", "jump": " (jump)"}.get(one.kind, "")
    return f"{side}{spaced(one.quantity)}{f', {spaced(one.key)}' if one.key else ''}{kind}"


def _interval(interval: tuple[float, float] | None, unit: str) -> str:
    """Return both ends, the unit once: ``+142 to +186 mm``."""
    return "–" if interval is None else sized_together(interval, unit, " to ", signed=True)


def shown_quantities(found: VisitComparison) -> list[Row]:
    """Return the rows of `QUANTITY_ROW` with what people see of them."""
    return [
        QUANTITY_ROW.row(one)
        | {
            "told": quantity_in_words(one),
            "by_visit": sized_together(one.values, one.unit, ", "),
            "interval": _UNTESTED[one.why] or _interval(one.change_ci95, one.unit),
            "counted": ", ".join(map(str, one.counts)) if any(one.counts) else "–",
        }
        for one in found.quantities
    ]


def quantities_frame(found: VisitComparison) -> "DataFrame":
    """Return one row for each quantity, with a column for each visit's value and ends of its interval."""
    rows, columns = [], ["name", "kind", "side", "unit"]
    count = len(found.visits)
    columns += [f"{what}_{k + 1}" for k in range(count) for what in ("value", "low", "high", "cycles")]
    columns += ["change", "change_low", "change_high", "p", "changed", "why"]
    for one in found.quantities:
        row: Row = {"name": one.name, "kind": one.kind, "side": one.side, "unit": one.unit}
        for k, (value, ends, cycles) in enumerate(zip(one.values, one.ci95, one.counts, strict=True), 1):
            low, high = ends or (math.nan, math.nan)
            row |= {f"value_{k}": value, f"low_{k}": low, f"high_{k}": high, f"cycles_{k}": cycles}
        low, high = one.change_ci95 or (math.nan, math.nan)
        row |= {"change": one.change, "change_low": low, "change_high": high, "p": one.p}
        rows.append(row | {"changed": one.changed, "why": one.why.value})
    return table_of(rows, columns)


def visit_place(one: Row) -> str:
    """Return where a sentence that needs a person belongs: visit, trial."""
    return ", ".join(filter(None, (one["session"], one["trial"])))


COMPARE_PAGE = "compare.html"
_DASHES = ("5 3", "2 2", "8 3 2 3", "1 3")  # Of all visits but the last, in turn


def visits_figure(found: VisitComparison, kind: str, side: str, quantities: Sequence[str]) -> str:
    """Return a panel a quantity with the mean and sd of every visit; "" where none is known in two visits."""
    # the last visit is drawn full in the side's colour, the others grey and dashed
    looks = [svg.Stroke(GREY, _DASHES[k % len(_DASHES)]) for k in range(len(found.visits) - 1)]
    looks, cells = [*looks, svg.Stroke({"right": BLUE, "left": RED, "middle": BLUE}[side], "", 1.6)], []
    by_visit = [{(one.kind, one.quantity, one.side): one for one in groups} for groups in found.curves()]
    for quantity in quantities:
        some = [groups.get((kind, quantity, side)) for groups in by_visit]
        known = [one for one in some if one is not None and np.isfinite(one.mean).any()]
        if len(known) > 1:
            curves = [
                svg.Curve(visit.name, one.mean, look, one.sd if np.isfinite(one.sd).any() else None)
                for visit, one, look in zip(found.visits, some, looks, strict=True)
                if one is not None and np.isfinite(one.mean).any()
            ]
            counts = ", ".join("0" if one is None else str(len(one.values)) for one in some)
            title = f"{curve_title(known[0])}, n = {counts}"
            cells.append([svg.Strip(title, curves, least=LEAST_SPANS.get(known[0].unit, 0.0))])
    if not cells:
        return ""
    about = f"{CYCLE_KINDS[kind]}, {side} side, all visits on one plot"
    return svg.CurveFigure(PERCENT, cells, about, label=CYCLE_AXES[kind], band="one sd between cycles").html()


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

    names, figures = [one.name for one in found.visits], []
    for kind, side in product(CYCLE_KINDS, ("right", "left", "middle")):
        angles, loads = (Markup(visits_figure(found, kind, side, some)) for some in (ANGLE_PANELS, LOAD_PANELS))
        if angles or loads:
            about = f"{CYCLE_KINDS[kind]}, {'trunk and pelvis' if side == 'middle' else side}"
            figures.append((about, angles, loads))
    rows, title = shown_quantities(found), f"Visits {' and '.join((names[0], names[-1]))}"
    return render(
        "visits.html.j2",
        scripts=[template_text("curves.js")],
        sheet=print_sheet(title, {}, document["created_utc"]),
        title=title,
        document=document,
        schema=QUANTITY_ROW,
        placed=placement_words(),
        told=[row for row in rows if row["changed"]],
        others=[row for row in rows if not row["changed"]],
        figures=figures,
        attention=[(visit_place(one), one["text"]) for one in document["attention"]],
    )


def write_visits(found: VisitComparison, folder: Path) -> Row:
    """Write ``compare.html``, ``results.json`` and ``quantities.csv`` into ``folder``; return the numbers."""
    document = visits_document(found)
    texts = {
        COMPARE_PAGE: visits_page(found, document),
        "quantities.csv": csv_text(quantities_frame(found)),
    }
    return write_results(folder, document, texts)


def print_compared(found: VisitComparison, document: Row, console: Console) -> None:
    """Print the sentence, the quantities that changed, and what needs a person."""
    print_line(console, document["text"])
    if found.changed:
        print_table(QUANTITY_ROW, [row for row in shown_quantities(found) if row["changed"]], console)
    for one in document["attention"]:
        print_line(console, f"{visit_place(one)}: {one['text']}")
    for note in document["notes"]:
        print_line(console, note)

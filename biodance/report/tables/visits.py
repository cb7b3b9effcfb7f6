"""What changed between visits of one person, for programs and people."""

import math
from typing import TYPE_CHECKING

from biodance.display import spaced
from biodance.pipeline.provenance import now, provenance
from biodance.pipeline.visit_quantity import ComparedQuantity, Untested
from biodance.pipeline.visits import VisitComparison
from biodance.report.tables.schema import Row, Schema, table_of
from biodance.report.tables.session import PROVENANCE_ROW
from biodance.report.wording import changed, sized_together
from biodance.uncertainty.visits import FEWEST_STRIDES

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
VISIT_ATTENTION = Schema("level text trial about")


def visits_document(found: VisitComparison) -> Row:
    """Return all that was found: the sentence, every visit, every quantity, and what needs a person."""
    made = now()
    visits = [
        _VISIT.row(one) | {"provenance": PROVENANCE_ROW.row(provenance(one.result, created=made))}
        for one in found.visits
    ]
    return {
        "text": comparison_sentence(found),
        "visits": visits,
        "changed_count": len(found.changed),
        "tested_count": found.tested,
        "false_discovery_rate": 0.05,
        "quantities": QUANTITY_ROW.rows(found.quantities),
        "notes": list(found.notes),
        "attention": [row for one in found.visits for row in VISIT_ATTENTION.rows(one.attention, session=one.name)],
        "created_utc": made,
    }


def comparison_sentence(found: VisitComparison) -> str:
    """Return in one sentence what changed: how many quantities, and the largest beside its uncertainty."""
    if not found.tested:
        return "Nothing can be told to have changed: no quantity has an interval in the first and the last visit."
    if not found.changed:
        untested = len(found.quantities) - found.tested
        few = f" {untested} of {len(found.quantities)} quantities could not be tested." if untested else ""
        return f"Nothing changed beyond its uncertainty.{few}"
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
    kind = {"squat": " (squat)", "sit_to_stand": " (rise)"}.get(one.kind, "")
    return f"{side}{spaced(one.quantity)}{f', {spaced(one.key)}' if one.key else ''}{kind}"


def _interval(interval: tuple[float, float] | None, unit: str) -> str:
    """Return both ends, the unit once: ``+142 to +186 mm``."""
    if interval is None:
        return "–"
    return sized_together(interval, unit, " to ", signed=True)


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

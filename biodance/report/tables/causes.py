"""The causes that a diagnosis looks for, with their parameters and units, for those who hide or name one."""

from collections.abc import Iterable

from biodance.effects import Cause, DiscreteEffect
from biodance.report.tables.schema import Row, Schema
from biodance.virtual_lab.causes import CAUSES

_PARAMETER = Schema("name unit typical")
CAUSE_ROW = Schema(
    "effect=name what=about.what",
    {
        "parameters": lambda one: [] if isinstance(one, DiscreteEffect) else _PARAMETER.rows(one.parameters),
        "can_be_simulated": lambda one: one.name in CAUSES,
    },
    "effect: {effect} | parameters: {told} | simulate: {simulated} | what it is: {what}",
)


def causes_document(causes: Iterable[Cause]) -> list[Row]:
    """Return every cause: its name, parameters with unit and typical size ([] = it is there or not), what it is, and
    whether ``biodance simulate --effect`` can hide it.
    """
    return CAUSE_ROW.rows(causes)


def causes_shown(rows: Iterable[Row]) -> list[Row]:
    """Return the rows with what people see of parameters."""
    return [
        row
        | {
            "told": ", ".join(f"{one['name']} ({one['unit']})" for one in row["parameters"]) or "–",
            "simulated": "yes" if row["can_be_simulated"] else "no",
        }
        for row in rows
    ]

"""The one table of how wrong things are, ``anthropometry/uncertainty/sizes.csv``, with source and unit."""

import functools

from biodance.body.tables.anthropometry import TableRow, read_table
from biodance.errors import UnknownName
from biodance.lab.markers.sets import part_of


def error_rows(*, whose: str = "believed") -> tuple[TableRow, ...]:
    """Return the rows of the table: those ``believed``, or those that the ``virtual`` laboratory draws from."""
    return read_table("uncertainty", "sizes").where(whose=whose)


@functools.cache
def error_size(quantity: str, target: str, *, state: str = "any") -> float:
    """Return one standard deviation of an error in the unit of the table (SI, per axis).

    ``state`` of a joint: "before" or "after" functional calibration; "any" for what does not depend on it.

    Raises
    ------
    UnknownName
        The table has no such row.
    """
    row = {"quantity": quantity, "target": target, "state": state, "whose": "believed"}
    return float(read_table("uncertainty", "sizes").row(**row)["sd"])


def joint_size(quantity: str, joint: str, *, state: str = "before") -> float:
    """Return the size of ``joint_centre`` (m per axis) or ``tilt`` (rad) of a joint, sides alike, before any
    functional calibration, or of a ``state`` of its own; of a joint that the table does not name that of "other" ones.
    """
    try:
        return error_size(quantity, part_of(joint), state=state)
    except UnknownName:
        return error_size(quantity, "other", state=state)

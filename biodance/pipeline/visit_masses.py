"""What changed in the masses of a person between visits: the segments', and the whole that the plates weigh."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import ndtr

from biodance.errors import BiodanceError
from biodance.identification.knowledge import SIGMAS, Known
from biodance.identification.sessions import Difference, differences
from biodance.pipeline.identification import SessionIdentification
from biodance.pipeline.trial_result import Weighing
from biodance.pipeline.visit_quantity import ComparedQuantity, Untested
from biodance.records import side_in_name

BODY_KIND = "body"
"""Where the cycles of other quantities have their kind."""


def mass_quantities(
    visits: Sequence[tuple[SessionIdentification | None, Weighing | None]],
    refusals: Sequence[str],
    *,
    tell: Callable[[str], None],
) -> tuple[list[ComparedQuantity], list[str]]:
    """Return the masses that the first and the last visit have in common, and why others are not compared.

    ``refusals`` why a visit says nothing of the body, "" where it does. Those of the segments are what
    `biodance.compare_sessions` returns.
    """
    found, notes = [], [why for why in (refusals[0], refusals[-1]) if why]
    weighed = [one for _, one in visits]
    if weighed[0] is not None and weighed[-1] is not None:
        found.append(_whole(weighed, weighed[0], weighed[-1]))
    first, last = visits[0][0], visits[-1][0]
    if first is None or last is None:
        return found, [f"The masses of the segments are not compared: {why}" for why in notes]
    tell("comparing the bodies")
    try:
        changes = differences(first.identification, last.identification)
    except BiodanceError as why:
        return found, [f"The masses of the segments are not compared: {why}"]
    masses = [_by_segment(one) for one, _ in visits]
    found += [_segment(one, [some.get(one.segment) for some in masses]) for one in changes if one.quantity == "mass"]
    return found, []


def _by_segment(one: SessionIdentification | None) -> dict[str, Known]:
    rows = one.identification.known if one is not None else ()
    return {row.segment: row for row in rows if row.quantity == "mass"}


def _whole(weighed: Sequence[Weighing | None], first: Weighing, last: Weighing) -> ComparedQuantity:
    """Return the mass that the plates carry, each visit with its own error."""
    change, sd = last.mass - first.mass, float(np.hypot(first.sd, last.sd))
    return ComparedQuantity(
        kind=BODY_KIND, quantity="total_mass", key="", side="both", unit="kg",
        values=tuple(one.mass if one else None for one in weighed),
        ci95=tuple((one.mass - SIGMAS * one.sd, one.mass + SIGMAS * one.sd) if one else None for one in weighed),
        counts=(0,) * len(weighed),
        change=change, change_ci95=(change - SIGMAS * sd, change + SIGMAS * sd), p=float(2 * ndtr(-abs(change) / sd)),
    )  # fmt: skip


def _segment(one: Difference, known: Sequence[Known | None]) -> ComparedQuantity:
    """Return the mass of one segment; a change of which neither visit's data know anything is not tested."""
    side = side_in_name(one.segment)
    return ComparedQuantity(
        kind=BODY_KIND, quantity=f"{one.segment.removeprefix(f'{side}_')}_mass", key="", side=side, unit="kg",
        values=tuple(row.value if row else None for row in known),
        ci95=tuple(row.interval if row else None for row in known),
        counts=(0,) * len(known), change=one.value, change_ci95=one.interval if one.known else None,
        p=one.p if one.known else None, why=Untested.NO if one.known else Untested.NOT_KNOWN,
    )  # fmt: skip

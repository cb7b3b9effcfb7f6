"""Girths of the body: which are known by name, which values a person can have; `anthropometry/human/girths.csv`."""

import csv
import functools
from collections.abc import Mapping
from difflib import get_close_matches
from types import MappingProxyType

from biodance.errors import SessionRefused
from biodance.library import locate
from biodance.records import SIDES

_ALIASES = {"calf": "shank"}
"""What else a girth is called."""
_LEGAL = (0.4, 2.2)
"""Of the usual girth: smaller or larger ones are another unit or a slip of the pen."""
_MIDDLE = ("hip", "waist", "chest", "neck", "head")


@functools.cache
def usual_girths() -> Mapping[str, float]:
    """Return the usual girth of an adult in m, by name, the sexes' mean."""
    with locate("anthropometry/human", "girths", ".csv").open(encoding="utf-8") as file:
        found = {row["girth"]: (float(row["F"]) + float(row["M"])) / 2 for row in csv.DictReader(file)}
    return MappingProxyType(found)


def legal_girths(given: Mapping[str, float]) -> dict[str, float]:
    """Return girths (m) by name: ``thigh`` of both sides, ``right_thigh`` of one; a calf is the girth of the shank.

    Raises
    ------
    SessionRefused
        A name is not known, stands for two entries, has a side that it cannot have, or the value is no person's.
    """
    found: dict[str, float] = {}
    for said, value in given.items():
        side = next((f"{side}_" for side in SIDES if said.startswith(f"{side}_")), "")
        short = said.removeprefix(side)
        name = _ALIASES.get(short, short)
        if name not in usual_girths() or (side and name in _MIDDLE):
            raise SessionRefused(_unknown(said))
        if f"{side}{name}" in found:
            raise SessionRefused(f"girths_cm: {side}{name} is given twice (also as {said!r}). Keep one of the two.")
        _refuse_impossible(said, value, usual_girths()[name])
        found[f"{side}{name}"] = float(value)
    return found


def _unknown(said: str) -> str:
    legal = (*usual_girths(), *_ALIASES)
    close = get_close_matches(said, legal, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return (
        f"girths_cm: there is no girth {said!r}.{hint} Legal: {', '.join(legal)}; with right_ or left_ before those "
        "of arms and legs."
    )


def _refuse_impossible(said: str, value: float, usual: float) -> None:
    low, high = (share * usual for share in _LEGAL)
    if low <= value <= high:
        return
    units = {"mm": value / 10, "m": value * 100, "inch": value * 2.54}
    unit = next((unit for unit, one in units.items() if 0.6 * usual <= one <= 1.6 * usual), "")
    hint = f" It looks like {unit}: write {100 * units[unit]:.1f}." if unit else " Measure again, in cm."
    raise SessionRefused(
        f"girths_cm: {said} = {100 * value:g} cm is no person's. Legal: {100 * low:.0f} to {100 * high:.0f} cm.{hint}"
    )

"""What somebody measured of a person's shape: girths, which are known by name and which values a person can have
(`anthropometry/human/girths.csv`); and the outlines of both feet in cm, in a table, or as traced points.
"""

import csv
import functools
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType

import numpy as np

from biodance.errors import SessionRefused
from biodance.library import locate
from biodance.records import SIDES, Array, FootSizes

_ALIASES = {"calf": "shank"}  # What else a girth is called
_LEGAL = (0.4, 2.2)  # Of the usual girth: smaller or larger ones are another unit or a slip of the pen
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


_LEGAL_SIZES = {"length": (0.12, 0.36), "breadth": (0.05, 0.15), "heel_breadth": (0.03, 0.11)}  # m
_HEEL = 0.15  # Share of the length, from the heel, at which its breadth is measured


def typed_outline(given: Mapping[str, float]) -> dict[str, FootSizes]:
    """Return the outline of each foot from sizes in m: ``length`` of both or ``right_length`` of one foot.

    Raises
    ------
    SessionRefused
        A name is not known, a value is no foot's, or a foot misses a size.
    """
    for name, value in given.items():
        short = next((name.removeprefix(f"{side}_") for side in SIDES if name.startswith(f"{side}_")), name)
        if short not in _LEGAL_SIZES:
            raise SessionRefused(
                f"foot_outline: there is no size {name!r}. Legal: {', '.join(_LEGAL_SIZES)}, with right_ or left_ "
                "before for one foot."
            )
        _refuse_impossible_size(name, value, short)
    found: dict[str, FootSizes] = {}
    for side in SIDES if given else ():
        sizes = {name: given.get(f"{side}_{name}", given.get(name)) for name in _LEGAL_SIZES}
        missing = [name for name, value in sizes.items() if value is None]
        if missing:
            raise SessionRefused(
                f"foot_outline: the {side} foot has no {' and no '.join(missing)}. Give all three, in cm."
            )
        found[side] = FootSizes(**{name: float(value) for name, value in sizes.items() if value is not None})
    return found


def _refuse_impossible_size(name: str, value: float, short: str) -> None:
    low, high = _LEGAL_SIZES[short]
    if low <= value <= high:
        return
    unit = next((unit for unit, one in (("mm", value / 10), ("m", value * 100)) if low <= one <= high), "")
    hint = f" It looks like {unit}." if unit else ""
    raise SessionRefused(
        f"foot_outline: {name} = {100 * value:g} cm is no foot's. Legal: {100 * low:.0f} to {100 * high:.0f} cm.{hint}"
    )


def traced_outline(path: str | Path) -> dict[str, FootSizes]:
    """Return the outline of each foot from a CSV file with the columns ``side`` (right, left), ``x_cm`` from the heel
    to the toes and ``y_cm`` across: points in order round each foot.

    Raises
    ------
    SessionRefused
        The file is missing, has other columns, no number where one belongs, or fewer than 12 points of a foot.
    """
    path = Path(path)
    if not path.is_file():
        raise SessionRefused(f"foot_outline: there is no file {path}. Check the path, relative to session.toml.")
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows or not {"side", "x_cm", "y_cm"} <= set(rows[0]):
        raise SessionRefused(f"foot_outline: {path} needs the columns side, x_cm and y_cm and a row for every point.")
    found = {}
    for side in SIDES:
        try:
            points = np.array([[float(row["x_cm"]), float(row["y_cm"])] for row in rows if row["side"] == side]) / 100
        except (TypeError, ValueError):
            raise SessionRefused(f"foot_outline: {path} has no number for x_cm or y_cm of the {side} foot.") from None
        if len(points) < 12 or not np.isfinite(points).all():
            raise SessionRefused(
                f"foot_outline: {path} has {len(points)} points of the {side} foot; trace at least 12 round each foot "
                "(side is right or left)."
            )
        found[side] = _sizes(points)
    return found


def _sizes(points: Array) -> FootSizes:
    """Return length, breadth and heel breadth of points (n, 2) m in order round one foot."""
    x = points[:, 0] - points[:, 0].min()
    length = float(x.max())
    heel = _breadth(x, points[:, 1], _HEEL * length)
    sizes = {"length": length, "breadth": float(np.ptp(points[:, 1])), "heel_breadth": heel}
    for name, value in sizes.items():
        _refuse_impossible_size(name, value, name)
    return FootSizes(**sizes)


def _breadth(x: Array, y: Array, at: float) -> float:
    """Return the breadth of a closed polygon at one place along it."""
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    cut = (x - at) * (x2 - at) < 0
    share = (at - x[cut]) / (x2[cut] - x[cut])
    return float(np.ptp(y[cut] + share * (y2[cut] - y[cut]))) if cut.any() else 0.0

"""Both feet's outlines as somebody drew round or measured them: length, breadth, breadth of the heel; given in cm, in a
table or as traced points.
"""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from biodance.errors import SessionRefused
from biodance.records import SIDES, Array, FootSizes

_LEGAL = {"length": (0.12, 0.36), "breadth": (0.05, 0.15), "heel_breadth": (0.03, 0.11)}
"""m."""
_HEEL = 0.15
"""Share of the length, from the heel, at which its breadth is measured."""


def typed_outline(given: Mapping[str, float]) -> dict[str, FootSizes]:
    """Return the outline of each foot from sizes in m: ``length`` of both or ``right_length`` of one foot.

    Raises
    ------
    SessionRefused
        A name is not known, a value is no foot's, or a foot misses a size.
    """
    for name, value in given.items():
        short = next((name.removeprefix(f"{side}_") for side in SIDES if name.startswith(f"{side}_")), name)
        if short not in _LEGAL:
            raise SessionRefused(
                f"foot_outline: there is no size {name!r}. Legal: {', '.join(_LEGAL)}, with right_ or left_ before "
                "for one foot."
            )
        _refuse_impossible(name, value, short)
    found: dict[str, FootSizes] = {}
    for side in SIDES if given else ():
        sizes = {name: given.get(f"{side}_{name}", given.get(name)) for name in _LEGAL}
        missing = [name for name, value in sizes.items() if value is None]
        if missing:
            raise SessionRefused(
                f"foot_outline: the {side} foot has no {' and no '.join(missing)}. Give all three, in cm."
            )
        found[side] = FootSizes(**{name: float(value) for name, value in sizes.items() if value is not None})
    return found


def _refuse_impossible(name: str, value: float, short: str) -> None:
    low, high = _LEGAL[short]
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
        _refuse_impossible(name, value, name)
    return FootSizes(**sizes)


def _breadth(x: Array, y: Array, at: float) -> float:
    """Return the breadth of a closed polygon at one place along it."""
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    cut = (x - at) * (x2 - at) < 0
    share = (at - x[cut]) / (x2[cut] - x[cut])
    return float(np.ptp(y[cut] + share * (y2[cut] - y[cut]))) if cut.any() else 0.0

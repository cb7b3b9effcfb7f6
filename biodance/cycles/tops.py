"""Tops of a curve that stand out and lie apart."""

import numpy as np

from biodance.records import Array, Index


def find_tops(values: Array, *, prominence: float, apart: int) -> Index:
    """Return the samples at which ``values`` (T,) are higher than beside, in order; of a flat top its middle.

    Of tops nearer than ``apart`` samples the highest is kept; then those go that stand out by less than
    ``prominence`` above the higher one of the two lowest points between them and a higher place, or the end.
    """
    first = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])
    last = np.concatenate([first[1:], [values.size]]) - 1
    level = values[first]
    high = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    tops = (first[high] + last[high]) // 2
    kept = np.ones(tops.size, dtype=bool)
    for one in np.argsort(values[tops], kind="stable")[::-1]:
        if kept[one]:
            near = np.abs(tops - tops[one]) < apart
            near[one] = False
            kept &= ~near
    return np.array([top for top in tops[kept] if _stands_out(values, top) >= prominence], dtype=np.intp)


def _stands_out(values: Array, top: int) -> float:
    """Return by how much a top is above the higher one of the lowest points on its two sides."""
    sides = (values[top::-1], values[top:])
    lowest = []
    for side in sides:
        above = np.flatnonzero(side > values[top])
        lowest.append(side[: above[0] if above.size else None].min())
    return float(values[top] - max(lowest))

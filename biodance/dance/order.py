"""In which order postures are danced: each to one that is near, so that moves are short, smooth and balanced."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from biodance.records import Array

METRE = 3.0
"""rad that a metre of the root counts."""


def walk(x: Array, groups: list[list[int]]) -> list[int]:
    """Return the rows of ``x`` (P, n) coordinates in an order in which neighbours are near; groups stay together, one after the other."""
    scaled = x.copy()
    scaled[:, :3] *= METRE
    apart = np.linalg.norm(scaled[:, None] - scaled[None], axis=2)
    out: list[int] = []
    for group in groups:
        starts: list[int | None] = [None] if out else [*group]
        before = out[-1] if out else None
        paths = [_shortened(_greedy(apart, group, first, before), apart, before) for first in starts]
        lengths = [_length(path, apart) for path in paths]
        out += paths[int(np.argmin(lengths))]
    return out


def _length(path: list[int], apart: Array) -> float:
    return float(sum(apart[a, b] for a, b in pairwise(path)))


def _greedy(apart: Array, group: list[int], first: int | None, before: int | None) -> list[int]:
    left = set(group)
    path = [first if first is not None else min(sorted(left), key=lambda p: apart[before, p])]
    left.discard(path[0])
    while left:
        path.append(min(sorted(left), key=lambda p: apart[path[-1], p]))
        left.discard(path[-1])
    return path


def _shortened(path: list[int], apart: Array, before: int | None) -> list[int]:
    """Return the path with stretches turned round (2-opt) until none helps; ``before`` is where it comes from."""
    table: NDArray[np.float64] = np.pad(apart, ((0, 1), (0, 1)))
    nowhere = len(apart)  # at distance zero from everything
    ends = [nowhere if before is None else before, *path, nowhere]
    better = True
    while better:
        better = False
        for i in range(1, len(ends) - 1):
            for j in range(i + 1, len(ends) - 1):
                a, b, c, d = ends[i - 1], ends[i], ends[j], ends[j + 1]
                if table[a, c] + table[b, d] < table[a, b] + table[c, d] - 1e-9:
                    ends[i : j + 1] = ends[i : j + 1][::-1]
                    better = True
    return ends[1:-1]

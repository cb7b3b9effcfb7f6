"""What no cause describes, compared over an archive: the same thing may be left of several sessions on one plate.

A session's pattern is how far what is left lies from sessions without fault, for every channel and band, as a logarithm
(a thing twice as large keeps its pattern). What all sessions of the archive have in common, their median, is taken off.
Two patterns are alike if their correlation over the cells is more than chance makes of so many pairs (Fisher 1921: the
inverse hyperbolic tangent of a correlation is nearly normal).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import ndtri

from biodance.records import Array

_CHANCE = 0.01
"""Probability that an archive in which no two sessions have a thing in common shows any two alike."""
_CELLS_EACH = 2.0
"""Cells (channel and band) that say one thing: neighbours in frequency, force and moment go together."""
_FEWEST = 4
"""Sessions beside the two, without which nothing is known of what they all have in common."""
_LEAST = 0.7
"""Correlation below which two patterns are not called alike, however sure it is."""

Cell = tuple[str, tuple[float, ...]]
"""A channel, and the edges of a band in Hz."""


@dataclass(frozen=True)
class SessionLeft:
    """What is ``left`` of one ``session`` on its ``plates``: z by channel and band; ``told`` whether a cause describes
    it, or there is nothing to describe.
    """

    session: str
    plates: frozenset[str]
    left: Mapping[Cell, float]
    told: bool


@dataclass(frozen=True)
class AlikeSessions:
    """What is left of a ``session`` looks like what is left of ``others`` on the same ``plates``: the least
    ``correlation`` and the cells (``channel``, band in Hz) that stand out most in all of them.
    """

    session: str
    others: tuple[str, ...]
    plates: tuple[str, ...]
    correlation: float
    cells: tuple[Cell, ...]

    @property
    def text(self) -> str:
        """It as a sentence."""
        where = ", ".join(f"{channel} at {band[0]:g} to {band[1]:g} Hz" for channel, band in self.cells)
        names = " and ".join(filter(None, (", ".join(self.others[:-1]), self.others[-1])))
        return (
            f"What no cause describes in {self.session} looks like session{'s' * (len(self.others) > 1)} {names} on "
            f"the same plate{'s' * (len(self.plates) > 1)} ({', '.join(self.plates)}): most in {where}; correlation "
            f"{self.correlation:.2f}."
        )


def likenesses(sessions: Sequence[SessionLeft]) -> tuple[AlikeSessions, ...]:
    """Return for every session that no cause describes which others on the same plates are left with the same thing.

    Parameters
    ----------
    sessions : sequence of SessionLeft
        All judged sessions of an archive, also those with nothing left: they tell what is usual.

    Returns
    -------
    tuple of AlikeSessions
        One for each session that is like another one; none where fewer than six sessions share their cells.
    """
    cells = sorted(set.intersection(*(set(one.left) for one in sessions))) if sessions else []
    if len(sessions) < _FEWEST + 2 or len(cells) < 8:
        return ()
    size = np.array([[np.log1p(max(one.left[cell], 0.0)) for cell in cells] for one in sessions])
    # What is usual in a cell is taken off: the median over all sessions.
    pattern = size - np.median(size, axis=0)
    open_ = [i for i, one in enumerate(sessions) if not one.told]
    pairs = [(i, j) for i, j in combinations(open_, 2) if sessions[i].plates & sessions[j].plates]
    if not pairs:
        return ()
    independent = len(cells) / _CELLS_EACH
    # Fisher's z: atanh(r) has the deviation 1 / sqrt(n - 3); the chance is shared by all pairs.
    needed = float(np.tanh(-ndtri(_CHANCE / len(pairs)) / np.sqrt(independent - 3)))
    alike: dict[int, dict[int, float]] = {}
    for i, j in pairs:
        flat = min(pattern[i].std(), pattern[j].std()) < 1e-9
        correlation = 0.0 if flat else float(np.corrcoef(pattern[i], pattern[j])[0, 1])
        if correlation >= max(needed, _LEAST):
            alike.setdefault(i, {})[j] = alike.setdefault(j, {})[i] = correlation
    return tuple(_of_one(sessions, cells, pattern, i, near) for i, near in sorted(alike.items()))


def _of_one(
    sessions: Sequence[SessionLeft], cells: list[Cell], pattern: Array, index: int, near: Mapping[int, float]
) -> AlikeSessions:
    every = [index, *sorted(near)]
    common = frozenset.intersection(*(sessions[i].plates for i in every))
    plates = common or frozenset.union(*(sessions[index].plates & sessions[i].plates for i in near))
    most = np.argsort(-pattern[every].min(axis=0))[:2]
    return AlikeSessions(
        sessions[index].session,
        tuple(sessions[i].session for i in sorted(near)),
        tuple(sorted(plates)),
        min(near.values()),
        tuple(cells[int(k)] for k in most),
    )

"""Columns of which every trial has its own, as those of a cause that comes and goes: most of the whole array would be
zero, so only the rest is kept and multiplied.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from biodance.diagnosis.evidence import LinearPosterior
from biodance.records import Array


@dataclass(frozen=True, eq=False)
class TrialColumns:
    """What one trial sees: its ``rows`` of the session, the ``columns`` that are not zero there, and their ``values``
    (rows, columns).
    """

    rows: slice
    columns: NDArray[np.intp]
    values: Array


@dataclass(frozen=True, eq=False)
class ByTrial:
    """``width`` columns of a session in the ``parts`` of its trials; what no trial has is zero."""

    parts: tuple[TrialColumns, ...]
    width: int

    @classmethod
    def of(cls, blocks: Iterable[Array]) -> "ByTrial":
        """Return the columns of ``blocks`` (r_i, k_i), one for each trial in the order of the session's rows."""
        parts, row, column = [], 0, 0
        for block in blocks:
            rows, width = block.shape
            parts.append(TrialColumns(slice(row, row + rows), np.arange(column, column + width), block))
            row, column = row + rows, column + width
        return cls(tuple(parts), column)

    def scaled(self, size: float) -> "ByTrial":
        """Return ``size`` times the columns."""
        return replace(self, parts=tuple(replace(part, values=size * part.values) for part in self.parts))

    def beside(self, columns: Array) -> "ByTrial":
        """Return these columns and behind them ``columns`` (r, n), which all trials share."""
        own = np.arange(self.width, self.width + columns.shape[1])
        parts = (
            TrialColumns(p.rows, np.append(p.columns, own), np.concatenate([p.values, columns[p.rows]], axis=1))
            for p in self.parts
        )
        return ByTrial(tuple(parts), self.width + columns.shape[1])

    def whole(self, rows: int) -> Array:
        """Return the columns as one array (``rows``, width)."""
        out = np.zeros((rows, self.width))
        for part in self.parts:
            out[part.rows, part.columns] = part.values
        return out

    def against(self, left: Array) -> Array:
        """Return (width,): the columns times ``left`` (r,); what a posterior leaves gives their score."""
        out = np.zeros(self.width)
        for part in self.parts:
            out[part.columns] += part.values.T @ left[part.rows]
        return out

    def information(self, posterior: LinearPosterior) -> Array:
        """Return G (width, width), as `LinearPosterior.score` gives it."""
        cross, out = np.zeros((posterior.X.shape[1], self.width)), np.zeros((self.width, self.width))
        for part in self.parts:
            cross[:, part.columns] += posterior.X[part.rows].T @ part.values
            out[np.ix_(part.columns, part.columns)] += part.values.T @ part.values
        half = posterior.half(cross)
        out -= half.T @ half
        return out

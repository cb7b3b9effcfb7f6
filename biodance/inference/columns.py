"""The columns that are no fault, turned to what the rows show of them.

Coefficients of one group, and of one member where it has any, have one scale, u ~ N(0, lambda^2 1): any rotation of
them is as good. In the directions of the singular vectors of their columns, most show nothing: they keep what they were
before, and need not be carried.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from biodance.inference.rows import Rows
from biodance.records import Array

_UNSEEN = 1e-3
"""Square of what a direction does to all rows together, in their standard deviations, below which it shows nothing."""


@dataclass(frozen=True, eq=False)
class VisibleColumns:
    """What the rows show of everything that is no fault.

    Parameters
    ----------
    rows : Rows
        Evidence of the session.
    X : (r, K) array
        Whitened columns per nominal standard deviation, those that observations share last.
    group : (K,) array of int
        Group of each column; -1: its size is known.
    member : (K,) array of int
        Which one of its group each column is (`Rows.member`).
    turn : (P, K) array
        Coefficients of `Rows.X` for one unit of each column.
    """

    rows: Rows
    X: Array
    group: NDArray[np.intp]
    member: NDArray[np.intp]
    turn: Array

    @classmethod
    def of(cls, rows: Rows) -> "VisibleColumns":
        """Return the columns of ``rows`` in the directions that these show."""
        parts, turns, group, member = [rows.X[:, :0]], [np.zeros((rows.group.size, 0))], [], []
        cells = {*zip(rows.group.tolist(), rows.member.tolist(), strict=True)}
        for g, m in sorted(cells, key=lambda cell: (cell[0] < 0, cell)):
            here = np.flatnonzero((rows.group == g) & (rows.member == m))
            own, way = rows.X[:, here], np.eye(here.size)
            if g >= 0:
                # Eigenvectors of X'X are the right singular vectors of X, eigenvalues their squared singular values.
                square, way = eigh(own.T @ own, check_finite=False)
                way = way[:, square > _UNSEEN]
            whole = np.zeros((rows.group.size, way.shape[1]))
            whole[here] = way
            turns.append(whole)
            parts.append(own @ way)
            group += [g] * way.shape[1]
            member += [m] * way.shape[1]
        X = np.concatenate(parts, axis=1)
        found = np.array(group, dtype=int), np.array(member, dtype=int)
        return cls(rows, X, *found, np.concatenate(turns, axis=1))

    def only(self, where: slice) -> NDArray[np.intp]:
        """Return the indices of the columns that hold coefficients ``where`` of `Rows.X` and no others."""
        here = np.flatnonzero(self.turn[where].any(axis=0))
        # Coefficients of other causes in the same eigenvectors: such columns cannot be assigned to one cause.
        beside = np.delete(self.turn[:, here], where, axis=0).any(axis=0)
        return np.asarray(here[~beside])

    @cached_property
    def plates(self) -> Array:
        """(K, K) products of the columns in all rows of the plates."""
        X = self.X[: self.rows.plates]
        return np.asarray(X.T @ X)

    @cached_property
    def markers(self) -> Array:
        """(K, K) products of the columns in all rows of the markers."""
        X = self.X[self.rows.plates : self.rows.simulated]
        return np.asarray(X.T @ X)

    def scaled(self, weight: Array) -> Array:
        """Return `plates` where each band and channel has its ``weight`` (Q + 1,); those of weight 1 cost nothing."""
        X, weights = self.X[: self.rows.plates], weight[self.rows.block[: self.rows.plates]]
        other = weights != 1
        if 2 * np.count_nonzero(other) > len(X):
            whole = np.sqrt(weights)[:, None] * X
            return np.asarray(whole.T @ whole)  # a product with itself takes half the time
        # X' W X = X'X + X' (W - 1) X: only rows of another weight than 1 are looked at again.
        return np.asarray(self.plates + X[other].T @ ((weights[other] - 1)[:, None] * X[other]))

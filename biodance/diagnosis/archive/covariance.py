"""The covariance of the rows of a series, and what fixed columns leave of it, without a matrix of rows by rows.

V (n, n) of the rows is diagonal, and one number more wherever two rows are of one visit, another one wherever they are
of one person. A person's visits lie in that person's block, so that V^-1 needs Sherman and Morrison's formula twice
(1950, doi:10.1214/aoms/1177729893), block by block: time and memory grow with n, not with its square or cube.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from biodance.records import Array

_RIDGE = 1e-12
"""Share of a column's own information that is added, so that columns which cannot be told apart get huge errors."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Which rows belong together: ``visit`` (n,) of each row, 0 to V - 1, and ``person`` (V,) of each visit, 0 to
    H - 1. V and H count what has rows; ``visits`` (V,) and ``persons`` (H,) are their numbers in the archive.
    """

    visit: NDArray[np.intp]
    person: NDArray[np.intp]
    visits: NDArray[np.intp]
    persons: NDArray[np.intp]

    @cached_property
    def by_visit(self) -> csr_array:
        """(V, n) ones that sum rows to visits."""
        return _sums(self.visit, self.visits.size)

    @cached_property
    def by_person(self) -> csr_array:
        """(H, V) ones that sum visits to persons."""
        return _sums(self.person, self.persons.size)


def _sums(index: NDArray[np.intp], count: int) -> csr_array:
    return csr_array((np.ones(index.size), (index, np.arange(index.size))), shape=(count, index.size))


@dataclass(frozen=True, eq=False)
class RowCovariance:
    """V (n, n) = diag(``alone``) + ``visits`` where rows share a visit + ``persons`` where they share a person.

    Parameters
    ----------
    groups : Groups
        Of the rows.
    alone : numpy.ndarray
        (n,) variance of each row by itself, > 0, in the quantity's unit squared.
    visits, persons : float
        Variance that the rows of a visit, and of a person, have in common; >= 0.
    """

    groups: Groups
    alone: Array
    visits: float
    persons: float

    @cached_property
    def _known(self) -> Array:
        """(V,) what the rows of a visit know by themselves: 1' D^-1 1, D = diag(alone)."""
        return np.asarray(self.groups.by_visit @ (1 / self.alone))

    @cached_property
    def _visits_less(self) -> Array:
        """(V,) g, where the inverse of a visit's block D + s 11' is D^-1 - g D^-1 11' D^-1."""
        return np.asarray(self.visits / (1 + self.visits * self._known))

    @cached_property
    def ones(self) -> Array:
        """(n,) W^-1 1, where W is V without what persons have in common."""
        # W^-1 1 = D^-1 1 / (1 + s 1'D^-1 1).
        return np.asarray((1 / (1 + self.visits * self._known))[self.groups.visit] / self.alone)

    @cached_property
    def persons_less(self) -> Array:
        """(H,) h, where the inverse of a person's block W + s 11' is W^-1 - h W^-1 11' W^-1."""
        known = self.groups.by_person @ (self.groups.by_visit @ self.ones)
        return np.asarray(self.persons / (1 + self.persons * known))

    @cached_property
    def log_determinant(self) -> float:
        """Logarithm of |V|: a block's determinant is that of what it is made of times 1 + s 1'(...)^-1 1."""
        known = self.groups.by_person @ (self.groups.by_visit @ self.ones)
        # Matrix determinant lemma, visits first, then persons.
        visits, persons = np.log1p(self.visits * self._known), np.log1p(self.persons * known)
        return float(np.log(self.alone).sum() + visits.sum() + persons.sum())

    def solve(self, right: Array) -> Array:
        """Return V^-1 ``right`` (n, m)."""
        groups = self.groups
        out = right / self.alone[:, None]
        less = self._visits_less[:, None] * (groups.by_visit @ out)
        # D^-1 y - g D^-1 1 (1'D^-1 y).
        out -= less[groups.visit] / self.alone[:, None]
        if self.persons:
            less = self.persons_less[:, None] * (groups.by_person @ (groups.by_visit @ out))
            # The same once more for persons, with W in place of D.
            out -= less[groups.person[groups.visit]] * self.ones[:, None]
        return np.asarray(out)

    def squares(self, shares: Array) -> tuple[Array, Array]:
        """Return q and r (V, A) of the rows' ``shares`` (n, A) in each visit: c' V^-1 c = sum q - h (sum r)^2 for a
        column c that has these shares in some visits of one person, and zeros elsewhere.
        """
        # By visit: 1'D^-1 c and c'D^-1 c; the visit's own g takes g (1'D^-1 c)² off.
        white = self.groups.by_visit @ (shares / self.alone[:, None])
        own = self.groups.by_visit @ (shares**2 / self.alone[:, None])
        return own - self._visits_less[:, None] * white**2, self.groups.by_visit @ (shares * self.ones[:, None])

    def draw(self, chance: np.random.Generator, count: int) -> Array:
        """Return ``count`` draws (n, count) from the normal distribution with mean 0 and covariance V."""
        groups = self.groups
        out = np.sqrt(self.alone)[:, None] * chance.standard_normal((self.alone.size, count))
        # One number per visit has the covariance s 11' in its rows.
        out += (np.sqrt(self.visits) * chance.standard_normal((groups.visits.size, count)))[groups.visit]
        if self.persons:
            shared = np.sqrt(self.persons) * chance.standard_normal((groups.persons.size, count))
            out += shared[groups.person[groups.visit]]
        return np.asarray(out)


class Projection:
    """P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1 (n, n): what ``columns`` X (n, K) leave, weighted by ``rows`` V."""

    def __init__(self, rows: RowCovariance, columns: Array) -> None:
        self.rows, self.columns, self.solved = rows, columns, rows.solve(columns)
        known = columns.T @ self.solved
        # A trace of each own diagonal element: positive definite where columns nearly agree.
        self._factor = cho_factor(known + np.diag(_RIDGE * np.diag(known) + np.finfo(float).tiny), lower=True)

    @cached_property
    def covariance(self) -> Array:
        """(K, K) (X' V^-1 X)^-1, of the coefficients."""
        return np.asarray(cho_solve(self._factor, np.eye(self.columns.shape[1])))

    def fit(self, value: Array) -> Array:
        """Return the coefficients (K, m) of generalised least squares of ``value`` (n, m)."""
        # beta = (X'V^-1 X)^-1 X'V^-1 y.
        return np.asarray(cho_solve(self._factor, self.solved.T @ value))

    def left(self, value: Array) -> tuple[Array, Array]:
        """Return P y (n, m) and y' P y (m,) of ``value`` y (n, m), from what generalised least squares leave of it."""
        # P y = V^-1 (y - X beta), and y'P y = (y - X beta)'V^-1 (y - X beta).
        rest = value - self.columns @ self.fit(value)
        weighted = self.rows.solve(rest)
        return weighted, np.einsum("ij,ij->j", rest, weighted)

    def restricted(self, value: Array) -> float:
        """Return minus the restricted log likelihood of ``value`` (n,), up to a constant: half of log |V| +
        log |X' V^-1 X| + y' P y.
        """
        # log|X'V^-1 X| from the Cholesky factor.
        known = 2 * float(np.log(np.diag(self._factor[0])).sum())
        return (self.rows.log_determinant + known + float(self.left(value[:, None])[1][0])) / 2

"""One posterior of a load on one segment: none, or one of so many kg at a place in or near the segment's box.

A load of m kg has the parameters m (u + G z): u and G G' are mean and covariance of a load of 1 kg whose place is
unknown (`unit_load`), z is standard normal. Whitened data y, in which the body's own uncertainty is noise of unit
variance, then have the mean m b and the covariance 1 + m² D D', with b = B u, D = B G and B the segment's columns. For
every m that is closed form, so "no load" and every mass stand in one table of weights: the probability of no load and
the interval of the mass are read from the same numbers and cannot contradict each other.

Whether there is a load is a question of evidence, for which mass and place need a proper prior. How heavy it is, is
not: the data tell mass and first moments, m and m x, and a place that is as likely anywhere in and near the box spreads
the first moments of m kg over a volume of m³. The evidence prefers lighter loads for it: 2.4 ± 0.3 kg near the middle
of a segment came out 0.1 kg light. The size is weighed by Jeffreys' prior, for which a mass is not the less probable
the better its first moments are known: `LoadView.log_place_information` gives back what the evidence takes.
"""

from dataclasses import dataclass

import numpy as np

from biodance.records import Array

MASSES = np.geomspace(0.005, 50.0, 1200)
"""(n,) kg at which the posterior is tabled: 0.8 % apart."""
_USUAL = 5.0
"""kg: loads are half normal with this deviation; it shrinks 2.4 ± 0.25 kg by 0.006 kg."""
_TAIL = 0.025
"""Probability on each side of a 95 % interval."""


@dataclass(frozen=True, eq=False)
class LoadPosterior:
    """``none`` probability that there is no load; ``weight`` (n,) probability of a load of each of `MASSES`, with
    ``none`` summing to 1.
    """

    none: float
    weight: Array

    @property
    def mass(self) -> float:
        """Expected load, kg: 0 counts with the probability of no load."""
        return float(self.weight @ MASSES)

    @property
    def sd(self) -> float:
        """Standard deviation of the load, kg."""
        # E[m²] - E[m]².
        return float(np.sqrt(max(float(self.weight @ MASSES**2) - self.mass**2, 0.0)))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the load, kg, each tail 2.5 %; it starts at 0 where no load is more probable than that."""
        low, high = (self._quantile(share) for share in (_TAIL, 1 - _TAIL))
        return low, high

    def _quantile(self, share: float) -> float:
        # Distribution function at the middle of each cell; the mass `none` sits at zero.
        below = self.none + np.cumsum(self.weight) - 0.5 * self.weight
        return float(np.interp(share, np.append(self.none, below), np.append(0.0, MASSES), left=0.0))


@dataclass(frozen=True, eq=False)
class LoadView:
    """What data say of a load on one segment, in the directions in which its place is unknown.

    Where the body's mass holds the load's, b is less by what a body shows per kilogram.

    ``squares`` b'b; ``shown`` b'y; ``strength`` (k,) eigenvalues of D'D; ``unit`` and ``surprise`` (k,) D'b and D'y in
    their basis; ``ways`` (10, k) parameters per kg that each direction changes; ``mean`` (10,) u.
    """

    squares: float
    shown: float
    strength: Array
    unit: Array
    surprise: Array
    ways: Array
    mean: Array

    @classmethod
    def of(cls, columns: Array, surprise: Array, unit: tuple[Array, Array], less: Array) -> "LoadView":
        """Return the view through ``columns`` (r, 10) of a segment at what the data show, ``surprise`` (r,); ``unit``
        mean (10,) and factor (10, k) of a load of 1 kg, ``less`` (r,) what the body shows less for every kilogram of
        it.
        """
        mean, factor = unit
        # Mean of a load's data per kg, and what its unknown place adds; (r,) and (r, k).
        b, D = columns @ mean - less, columns @ factor
        # In the eigenvectors of D'D the covariance 1 + m² D D' is diagonal on the directions of D.
        strength, basis = np.linalg.eigh(D.T @ D)
        D = D @ basis
        return cls(
            float(b @ b), float(b @ surprise), np.maximum(strength, 0.0), D.T @ b, D.T @ surprise, factor @ basis, mean
        )

    def log_ratio(self, masses: Array) -> Array:
        """Return the log likelihood ratio (n,) of loads of ``masses`` (n,) kg against none."""
        # Of each direction (k, 1) for every mass: Woodbury for the quadratic form of N(y; m b, 1 + m² D D').
        surprise, unit, wide = self.surprise[:, None], self.unit[:, None], self._wide(masses)
        spread = ((masses * (surprise - masses * unit)) ** 2 / wide).sum(axis=0) - np.log(wide.prod(axis=0))
        return np.asarray(masses * self.shown - 0.5 * masses**2 * self.squares + 0.5 * spread)

    def log_place_information(self, masses: Array) -> Array:
        """Return half the logarithm (n,) of how much better the place of loads of ``masses`` (n,) kg is known after
        the data: what the evidence of each mass pays for places that the data exclude.
        """
        return np.asarray(0.5 * np.log(self._wide(masses).prod(axis=0)))

    def at_the_mean(self, masses: Array) -> tuple[Array, Array]:
        """Return sum u² / (1 + m² D'D) and sum log(1 + m² D'D) (n,) for ``masses`` (n,) kg, see `log_ratio_if`."""
        wide = self._wide(masses)
        return (self.unit[:, None] ** 2 / wide).sum(axis=0), np.log(wide.prod(axis=0))

    def _wide(self, masses: Array) -> Array:
        """Return (k, n) the eigenvalues of 1 + m² D D' other than 1; their product is its determinant."""
        return np.asarray(1 + np.multiply.outer(self.strength, masses**2))

    def place(self, weight: Array) -> tuple[Array, Array]:
        """Return mean and standard deviation (3,) m of the load's CoM in the segment's frame, over masses of
        ``weight`` (n,).
        """
        m = MASSES[:, None]
        narrow = 1 / (1 + m**2 * self.strength)
        # E[z | m, y] = m (D'y - m D'b) / (1 + m² w) per direction, turned into metres by `ways`.
        place = self.mean[1:4] + (m * narrow * (self.surprise - m * self.unit)) @ self.ways[1:4].T
        share = weight / weight.sum()
        mean = share @ place
        # Law of total variance over the masses: var(z | m) = 1 / (1 + m² w), plus that of the means.
        return mean, np.sqrt(share @ (narrow @ (self.ways[1:4] ** 2).T + (place - mean) ** 2))


def log_ratio_if(true: float, masses: Array, squares: Array, own: Array, wide: Array) -> Array:
    """Return the log likelihood ratio (r, n) of loads of ``masses`` (n,) kg against none in r views, if the data showed
    a load of ``true`` kg at the mean place and nothing else; ``squares`` (r,) b'b, ``own`` and ``wide`` (r, n) of each
    view `at_the_mean`.
    """
    # y = true b: m b'y - m² b'b / 2 = (true m - m² / 2) b'b.
    shown = np.multiply.outer(squares, true * masses - 0.5 * masses**2)
    return np.asarray(shown + 0.5 * (masses**2 * (true - masses) ** 2 * own - wide))


def log_mass_prior(masses: Array) -> Array:
    """Return the log probability (n,) of each of ``masses`` (n,) kg, given that there is a load."""
    # Half normal density times the width of each mass's cell (the masses are spaced geometrically).
    log = -0.5 * (masses / _USUAL) ** 2 + np.log(np.gradient(masses))
    return np.asarray(log - np.log(np.exp(log).sum()))

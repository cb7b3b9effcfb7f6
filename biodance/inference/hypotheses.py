"""What a search over sets of causes finds: each set with its sizes and scales, and the probability of each."""

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.special import logsumexp

from biodance.diagnosis.candidates import SCALE
from biodance.effects import Effect, NamedCause
from biodance.inference.columns import VisibleColumns
from biodance.inference.rows import BODY, Rows
from biodance.inference.scales import ScaledFit
from biodance.records import Array

Key = tuple[str, str]
"""Effect and target of a cause."""
UNKNOWN = 0.5
"""Probability from which there is an unknown cause."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes with their sizes: ``log_posterior`` up to a constant of the session, and of the unknown beside
    it (``log_unknown``); ``Z`` (r, k) columns and ``y`` (r,) target beside all that is no fault; ``sure`` (Q + 1,) by
    which the rows of each noise group are scaled because no cause is quite like its model.
    """

    causes: tuple[NamedCause, ...]
    columns: VisibleColumns
    fit: ScaledFit
    log_posterior: float
    Z: Array
    y: Array
    sure: Array
    log_unknown: float = -np.inf
    where_unknown: tuple[int, int] = (0, 0)

    @property
    def rows(self) -> Rows:
        """Evidence of the session."""
        return self.columns.rows

    @property
    def surety(self) -> Array:
        """(r,) by which each row is scaled."""
        return np.asarray(self.sure[self.rows.block])

    @property
    def log_sure(self) -> float:
        """Logarithm of the determinant of that scaling."""
        return float(np.log(self.surety).sum())

    @property
    def names(self) -> frozenset[Key]:
        """Effect and target of its causes."""
        return frozenset(one.names for one in self.causes)

    @property
    def left(self) -> Array:
        """(r,) whitened rows that the posterior mean leaves, in units of their noise."""
        # Fit order: the K columns that are no fault, then those of the causes.
        K, size = self.columns.X.shape[1], self.fit.coefficients
        return np.asarray(self.surety * (self.y - self.columns.X @ size[:K] - self.Z @ size[K:]))

    @cached_property
    def coefficients(self) -> Array:
        """(P,) posterior mean per unit of `Rows.X`."""
        # Directions that the rows do not show are not in `turn`: their posterior mean is zero.
        return np.asarray(self.columns.turn @ self.fit.coefficients[: self.columns.X.shape[1]])

    @property
    def phi(self) -> Array:
        """(10N,) posterior mean of the body's parameters; empty where only observations judge."""
        found = self.rows.problem
        return (
            np.empty(0)
            if found is None
            else found.prior.phi + found.factor @ self.coefficients[: found.factor.shape[1]]
        )

    def whole(self, one: NamedCause) -> Array:
        """Return the size (p,) of a cause with what its own tolerance, or the body, has taken of it: both look alike,
        and the sum is what is there (docs/decisions/2026-11-21-detection-limits.md).
        """
        where, unit = self.rows.tolerated.get(one.names, (slice(0), np.zeros((one.theta.size, 0))))
        size = np.asarray(one.theta + unit @ self.coefficients[where])
        if (share := self._in_body(one)) is not None:
            size[0] += share @ self.phi
        return size

    def variance(self, where: slice, unit: Array) -> float:
        """Return the posterior variance of ``unit`` (k,) times the coefficients of `Rows.X` ``where``. In directions
        that the rows do not show they keep the variance of the prior.
        """
        # value = own' u, as coefficients = turn (size * u); what turn leaves out of unit no row shows
        turn, own = self.columns.turn[where], np.zeros(self.fit.u.size)
        seen = unit @ turn
        own[: seen.size] = seen * self.fit.size[: seen.size]
        scale = self.fit.scales.of(self.rows.group[where], self.rows.member[where])
        return self.fit.variance(own) + float(np.sum(((unit - turn @ seen) * scale) ** 2))

    def whole_covariance(self, one: NamedCause) -> Array:
        """Return the covariance (p, p) of the size of a cause, with what of the first parameter lies in the body: the
        sum is better known than either.
        """
        share, found = self._in_body(one), self.rows.problem
        if share is None or found is None:
            return one.covariance
        # Size in the body = share' (factor u): its slope by the unit-normal coefficients u of the body.
        own = found.factor.T @ share
        seen = self.columns.turn[: own.size].T @ own
        body = self.rows.groups.index(BODY)
        # Scaled columns as in `ScaledFit.variance`; the cause's own first coefficient is added below.
        row = np.append(seen, np.zeros(self.Z.shape[1])) * self.fit.size
        at = self.columns.X.shape[1]
        for other in self.causes:
            row[at] = SCALE * one.effect.typical[0] * (other.names == one.names)
            at += other.theta.size
        # What `own` has outside the carried directions keeps its prior variance, lambda^2 of the group body.
        unseen = float(own @ own - seen @ seen) * float(np.exp(2 * self.fit.scales.groups[body]))
        covariance = np.array(one.covariance)
        covariance[0, 0] = self.fit.variance(row) + unseen
        return covariance

    def _in_body(self, one: NamedCause) -> Array | None:
        """Return what of the body's parameters (10N,) counts to the size of a cause; None where none does."""
        return None if self.rows.problem is None else one.effect.in_body(self.rows.problem.cases[0])


@dataclass(frozen=True, eq=False)
class Scored:
    """A cause added to a hypothesis by the score test: its log posterior gain, and the size to begin with."""

    effect: Effect
    gain: float
    start: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """Every hypothesis that was fitted; ``screened`` what the score says of every cause alone; ``louder`` the posterior
    at the noise that an unknown cause makes, where one is probable enough to matter.
    """

    hypotheses: tuple[Hypothesis, ...]
    screened: tuple[Scored, ...]
    louder: "Posterior | None" = None

    @property
    def unknown(self) -> float:
        """Probability of an unknown cause."""
        return float(self.weights[:, 1].sum())

    @property
    def weights(self) -> Array:
        """(H, 2) probability of every hypothesis, without and with the unknown."""
        # One common normalisation: both columns together sum to one.
        both = np.array([[one.log_posterior, one.log_unknown] for one in self.hypotheses])
        return np.asarray(np.exp(both - logsumexp(both)))

    @property
    def lead(self) -> "Posterior":
        """The more probable of the two: as loud as laboratories are, or as an unknown cause makes it."""
        return self if self.louder is None or self.unknown < UNKNOWN else self.louder

    @property
    def best(self) -> Hypothesis:
        """The most probable hypothesis of the more probable noise."""
        return self.lead.unexplained

    @property
    def unexplained(self) -> Hypothesis:
        """The most probable hypothesis where noise is as in laboratories: beside it more may be left."""
        return self.hypotheses[int(np.argmax(self.weights.sum(axis=1)))]

    def lacking(self, name: Key) -> "Posterior":
        """Return the posterior given that one cause is not there."""
        return Posterior(
            tuple(one for one in self.hypotheses if name not in one.names),
            tuple(one for one in self.screened if (one.effect.name, one.effect.target) != name),
            self.louder.lacking(name) if self.louder else None,
        )

    def share(self, *places: Set[Key]) -> float:
        """Return the probability that every one of some ``places`` holds a cause of its own, any of the names that the
        place may have, whatever the noise.
        """
        held = [_seated(one.names, places) for one in self.hypotheses]
        own = float(self.weights[held].sum())
        # Law of total probability over the noise: as usual, and as loud as the unknown makes it.
        return own if self.louder is None else (1 - self.unknown) * own + self.unknown * self.louder.share(*places)

    def probabilities(self) -> dict[Key, float]:
        """Return the probability of every cause."""
        every = (*self.hypotheses, *(self.louder.hypotheses if self.louder else ()))
        out = {name: self.share({name}) for one in every for name in one.names}
        return dict(sorted(out.items(), key=lambda pair: -pair[1]))


def _seated(names: Set[Key], places: Sequence[Set[Key]]) -> bool:
    """Return whether different ones of some ``names`` can be put into all ``places``."""
    ways = permutations(names, len(places))
    return any(all(name in place for name, place in zip(way, places, strict=True)) for way in ways)

"""What a session can know: every quantity with its interval before and after the data, and a verdict in words; and
while a session runs, what its samples so far say of the masses.

Quantities are those an analyst asks for: mass, centre of mass and inertia about it, per segment. Their standard
deviations follow from the covariance of the ten parameters by the first derivative.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from biodance.body.parts import TENSOR
from biodance.display import Interval, spaced
from biodance.identification.posterior import BodyPosterior
from biodance.records import Array, Sip

QUANTITIES = ("mass", "com x", "com y", "com z", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
UNITS = ("kg", "m", "m", "m", *("kg·m²",) * 6)
KNOWN, PARTLY = 0.75, 0.3
"""Share of the prior variance that the data must remove for "known" (standard deviation halved) and for "partly"."""
SIGMAS = 1.959964
"""Half width of a 95 % interval in standard deviations."""
_NEIGHBOURS = (("pelvis", "right_thigh", "left_thigh"), ("pelvis", "trunk_head"))
"""Segments at one joint that can trade mass."""

Knowability = Literal["known", "partly known", "cannot be known"]


@dataclass(frozen=True)
class Known:
    """One quantity of one segment: ``value`` with ``sd`` after the data, ``table`` with ``table_sd`` before, in
    ``unit``.

    ``from_data`` is the share of the table's variance that the data removed (0 = all from the table); ``verdict`` in
    words: a quantity that "cannot be known" from this session has the table's value and interval, whatever digits are
    printed.
    """

    segment: str
    quantity: str
    unit: str
    value: float
    sd: float
    table: float
    table_sd: float
    from_data: float
    verdict: Knowability

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - SIGMAS * self.sd, self.value + SIGMAS * self.sd


def known_interval(known: Known, times: float = 1.0) -> Interval:
    """Return the table's and the identified value of a quantity with their 95 % intervals, as they are drawn, in units
    of which its own has so many ``times``.
    """
    reach = SIGMAS * known.table_sd
    low, high = known.interval
    before = times * known.table, times * (known.table - reach), times * (known.table + reach)
    return Interval(known.segment, before, (times * known.value, times * low, times * high), known.verdict)


def segment_quantities(phi: Array) -> tuple[Array, Array]:
    """Return the ten quantities (10,) of one segment and their derivative (10, 10) to ``phi`` (10,): m, CoM, inertia
    about the CoM.
    """
    mass, h = phi[0], phi[1:4]
    com = h / mass
    value = np.concatenate([[mass], com, np.empty(6)])
    # d phi / d phi; rows of CoM and inertia are overwritten or added to.
    slope = np.eye(10)
    slope[1:4, 1:4] = np.eye(3) / mass
    # d(h / m) / dm = -h / m².
    slope[1:4, 0] = -com / mass
    for row, (i, j) in enumerate(TENSOR, start=4):
        same = float(i == j)
        # Parallel axes: I - m (|c|² 1 - c c')_ij, with h = m c.
        value[row] = phi[row] - (same * (h @ com) - h[i] * com[j])
        # d/dm of -(h.h 1 - h h') / m at constant h.
        slope[row, 0] = same * (com @ com) - com[i] * com[j]
        slope[row, 1:4] = -2 * same * com
        slope[row, 1 + i] += com[j]
        slope[row, 1 + j] += com[i]
    return value, slope


def knowledge(after: Sip, before: Sip, posterior: BodyPosterior | None = None) -> tuple[Known, ...]:
    """Return all quantities of all segments, in order.

    ``after`` and ``before`` with covariances about the true joint centres; what the data removed of the variance is
    judged in the model's frames (``posterior`` and its prior, else ``after`` and ``before``), where a misplaced joint
    centre is no ignorance.
    """
    then, first = (
        (posterior.covariance, posterior.prior.covariance) if posterior else (after.covariance, before.covariance)
    )
    rows = []
    for i, segment in enumerate(after.segments):
        cut = slice(10 * i, 10 * i + 10)
        value, slope = segment_quantities(after.phi[cut])
        table, table_slope = segment_quantities(before.phi[cut])
        sd = _deviation(slope, after.covariance[cut, cut])
        table_sd = _deviation(table_slope, before.covariance[cut, cut])
        # Before and after the data both by the table's slope: their ratio is not that of two linearisations.
        left, whole = (_deviation(table_slope, c[cut, cut]) for c in (then, first))
        share = np.clip(1 - np.divide(left**2, whole**2, out=np.ones(10), where=whole > 0), 0.0, 1.0)
        numbers = np.array([value, sd, table, table_sd, share]).tolist()
        for quantity, unit, now, now_sd, was, was_sd, part in zip(QUANTITIES, UNITS, *numbers, strict=True):
            rows.append(Known(segment, quantity, unit, now, now_sd, was, was_sd, part, _verdict(part)))
    return tuple(rows)


@dataclass(frozen=True)
class Together:
    """Masses (kg, with standard deviations) of neighbours that a joint's place lets trade mass: ``mass`` of all of
    ``segments``, known to ``sd``; ``first`` that of the first, which alone is known to ``first_sd``.
    """

    segments: tuple[str, ...]
    mass: float
    sd: float
    first: float
    first_sd: float

    def __str__(self) -> str:
        first, *others, last = (spaced(name) for name in self.segments)
        return (
            f"{', '.join([first, *others])} and {last} are known together, not apart: {self.mass:.1f} ± "
            f"{SIGMAS * self.sd:.1f} kg, of which {first} {self.first:.1f} ± {SIGMAS * self.first_sd:.1f} kg (mass at "
            f"a joint belongs to either side of it; where tables cut differs)."
        )


def known_together(sip: Sip) -> tuple[Together, ...]:
    """Return the pelvis with what shares a joint with it, thighs or trunk, where their masses are less certain than the
    sum is: what one gains the others lose; the surest sum for what its parts are comes first.
    """
    found = []
    for names in _NEIGHBOURS:
        if not set(names) <= set(sip.segments):
            continue
        at = [10 * sip.segments.index(name) for name in names]
        # Variance of a sum: the sum of all elements; the trace, if nothing were shared.
        cov = np.asarray(sip.covariance)[np.ix_(at, at)]
        sd, alone = float(np.sqrt(max(cov.sum(), 0.0))), float(np.sqrt(np.trace(cov)))
        if sd < alone:
            together = Together(names, float(sip.phi[at].sum()), sd, float(sip.phi[at[0]]), float(np.sqrt(cov[0, 0])))
            found.append((sd / alone, together))
    return tuple(together for _, together in sorted(found, key=lambda one: one[0]))


def _deviation(slope: Array, covariance: Array) -> Array:
    return np.sqrt(np.maximum(np.diag(slope @ covariance @ slope.T), 0.0))


def _verdict(share: float) -> Knowability:
    return "known" if share >= KNOWN else "partly known" if share >= PARTLY else "cannot be known"


@dataclass(frozen=True, eq=False)
class RecursivePosterior:
    """Gaussian posterior: ``prior`` as given, ``mean`` (p,) and ``covariance`` (p, p) after the samples so far."""

    prior: Sip
    mean: Array
    covariance: Array

    def expected(self, W: Array) -> tuple[Array, Array]:
        """Return the expected wrench (..., 6) N, N·m for regressors ``W`` (..., 6, p), and its variance due to the
        uncertainty of the parameters.
        """
        # Diagonal of W C W' per sample: sum over j, k of W[i, j] C[j, k] W[i, k].
        return W @ self.mean, np.einsum("...ij,jk,...ik->...i", W, self.covariance, W, optimize=True)

    def updated(self, W: Array, wrench: Array, variance: Array) -> "RecursivePosterior":
        """Return the posterior after one sample: ``W`` (6, p), ``wrench`` (6,) N, N·m with noise of ``variance`` (6,).

        Source: Kalman 1960, doi:10.1115/1.3662552, with a state that stays.
        """
        seen = self.covariance @ W.T
        # K = C W'(W C W' + R)^-1; the innovation's covariance is symmetric, so K' solves it.
        gain = np.linalg.solve(W @ seen + np.diag(variance), seen.T).T
        # C - K W C; rounding makes it unsymmetric, mended below.
        covariance = self.covariance - gain @ seen.T
        return replace(
            self,
            mean=self.mean + gain @ (wrench - W @ self.mean),
            covariance=(covariance + covariance.T) / 2,
        )

    def verdicts(self) -> dict[str, Knowability]:
        """Return for every segment how well its mass is known, as `knowledge` has it."""
        first, now = np.diag(self.prior.covariance)[::10], np.diag(self.covariance)[::10]
        share = 1 - np.divide(now, first, out=np.ones_like(now), where=first > 0)
        return dict(zip(self.prior.segments, map(_verdict, share), strict=True))


def initial_posterior(prior: Sip) -> RecursivePosterior:
    """Return the posterior before the first sample, equal to ``prior``."""
    return RecursivePosterior(prior, np.array(prior.phi), np.array(prior.covariance))

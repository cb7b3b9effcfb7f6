"""Two sessions of one person: which quantities differ, and how sure that is (a limb after a cast, a prosthesis,
weight lost).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from biodance.errors import BiodanceError, NotSolved
from biodance.identification.added_mass import added_mass, scaled_to_mass, table_like
from biodance.identification.identification import Identification
from biodance.identification.knowledge import QUANTITIES, SIGMAS, UNITS, segment_quantities
from biodance.identification.loads import unknown_loads, with_room
from biodance.identification.physical import physical_fit
from biodance.identification.posterior import BodyPosterior, find_posterior
from biodance.records import Array, Sip
from biodance.threads import one_thread


@dataclass(frozen=True)
class Difference:
    """``later`` minus ``earlier`` of one quantity of one segment: ``value`` with ``sd`` in ``unit``; ``p`` of a
    difference at least as large if nothing had changed; ``known`` False where neither session's data say anything about
    it (both values are the table's).
    """

    segment: str
    quantity: str
    unit: str
    value: float
    sd: float
    p: float
    known: bool

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the difference."""
        return self.value - SIGMAS * self.sd, self.value + SIGMAS * self.sd


_CERTAIN = 0.05
"""Probability that any of all changes is called certain though nothing changed (Bonferroni)."""


def certain_changes(found: tuple[Difference, ...]) -> tuple[Difference, ...]:
    """Return those of all differences that are certain: known from data, and too large for the chance of any of
    them.
    """
    return tuple(one for one in found if one.known and one.p < _CERTAIN / len(found))


@one_thread()
def differences(earlier: Identification, later: Identification) -> tuple[Difference, ...]:
    """Return all differences, later minus earlier, each session with room for what it carries beyond the other.

    Both tables count at the earlier session's declared mass: the later one may hold a load, declared or not, which
    would be spread over the body. Every segment therefore gets room D for a load, in proportion to the probability that
    one sits there (`added_mass`, in both directions: a load, a loss); values may differ from those of the two tables of
    results. The two posteriors share the table P: what both still owe to it is common and cancels. With the covariances
    C under the prior P + D and A = C (P + D)^-1, Var = C1 + C2 - A1 P A2' - A2 P A1'.

    Raises
    ------
    BiodanceError
        The sessions have different segments.
    NotSolved
        No possible body is near what one of the sessions says, with or without that room.
    """
    if earlier.sip.segments != later.sip.segments:
        raise BiodanceError(
            "The two sessions have different segments and cannot be compared. Use the same kind of body in both."
        )
    mass = float(earlier.posterior.prior.mass.sum())
    tables = (scaled_to_mass(table_like(one, earlier), mass) for one in (earlier, later))
    first, second = (_with_room(*three) for three in zip(tables, (earlier, later), (later, earlier), strict=True))
    # What both posteriors still owe to the common table: cov(e1, e2) = A1 P A2'.
    mutual = _prior_influence(first) @ earlier.posterior.prior.covariance @ _prior_influence(second).T
    spread = first.covariance + second.covariance - mutual - mutual.T
    values = [_possible(posterior, one) for posterior, one in ((first, earlier), (second, later))]
    rows = []
    for i, segment in enumerate(earlier.sip.segments):
        cut = slice(10 * i, 10 * i + 10)
        before, after = (segment_quantities(phi[cut]) for phi in values)
        # One slope for the difference: the mean of both linearisations.
        slope = 0.5 * (before[1] + after[1])
        sd = np.sqrt(np.maximum(np.diag(slope @ spread[cut, cut] @ slope.T), 0.0))
        for k, (quantity, unit) in enumerate(zip(QUANTITIES, UNITS, strict=True)):
            value = float(after[0][k] - before[0][k])
            # Two-sided normal probability.
            p = float(2 * ndtr(-abs(value) / sd[k])) if sd[k] > 0 else 1.0
            informed = any(one.known[10 * i + k].verdict != "cannot be known" for one in (earlier, later))
            rows.append(Difference(segment, quantity, unit, value, float(sd[k]), p, informed))
    return tuple(rows)


def _prior_influence(posterior: BodyPosterior) -> Array:
    """Return A (p, p) = C P^-1 of a posterior with covariance C: what of a step of the prior's mean it keeps."""
    scale = np.sqrt(np.diag(posterior.prior.covariance))
    unit = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    inverse = np.linalg.pinv(posterior.prior.covariance * np.outer(unit, unit), rcond=1e-12, hermitian=True)
    return posterior.covariance @ (unit[:, None] * inverse * unit)


def _possible(posterior: BodyPosterior, one: Identification) -> Array:
    """Return the parameters (10N,) of the possible body nearest to ``posterior`` of session ``one``."""
    fit = physical_fit(posterior, one.body)
    if fit.status == "failed":
        raise NotSolved(f"The sessions cannot be compared: {', '.join(one.trials)}, with room for a load: {fit.cause}")
    return fit.sip.phi


def _with_room(table: Sip, one: Identification, other: Identification) -> BodyPosterior:
    """Return the posterior of session ``one`` after its ``table`` with room for loads that it has beyond ``other``."""
    chance = {found.segment: found.probability for found in added_mass(one, reference=other).suspects}
    share = np.array([chance[segment] for segment in one.body.segments])
    return find_posterior(one.data, with_room(table, unknown_loads(one.body, share=share)))

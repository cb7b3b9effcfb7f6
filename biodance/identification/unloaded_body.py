"""Hypotheses on the body without a load: as the prior says, further from it, or of another mass than declared."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from biodance.identification.identification import Identification
from biodance.identification.loads import ODDS, matter_follows_joint, with_matter_placed, with_sides
from biodance.identification.posterior import Information
from biodance.records import Array, Sip
from biodance.uncertainty.caution import in_other_frames

_ODD = (1.0, 1.5, 2.25, 3.4)
"""Times that the body may differ from what was known before by more than its standard deviations, equally probable."""
_DECLARED = ((0.0, False, 0.4), (0.0, True, 0.4), (2.5, False, 0.2))
"""What the declared mass may be: kg by which it is wrong (standard deviation), whether it holds the load, probability.
"""


@dataclass(frozen=True, eq=False)
class UnloadedBody:
    """One hypothesis on the body without a load: its prior ``before``, with ``log_prior``; ``holds``: whether the
    declared mass includes the load, so that the body is lighter by it.
    """

    before: Sip
    log_prior: float
    holds: bool


def expect_unloaded(reference: Identification, session: Identification) -> Sip:
    """Return what ``reference`` lets expect of the unloaded body in ``session``, with covariance.

    The posterior of the reference, moved by what the table itself changed between the sessions (another static trial,
    other lengths), with the trunk's matter in the same of its two places, known as on another day (markers glued
    anew). The session's table counts at the mass of the
    reference: the mass that the session declares may hold the load.

    Raises
    ------
    NotSolved
        The reference contradicts every possible body, so its posterior is none of a body.
    """
    along = matter_follows_joint(reference.posterior.prior, reference.body)
    same = with_matter_placed(session.posterior.prior, session.body, along=along)
    table = scaled_to_mass(same, float(reference.posterior.prior.mass.sum()))
    shift = table.phi - reference.posterior.prior.phi
    moved = Sip(reference.sip.segments, reference.posterior.mean + shift, reference.posterior.covariance)
    return in_other_frames(moved, session.body.joint_errors)


def tables_by_sides(session: Identification) -> tuple[tuple[Sip, float], ...]:
    """Return the table of ``session`` with sides alike and with each side on its own, each with its log probability: a
    load on one side may not pass for sides that are not alike, nor what a side has of its own for a load.
    """
    prior = session.posterior.prior
    alike, apart = (prior if session.apart == one else with_sides(prior, apart=one) for one in (False, True))
    # Odds of 2 for alike sides as log probabilities: 1 / (1 + e^-odds) and 1 / (1 + e^odds).
    return (alike, float(-np.log1p(np.exp(-ODDS)))), (apart, float(-np.log1p(np.exp(ODDS))))


def table_like(one: Identification, other: Identification) -> Sip:
    """Return the table of session ``one`` with the trunk's matter and the sides as in session ``other``."""
    table = with_matter_placed(
        one.posterior.prior, one.body, along=matter_follows_joint(other.posterior.prior, other.body)
    )
    apart = one.apart and table is one.posterior.prior
    return table if apart == other.apart else with_sides(table, apart=other.apart)


def scaled_to_mass(prior: Sip, mass: float) -> Sip:
    """Return the table ``prior`` scaled to a body of the same build with a total mass of ``mass`` kg."""
    ratio = mass / float(prior.mass.sum())
    # A body scaled by r: mean times r, covariance times r².
    return Sip(prior.segments, ratio * prior.phi, ratio**2 * np.asarray(prior.covariance))


def unloaded_bodies(tables: tuple[tuple[Sip, float], ...], *, weighed: bool) -> tuple[UnloadedBody, ...]:
    """Return the hypotheses on the body without a load: priors inflated from each of the ``tables`` (given with log
    probabilities), and, unless it was ``weighed`` without a load, a declared mass that includes the load or is wrong.
    """
    cases = ((0.0, False, 1.0),) if weighed else _DECLARED
    return tuple(
        UnloadedBody(inflate_prior(table, times, wrong), log + float(np.log(share / len(_ODD))), holds)
        for table, log in tables
        for wrong, holds, share in cases
        for times in _ODD
    )


def inflate_prior(before: Sip, times: float, wrong: float = 0.0) -> Sip:
    """Return ``before`` with all standard deviations multiplied by ``times`` at unchanged uncertainty of the total
    mass; then with an error of the total mass of standard deviation ``wrong`` kg, distributed over the segments in
    proportion.
    """
    covariance = np.asarray(before.covariance)
    total = np.tile(np.eye(10)[0], len(before.segments))
    # C 1 (1 the masses): covariance of every parameter with the total mass.
    gain = covariance @ total
    known = float(total @ gain)
    if known > 0:
        # The part of C that goes with the total: its variance is known, only the rest is inflated.
        shared = np.outer(gain, gain) / known
        covariance = times**2 * (covariance - shared) + shared
    # One kilogram of this body in its own proportions.
    body = before.phi / (total @ before.phi)
    return Sip(before.segments, before.phi, covariance + wrong**2 * np.outer(body, body))


def whiten_innovation(data: Information, before: Sip) -> tuple[Array, Array, float]:
    """Return the rows of the data (r, p) and the innovation relative to ``before`` (r,), both whitened by noise and by
    the uncertainty of ``before``, and the log evidence of the data without a load.

    With R phi = y + noise and phi ~ N(before, P): y - R before has the covariance 1 + R P R'.
    """
    # Innovation y - R phi0 has the covariance 1 + R P R' = L L'.
    spread = data.triangle @ before.covariance @ data.triangle.T
    L = np.linalg.cholesky(np.eye(len(spread)) + spread)
    both = np.column_stack([data.triangle, data.target - data.triangle @ before.phi])
    white = solve_triangular(L, both, lower=True)
    # - log|L L'| / 2 - |L^-1 innovation|² / 2.
    log_evidence = -float(np.log(np.diag(L)).sum()) - 0.5 * float(white[:, -1] @ white[:, -1])
    return white[:, :-1], white[:, -1], log_evidence

"""What the body may be without a load: as known before, odder than that, or of another mass than was declared."""

import numpy as np
from scipy.linalg import solve_triangular

from biodance.identification.identification import Identification
from biodance.identification.information import Information
from biodance.identification.placement import goes_along, placed_as, with_sides
from biodance.identification.posterior import prior_factor
from biodance.records import Array, Sip
from biodance.uncertainty.caution import in_other_frames

_ODD = (1.0, 1.5, 2.25, 3.4)
"""Times that the body may differ from what was known before by more than its standard deviations, equally probable."""
_WRONG_SCALE, _WRONG_BY = 0.2, 2.5
"""Probability that the declared mass is wrong or holds the load, and kg by which it then is (standard deviation)."""


def expect_unloaded(reference: Identification, session: Identification) -> Sip:
    """Return what ``reference`` lets expect of the unloaded body in ``session``, with covariance.

    The belief of the reference, moved by what the table itself changed between the sessions (another static trial,
    other lengths), with the trunk's matter in the same of its two places, known as on another day (markers glued
    anew). The session's table counts at the mass of the
    reference: the mass that the session declares may hold the load.

    Raises
    ------
    NotSolved
        The reference contradicts every possible body, so its belief is none of a body.
    """
    along = goes_along(reference.belief.prior, reference.body)
    same = placed_as(session.belief.prior, session.body, along=along)
    table = weighing(same, float(reference.belief.prior.mass.sum()))
    shift = table.phi - reference.belief.prior.phi
    moved = Sip(reference.sip.segments, reference.belief.mean + shift, reference.belief.covariance)
    return in_other_frames(moved, session.body.joint_errors)


def alike_table(session: Identification) -> Sip:
    """Return the table of ``session`` with sides alike, whatever the data make of them: a load on one side may not pass
    for a person whose sides are not.
    """
    return with_sides(session.belief.prior, apart=False) if session.apart else session.belief.prior


def table_like(one: Identification, other: Identification) -> Sip:
    """Return the table of session ``one`` with the trunk's matter and the sides as in session ``other``."""
    table = placed_as(one.belief.prior, one.body, along=goes_along(other.belief.prior, other.body))
    apart = one.apart and table is one.belief.prior
    return table if apart == other.apart else with_sides(table, apart=other.apart)


def weighing(prior: Sip, mass: float) -> Sip:
    """Return the table ``prior`` of a body of the same build that weighs ``mass`` kg."""
    ratio = mass / float(prior.mass.sum())
    return Sip(prior.segments, ratio * prior.phi, ratio**2 * np.asarray(prior.covariance))


def rivals(before: Sip, *, weighed: bool) -> tuple[tuple[Sip, float], ...]:
    """Return what the body may be without a load, each with its log probability: odder than ``before`` says, and
    unless it was ``weighed`` without load another mass than declared.
    """
    chance = {0.0: 1.0} if weighed else {0.0: 1 - _WRONG_SCALE, _WRONG_BY: _WRONG_SCALE}
    return tuple(
        (odder(before, times, wrong), float(np.log(share / len(_ODD))))
        for wrong, share in chance.items()
        for times in _ODD
    )


def odder(before: Sip, times: float, wrong: float = 0.0) -> Sip:
    """Return ``before`` with all standard deviations ``times`` as large, the total mass known as well as before; then
    ``wrong`` kg more or less of it (standard deviation), all segments in proportion.
    """
    covariance = np.asarray(before.covariance)
    total = np.tile(np.eye(10)[0], len(before.segments))
    gain = covariance @ total
    known = float(total @ gain)
    if known > 0:
        shared = np.outer(gain, gain) / known
        covariance = times**2 * (covariance - shared) + shared
    body = before.phi / (total @ before.phi)
    return Sip(before.segments, before.phi, covariance + wrong**2 * np.outer(body, body))


def surprised(data: Information, before: Sip) -> tuple[Array, Array, float]:
    """Return the data's rows (r, p), what they show beyond ``before`` (r,), whitened by noise and by the uncertainty
    of ``before``, and the log evidence of the data without a load.

    With R phi = y + noise and phi ~ N(before): y - R before has the covariance 1 + R P R'.
    """
    A = data.triangle @ prior_factor(before)
    L = np.linalg.cholesky(np.eye(len(A)) + A @ A.T)
    both = np.column_stack([data.triangle, data.target - data.triangle @ before.phi])
    white = solve_triangular(L, both, lower=True)
    log_evidence = -float(np.log(np.diag(L)).sum()) - 0.5 * float(white[:, -1] @ white[:, -1])
    return white[:, :-1], white[:, -1], log_evidence

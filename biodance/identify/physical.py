"""Physically consistent parameters: every segment must be a body that could exist, inside its box.

A segment's ten parameters are those of some positive mass distribution iff its pseudo-inertia
    J = [[ tr(I)/2 1 - I, h ], [ h', m ]]   (4, 4), h = m c, I about the joint frame
is positive semidefinite (Wensing, Kim, Slotine 2018, doi 10.1109/LRA.2017.2729659): this holds positive mass, positive inertia and the
triangle inequality together. The estimate is the point of the constraint set nearest to the posterior mean in the posterior's own metric,
so that the objective is a plain sum of squares in whitened coordinates and the solver never fails for scale.
"""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from biodance.body.inertia import PSEUDO_INERTIA, pseudo_inertia, smallest_eigenvalues
from biodance.identify.posterior import Posterior
from biodance.records import Array, Sip

if TYPE_CHECKING:
    from biodance.body.body import Body

RELATIVE_FLOOR = 1e-3
"""Smallest eigenvalue allowed, as a share of the prior segment's own smallest eigenvalue (an absolute floor contradicts the tables)."""

MARGIN, INSIDE = 1.01, 1e-7
"""How far inside the floor (factor) and the box (m, per unit of the prior's mass) the programme stays, for the solver's own tolerance."""


@dataclass(frozen=True, eq=False)
class PhysicalFit:
    """A physically consistent estimate.

    ``sip`` with the posterior's covariance; ``moved`` (N,) True for the segments that had to be constrained; ``distance`` from the
    unconstrained mean in posterior standard deviations; ``status``, and in words its ``cause`` and cure when it is not "solved".
    """

    sip: Sip
    moved: NDArray[np.bool_]
    distance: float
    status: Literal["solved", "failed"]
    cause: str = ""


def _outside(phi: Array, body: "Body", floor: Array) -> NDArray[np.bool_]:
    """Return (N,) True for the segments that are no possible body, or whose CoM is not in its box."""
    table = phi.reshape(-1, 10)
    low, high = body.com_boxes[:, 0] * table[:, :1], body.com_boxes[:, 1] * table[:, :1]
    place = (table[:, 1:4] < low).any(axis=1) | (table[:, 1:4] > high).any(axis=1)
    return np.asarray((smallest_eigenvalues(phi) < floor) | place)


def physical_fit(belief: Posterior, body: "Body") -> PhysicalFit:
    """Return the physically consistent parameters nearest to the posterior mean, CoM inside ``body.com_boxes``.

    Only segments that violate are constrained, until none does: what a constraint that is not listed would not change is already nearest.
    When the mean is consistent it is returned as it is. A solver that stops gives the status "failed" and the prior.
    """
    prior = belief.prior
    floor = RELATIVE_FLOOR * np.maximum(smallest_eigenvalues(prior.phi), 0.0)
    bound = np.zeros(len(prior.segments), dtype=bool)
    phi, distance = belief.mean, 0.0
    while True:
        outside = _outside(phi, body, floor)
        if not outside.any():
            return PhysicalFit(Sip(prior.segments, phi, belief.covariance), bound, distance, "solved")
        if not np.any(outside & ~bound):
            return _failed(prior, "a body that is still impossible")
        bound = bound | outside
        x, status = _solve(belief, body, floor, np.flatnonzero(bound))
        if x is None:
            return _failed(prior, status)
        phi, distance = belief.mean + belief.factor @ x, float(np.linalg.norm(x))


def _failed(prior: Sip, word: str) -> PhysicalFit:
    cause = f"The solver stopped with {word!r}: the data contradict every body that fits the boxes. Check scaling and force plates."
    return PhysicalFit(prior, np.ones(len(prior.segments), dtype=bool), float("inf"), "failed", cause)


def _solve(belief: Posterior, body: "Body", floor: Array, bound: NDArray[np.intp]) -> tuple[Array | None, str]:
    """Solve min |x|² s.t. J_i(mean + factor x) >= floor, CoM in box, for the segments ``bound``; return x (k,) and the solver's word.

    x lies in the span of those segments' rows of the factor, so that the programme has ten unknowns per segment.
    """
    import cvxpy as cp

    rows = (10 * bound[:, None] + np.arange(10)).ravel()
    span = np.linalg.qr(belief.factor[rows].T)[0]
    z = cp.Variable(span.shape[1])
    constraints, sides, levels = [], [], []
    for i in bound:
        cut = slice(10 * i, 10 * i + 10)
        factor, J0 = belief.factor[cut] @ span, pseudo_inertia(belief.prior.phi[cut])[0]
        scale = 1 / np.sqrt(np.maximum(np.diag(J0), 1e-12))
        weight = np.outer(scale, scale).ravel()[:, None]
        level = (weight[:, 0] * (PSEUDO_INERTIA @ belief.mean[cut])).reshape(4, 4) - floor[i] * np.diag(scale**2) * MARGIN
        constraints.append(cp.reshape((weight * (PSEUDO_INERTIA @ factor)) @ z, (4, 4), order="C") + level >> 0)
        for side, sign in ((body.com_boxes[i, 0], 1.0), (body.com_boxes[i, 1], -1.0)):
            pick = sign * (np.eye(10)[1:4] - np.outer(side, np.eye(10)[0])) / max(J0[3, 3], 1e-9)
            sides.append(pick @ factor)
            levels.append(pick @ belief.mean[cut])
    constraints.append(np.concatenate(sides) @ z + np.concatenate(levels) >= INSIDE)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(z)), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate solve is not taken: its word is returned
            problem.solve(solver=cp.CLARABEL, ignore_dpp=True)
    except cp.error.SolverError as error:
        return None, str(error)
    return (span @ np.asarray(z.value) if problem.status == "optimal" else None), str(problem.status)

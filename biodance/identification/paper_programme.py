"""The quadratic programme of Bonnet et al. 2016 (eq. 8-11) as it stands, to compare with.

    min |F - W phi|² + |phi_table - phi|² s.t. M_i >= 0, CoM_i in its box, v' I_i v >= eps for sampled directions v, and
    the well-known base parameters as equalities.

Unweighted residuals (N and N·m alike) and unit prior weights, as printed. One thing is changed and must be: the printed
eps = 1e-3 kg·m² exceeds the smallest moments of inertia of the table's own feet and forearms, so that the table itself
would be infeasible; eps is taken relative to the table's smallest eigenvalue of each segment.
"""

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance.body.parts import TENSOR, inertia_tensor
from biodance.identification.base_parameters import BaseEstimate, estimate_base, structural_base
from biodance.identification.identification import Identification
from biodance.identification.knowledge import knowledge
from biodance.identification.physical import FailedFit, PhysicalFit
from biodance.identification.posterior import Information
from biodance.identification.statistics import Fit, statistics, usable
from biodance.records import Array, Sip
from biodance.threads import one_thread
from biodance.uncertainty.bands import WHITE, Noise

if TYPE_CHECKING:
    import cvxpy as cp

    from biodance.body.body import Body

RELATIVE_EPS = 0.1
"""Lower bound on v' I v as a share of the smallest eigenvalue of the table's tensor of that segment."""
DIRECTIONS = 100
"""Directions sampled uniformly on the half sphere, per segment."""


@dataclass(frozen=True, eq=False)
class PaperFit:
    """Solution ``phi`` (10N,), the base estimate it was tied to, ``equalities`` how many; ``cause`` why there are
    none.
    """

    phi: Array
    base: BaseEstimate
    equalities: int
    status: Literal["solved", "solved without equalities"]
    cause: str = ""


def directions() -> Array:
    """Return `DIRECTIONS` unit vectors (D, 3), spread evenly over the half sphere (golden spiral; v and -v say the
    same).
    """
    # Equal areas: z uniform on the half sphere, angle in golden steps.
    z = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    angle = np.arange(DIRECTIONS) * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def inequalities(body: "Body") -> tuple[Array, Array]:
    """Return A (k, 10N), b (k,) of ``A phi >= b``: masses, CoM boxes and sampled directions (paper eq. 8-10)."""
    rows, level = [], []
    v = directions()
    sampled = np.zeros((DIRECTIONS, 10))
    for column, (i, j) in enumerate(TENSOR, start=4):
        # v'I v = sum of v_i v_j I_ij: products of inertia count twice.
        sampled[:, column] = v[:, i] * v[:, j] * (1 if i == j else 2)
    for s, name in enumerate(body.segments):
        block = np.zeros((7 + DIRECTIONS, 10))
        block[0, 0] = 1.0
        # h - m low >= 0 and m high - h >= 0: CoM in its box, linear in the parameters.
        block[1:4, 1:4], block[1:4, 0] = np.eye(3), -body.com_boxes[s, 0]
        block[4:7, 1:4], block[4:7, 0] = -np.eye(3), body.com_boxes[s, 1]
        block[7:] = sampled
        wide = np.zeros((len(block), 10 * len(body.segments)))
        wide[:, 10 * s : 10 * s + 10] = block
        # Smallest eigenvalue first, as `eigvalsh` sorts.
        eps = RELATIVE_EPS * max(float(np.linalg.eigvalsh(inertia_tensor(body.sip.of(name)[4:]))[0]), 0.0)
        rows.append(wide)
        level.append(np.concatenate([np.zeros(7), np.full(DIRECTIONS, eps)]))
    return np.concatenate(rows), np.concatenate(level)


def paper_programme(data: Information, body: "Body") -> PaperFit | FailedFit:
    """Return the solution of eq. 8 for ``data`` compressed with unit noise (1 N, 1 N·m), table values from
    ``body.sip``.

    The equalities (eq. 11) tie the base parameters with a relative standard deviation of at most 10 %; where they
    contradict the boxes the programme is solved again without them, and the status says so.
    """
    base = estimate_base(data, structural_base(body))
    tied = list(base.well_known)
    E, e = base.base.regroup[tied], base.value[tied]
    phi, word = _solve(data, body, E, e)
    if phi is not None:
        return PaperFit(phi, base, len(tied), "solved")
    cause = (
        f"With the {len(tied)} base-parameter equalities the programme has no solution ({word}): they contradict "
        f"the CoM boxes."
    )
    phi, word = _solve(data, body, E[:0], e[:0])
    if phi is not None:
        return PaperFit(phi, base, 0, "solved without equalities", cause)
    return FailedFit(
        f"The paper's programme has no solution ({word}), not even without equalities: the CoM boxes contradict each "
        f"other."
    )


@one_thread()
def identify_as_paper(found: Identification, fits: tuple[Fit, ...]) -> Identification:
    """Return the identification ``found`` with the solution of eq. 8 in place of its parameters and base parameters:
    from the believable frames of the same trials ``fits``, each sample as it is, moments about the standing point.

    The programme has no intervals: standard deviations are NaN, and what the session can know stays as it was found.
    Where it has no solution, the fit failed.
    """
    used, about, _ = usable(found.body, fits)
    layout = Noise.unit(about, WHITE)
    data = statistics(found.body, used, layout).information(layout)
    solved, frames = paper_programme(data, found.body), data.frames
    if solved.status == "failed":
        return replace(found, fit=solved, known=(), notes=(solved.cause,), frames=frames)
    prior = found.posterior.prior
    sip = Sip(prior.segments, solved.phi, np.zeros_like(prior.covariance))
    known = tuple(replace(one, sd=float("nan")) for one in knowledge(sip, prior, found.posterior))
    solution = PhysicalFit(sip, np.zeros(len(prior.segments), dtype=bool), float("nan"))
    tied = f"{solved.equalities} of {solved.base.base.count} base parameters are held as equalities." * (
        not solved.cause
    )
    notes = (solved.cause or tied, "The paper's programme gives no intervals.")
    return replace(found, fit=solution, base=solved.base, known=known, notes=notes, frames=frames)


def solve_convex(problem: "cp.Problem") -> str:
    """Solve ``problem`` in place and return "optimal", or the solver's word for what it ran into: then no value is
    to be used.
    """
    import cvxpy as cp

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that an answer is inaccurate is said by the word
            problem.solve(solver=cp.CLARABEL, ignore_dpp=True)
    except cp.error.SolverError as error:
        return str(error).split(". ")[0]
    return str(problem.status)


def _solve(data: Information, body: "Body", E: Array, e: Array) -> tuple[Array | None, str]:
    """Solve eq. 8 in coordinates x in which the objective is |x|²; return phi and the solver's word."""
    import cvxpy as cp

    count = data.triangle.shape[1]
    # |R phi - r|² + |phi - phi0|² as one triangle U: the cost is |U (phi - centre)|² plus a constant.
    stacked = np.concatenate(
        [np.column_stack([data.triangle, data.target]), np.column_stack([np.eye(count), body.sip.phi])]
    )
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    inverse = np.linalg.inv(triangle[:count, :count])
    centre = inverse @ triangle[:count, count]
    A, b = inequalities(body)
    x = cp.Variable(count)
    constraints = []
    for matrix, level, equal in ((A, b, False), (E, e, True)):
        if len(matrix) == 0:
            continue
        slope = matrix @ inverse
        # Rows of unit length: no constraint is large by its units.
        scale = 1 / np.maximum(np.linalg.norm(slope, axis=1), 1e-12)
        left, right = scale[:, None] * slope @ x, scale * (level - matrix @ centre)
        constraints.append(left == right if equal else left >= right)
    word = solve_convex(cp.Problem(cp.Minimize(cp.sum_squares(x)), constraints))
    return (centre + inverse @ np.asarray(x.value) if word == "optimal" else None), word

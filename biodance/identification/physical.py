"""The possible body nearest to what the data say, or a word why there is none; an answer that the solver itself calls
inaccurate is none.

The programme, the shortest vector that keeps matrices positive semidefinite and distances positive, is written in the
form of its solver, Clarabel: least x' P x / 2 + q' x with b - A x in a product of cones (Goulart and Chen 2024,
arXiv:2405.12762). cvxpy, which writes larger ones (`paper_programme`), takes a third of a second to load.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from biodance.body.parts import PSEUDO_INERTIA, pseudo_inertia, smallest_eigenvalues
from biodance.errors import NotSolved
from biodance.identification.posterior import BodyPosterior
from biodance.records import Array, Sip
from biodance.threads import one_thread

if TYPE_CHECKING:
    from biodance.body.body import Body


SOLVED = "optimal"
"""The word for an answer that may be used."""
_WORDS = {"Solved": SOLVED, "AlmostSolved": "optimal_inaccurate", "PrimalInfeasible": "infeasible"}
"""The solver's words, as cvxpy says them."""


def shortest_inside(matrices: Sequence[tuple[Array, Array]], slope: Array, level: Array) -> tuple[Array | None, str]:
    """Return argmin |z|² (k,) and "optimal", or None and what the solver ran into.

    Every M z + m of ``matrices`` (M (n, n, k) and m (n, n), symmetric) is positive semidefinite, ``slope`` (q, k) z +
    ``level`` (q,) nowhere negative.
    """
    import clarabel
    from scipy.sparse import csc_matrix, eye_array

    count = slope.shape[1]
    rows, right, cones = [-slope], [level], [clarabel.NonnegativeConeT(len(level))]
    for M, m in matrices:
        j, i = np.tril_indices(len(m))  # the upper triangle, column by column
        # svec: off-diagonals times sqrt(2), so that the inner product of vectors is that of matrices.
        weight = np.where(i == j, 1.0, np.sqrt(2.0))
        rows.append(-weight[:, None] * M[i, j])
        right.append(weight * m[i, j])
        cones.append(clarabel.PSDTriangleConeT(len(m)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    # The solver halves x'P x: P = 2 makes it |x|².
    twice = csc_matrix(2.0 * eye_array(count))
    A, b = csc_matrix(np.concatenate(rows)), np.concatenate(right)
    found = clarabel.DefaultSolver(twice, np.zeros(count), A, b, cones, settings).solve()
    word = _WORDS.get(str(found.status), str(found.status))
    return (np.array(found.x) if word == SOLVED else None), word


RELATIVE_FLOOR = 1e-3
"""Smallest eigenvalue allowed, as a share of the prior segment's own smallest eigenvalue (an absolute floor
contradicts the tables).
"""

_TOLERANCE = 1e-7
"""How far outside its limits a segment may lie by rounding, in its own units (CoM in m): ten times the solver's
tolerance.
"""
GAP = 1e-6
"""How far inside the cone of possible bodies the programme stays, so that what it returns is inside for everybody."""
_NOTHING = 1e-9
"""Relative size of what rounding leaves of a zero."""
THIN = 1e-2
"""Least second moment of a segment about an axis, relative to its largest, in the units: a rod has none."""


@dataclass(frozen=True, eq=False)
class PhysicalFit:
    """A physically consistent estimate.

    ``sip`` with the posterior's covariance; ``moved`` (N,) True for the segments that a constraint holds at the edge of
    what can be; ``distance`` from the unconstrained mean in posterior standard deviations.
    """

    sip: Sip
    moved: NDArray[np.bool_]
    distance: float
    status: Literal["solved"] = "solved"
    cause: Literal[""] = ""


@dataclass(frozen=True, eq=False)
class FailedFit:
    """No consistent estimate was found: ``cause`` and cure in words. There are no parameters in it, so nobody can
    use them by mistake.
    """

    cause: str
    status: Literal["failed"] = "failed"

    @property
    def sip(self) -> None:  # None, so that the type checker refuses whoever has not looked at the status
        """Raise `NotSolved`."""
        raise NotSolved(self.cause)

    phi = sip
    """Likewise."""


@one_thread()
def physical_fit(posterior: BodyPosterior, body: "Body") -> PhysicalFit | FailedFit:
    """Return the physically consistent parameters nearest to the posterior mean, CoM inside ``body.com_boxes``; look at
    ``status``.

    Only segments that violate are constrained, until none does: what a constraint that is not listed would not change
    is already nearest. When the mean is consistent it is returned as it is.
    """
    prior, limits = posterior.prior, _limits(posterior.prior, body)
    bound = np.zeros(len(prior.segments), dtype=bool)
    phi, distance = posterior.mean, 0.0
    while (outside := limits.room(phi) < -_TOLERANCE).any():
        bound = bound | outside
        x, word = _nearest(posterior, limits, np.flatnonzero(bound))
        if x is None:
            held = ", ".join(name for name, acts in zip(prior.segments, bound, strict=True) if acts)
            return FailedFit(
                f"No possible body was found near what the data say (solver: {word}; segments {held}): the data "
                "contradict every body that fits the boxes. Check the scaling, the declared mass and the force plates."
            )
        phi, distance = posterior.mean + posterior.factor @ x, float(np.linalg.norm(x))
    return PhysicalFit(Sip(prior.segments, phi, posterior.covariance), bound & (limits.room(phi) < 10 * GAP), distance)


@dataclass(frozen=True, eq=False)
class _Limits:
    """What N segments may be: ``cone`` (N, 16, 10) phi of at least ``floor``, ``sides`` (N, 6, 10) phi not negative."""

    cone: Array
    floor: Array
    sides: Array

    def room(self, phi: Array) -> Array:
        """Return how far (N,) every segment of ``phi`` (10N,) is inside its limits; negative: no possible body, or
        CoM outside.
        """
        # A matrix inside its cone has a smallest eigenvalue above zero; CoM by its nearest side of the box.
        ten = phi.reshape(-1, 10, 1)
        inside = np.linalg.eigvalsh((self.cone @ ten).reshape(-1, 4, 4) - self.floor)[:, 0]
        return np.asarray(np.minimum(inside, (self.sides @ ten)[..., 0].min(axis=1)))


def _limits(prior: Sip, body: "Body") -> _Limits:
    """Return the limits of ``body`` with the units and the floors of ``prior``."""
    size = np.abs(np.diagonal(pseudo_inertia(prior.phi), axis1=1, axis2=2))
    # A rod or plate has a second moment of nearly nothing: its unit is bounded from below.
    second = np.maximum(size[:, :3], THIN * size[:, :3].max(axis=1, keepdims=True))
    unit = 1 / np.sqrt(np.maximum(np.column_stack([second, size[:, 3]]), 1e-9))
    # Congruence D J D with D = diag(unit): definite where J is, eigenvalues comparable between segments.
    weight = unit[:, :, None] * unit[:, None, :]
    least = RELATIVE_FLOOR * np.maximum(smallest_eigenvalues(prior.phi), 0.0)
    pick = np.eye(10)[1:4]
    # h - m side per axis; times 1 / m (unit of J's last element, squared) it is a distance in metres.
    low, high = (pick - side[:, :, None] * np.eye(10)[0] for side in (body.com_boxes[:, 0], body.com_boxes[:, 1]))
    sides = np.concatenate([low, -high], axis=1) * unit[:, 3, None, None] ** 2
    return _Limits(weight.reshape(-1, 16, 1) * PSEUDO_INERTIA, least[:, None, None] * np.eye(4) * weight, sides)


def _nearest(posterior: BodyPosterior, limits: _Limits, bound: NDArray[np.intp]) -> tuple[Array | None, str]:
    """Solve min |x|² s.t. the segments ``bound`` of mean + factor x are inside their limits; return x (k,) and the
    solver's word.

    x lies in the span of those segments' rows of the factor, so that the programme has ten unknowns per segment. If the
    solver stops, it is asked again in units of the distance to the prior.
    """
    rows = (10 * bound[:, None] + np.arange(10)).ravel()
    # The least |x| has no part that the bound segments do not see: x = Q z.
    span = np.linalg.qr(posterior.factor[rows].T)[0]
    local, mean = posterior.factor[rows] @ span, posterior.mean[rows]
    far = float(np.linalg.norm(np.linalg.lstsq(local, posterior.prior.phi[rows] - mean)[0]))
    words = []
    for unit in (1.0, 0.1 * far, far):
        z, word = _solve(local * unit, mean, limits, bound)
        if z is not None:
            x = span @ z * unit
            if limits.room(posterior.mean + posterior.factor @ x)[bound].min() >= -_TOLERANCE:
                return x, word
            word = "outside the limits"
        words.append(word)
    return None, ", then ".join(dict.fromkeys(words))


def _solve(local: Array, mean: Array, limits: _Limits, bound: NDArray[np.intp]) -> tuple[Array | None, str]:
    """Return the smallest z for which mean + local z of segments ``bound`` is inside limits, and the solver's word."""
    matrices, sides, levels = [], [], []
    for k, i in enumerate(bound):
        slope, level = local[10 * k : 10 * k + 10], mean[10 * k : 10 * k + 10]
        free = _free_axes(limits.cone[i] @ np.column_stack([slope, level]))
        # F J F' as a vector: (F kron F) vec J.
        axes, count = np.kron(free, free), len(free)
        # A little inside the cone: the solver's answer is then inside in spite of its tolerance.
        least = axes @ limits.floor[i].ravel() + GAP * np.eye(count).ravel()
        inside = (axes @ limits.cone[i] @ slope, axes @ limits.cone[i] @ level - least)
        matrices.append((inside[0].reshape(count, count, -1), inside[1].reshape(count, count)))
        sides.append(limits.sides[i] @ slope)
        levels.append(limits.sides[i] @ level)
    return shortest_inside(matrices, np.concatenate(sides), np.concatenate(levels))


def _free_axes(matrices: Array) -> Array:
    """Return the axes (r, 4) along which ``matrices`` (16, k) have something: along others a rod or plate is thin."""
    # The (16, k) matrices below each other as rows of length 4: right singular vectors are the axes they act on.
    _, size, axes = np.linalg.svd(matrices.T.reshape(-1, 4))
    return np.asarray(axes[size > _NOTHING * size.max()])

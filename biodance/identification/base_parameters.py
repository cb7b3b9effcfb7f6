"""Base parameters: the combinations of SIP that a wrench can show, found numerically (Gautier 1991, doi
10.1002/rob.4620080405).

Columns of the regressor that never move independently are regrouped: with the independent columns b and the dependent
ones d, W_d = W_b beta, hence W phi = W_b (phi_b + beta phi_d). The choice of b is deterministic and the one the paper
prints (eq. 5, 13): columns are taken in a fixed order, root first and mass and YY last within a segment, and kept when
they add rank; so a child's mass regroups into its parents, and YY of a hinge into XX - YY.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.identification.posterior import Information, fold
from biodance.motion.dynamics import regressor_of
from biodance.motion.kinematics import segment_motion
from biodance.records import Array, Motion, freeze

PARAMETERS = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
"""Names of the ten parameters of a segment, in Pinocchio's order."""
_DIGITS = 4
"""In which relations are told."""
_DEPENDENT, _UNEXCITED = 1e-8, 1e-10
"""Share of a column's norm, of the largest singular value, that counts as none."""
_PREFERENCE = (1, 2, 3, 4, 5, 7, 8, 9, 6, 0)
"""Order in which the columns of one segment are offered to the base set: YY and M last."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The minimal set: ``columns`` (nb) indices into the 10N SIP; ``regroup`` (nb, 10N) with ``phi_b = regroup @
    phi``; ``names`` (10N).
    """

    columns: tuple[int, ...]
    regroup: Array
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, "BaseParameters", regroup=(len(self.columns), len(self.names)))

    @property
    def count(self) -> int:
        """Number of base parameters."""
        return len(self.columns)

    def relations(self) -> tuple[str, ...]:
        """Return the regrouping relations as text, one per base parameter (paper eq. 13)."""
        lines = []
        for i, column in enumerate(self.columns):
            text = self.names[column]
            for j in np.flatnonzero(np.abs(self.regroup[i]) > 10.0**-_DIGITS):
                if j == column:
                    continue
                factor = self.regroup[i, j]
                size = "" if abs(abs(factor) - 1) < 10.0**-_DIGITS else f"{abs(factor):.{_DIGITS}g} "
                text += f" {'+' if factor > 0 else '-'} {size}{self.names[j]}"
            lines.append(text)
        return tuple(lines)


def base_parameters(triangle: Array, names: tuple[str, ...]) -> BaseParameters:
    """Return the base parameters of a regressor given by its R factor ``triangle`` (p, p) or any rows (m, p).

    A column counts as dependent when less than `_DEPENDENT` of its norm is left after projection on the columns kept
    before it.
    """
    order = sorted(range(triangle.shape[1]), key=lambda c: (c // 10, _PREFERENCE.index(c % 10)))
    scale = np.linalg.norm(triangle, axis=0)
    largest = scale.max(initial=0.0)
    kept: list[int] = []
    basis: Array = np.empty((triangle.shape[0], 0))
    for column in order:
        vector = triangle[:, column]
        rest = vector - basis @ (basis.T @ vector)
        # Gram-Schmidt twice: after one pass rounding leaves parts along the basis.
        rest = rest - basis @ (basis.T @ rest)
        size = np.linalg.norm(rest)
        if scale[column] > _DEPENDENT * largest and size > _DEPENDENT * scale[column]:
            kept.append(column)
            basis = np.column_stack([basis, rest / size])
    kept.sort()
    regroup: Array = np.zeros((len(kept), triangle.shape[1]))
    if kept:
        # W = W_b beta in the least-squares sense; columns kept give unit vectors, so phi_b +
        # beta phi_d = regroup phi.
        solution = np.asarray(np.linalg.lstsq(triangle[:, kept], triangle, rcond=None)[0])
        solution[np.abs(solution) < 1e-9] = 0.0
        regroup = solution
    return BaseParameters(tuple(kept), regroup, names)


def parameter_names(body: Body) -> tuple[str, ...]:
    """Return the names of the 10N SIP of ``body``: ``MX pelvis``."""
    return tuple(f"{p} {segment}" for segment in body.segments for p in PARAMETERS)


def structural_base(body: Body, *, seed: int = 0) -> BaseParameters:
    """Return the base parameters that ``body`` has for general motion: rank found on 100 random states (not on a
    recorded trial).
    """
    rng = np.random.default_rng(seed)
    frames = max(100, 5 * len(body.segments))
    q = rng.uniform(-2, 2, (frames, body.nq))
    if body.n_root:
        q[:, 3:7] = rng.normal(size=(frames, 4))
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    motion = Motion(
        np.arange(frames, dtype=float), q, rng.normal(0, 2, (frames, body.nv)), rng.normal(0, 4, (frames, body.nv))
    )
    W = regressor_of(segment_motion(body, motion), gravity=body.gravity, sharing=body.sharing)
    # The rank of W is that of its triangle: QR keeps W'W.
    return base_parameters(fold(W.reshape(-1, W.shape[2])), parameter_names(body))


@dataclass(frozen=True, eq=False)
class BaseEstimate:
    """Weighted least squares on the base parameters (paper eq. 6, 7).

    ``value``, ``sd`` (nb,) in SI units, ``covariance`` (nb, nb), ``condition`` of W_b, ``rank`` of the data in the base
    set (rank < count: some cannot be known from these data; their sd is infinite).
    """

    base: BaseParameters
    value: Array
    sd: Array
    covariance: Array
    condition: float
    rank: int

    @property
    def relative_sd(self) -> Array:
        """(nb,) standard deviation in percent of the value; infinite where the value is zero or unknown."""
        size = np.abs(self.value)
        return np.where(size > 0, 100 * self.sd / np.where(size > 0, size, 1.0), np.inf)

    @property
    def well_known(self) -> tuple[int, ...]:
        """Positions of the base parameters with a relative standard deviation of at most 10 %, the paper's rule."""
        return tuple(int(i) for i in np.flatnonzero(self.relative_sd <= 10.0))


def estimate_base(data: Information, base: BaseParameters) -> BaseEstimate:
    """Return the weighted least-squares estimate of the base parameters from whitened data.

    Directions that the data do not excite get an infinite standard deviation, never a small one.
    """
    columns = list(base.columns)
    Wb = data.triangle[:, columns]
    # Columns of unit length: kg, kg·m and kg·m² else decide what counts as a small singular value.
    scale = np.linalg.norm(Wb, axis=0)
    scale[scale <= _UNEXCITED**2 * scale.max(initial=0.0)] = 1.0  # never moved: an unknown direction, not a tiny one
    U, s, Vt = np.linalg.svd(Wb / scale, full_matrices=False)
    good = s > _UNEXCITED * s.max(initial=0.0)
    rank = int(good.sum())
    # Pseudo-inverse V S^+ U' of the scaled columns; the scale is divided out of the value afterwards.
    inverse = np.where(good, 1 / np.where(good, s, 1.0), 0.0)
    value = (Vt.T * inverse) @ (U.T @ data.target) / scale
    # Whitened data: covariance (W_b'W_b)^-1 = V S^-2 V' between the scales.
    half = (Vt.T * inverse) / scale[:, None]
    covariance = half @ half.T
    # A parameter with a part in the null space may be anything, whatever its finite part.
    unknown = (np.abs(Vt[~good]) > 1e-6).any(axis=0) if rank < len(columns) else np.zeros(len(columns), dtype=bool)
    sd = np.where(unknown, np.inf, np.sqrt(np.diag(covariance)))
    condition = float(np.linalg.cond(Wb)) if rank == len(columns) else float("inf")
    return BaseEstimate(base, value, sd, covariance, condition, rank)

"""What a movement is to reveal: which parameters, of which segments, with which weights and which knowledge
beforehand.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from biodance.errors import BiodanceError
from biodance.records import Array, frozen_array

if TYPE_CHECKING:
    from biodance.body.body import Body
    from biodance.identification.base_parameters import BaseParameters


@dataclass(frozen=True, eq=False)
class Target:
    """``columns`` (nb) the base columns among the SIP; ``blocks`` those of each segment that count (empty: the segment
    does not); ``weights`` (N,) of the segments, kg in eq. 12; ``prior_factor`` (p, k) with covariance S S' of the
    table.
    """

    columns: tuple[int, ...]
    blocks: tuple[tuple[int, ...], ...]
    weights: Array
    prior_factor: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", frozen_array(self.weights, (len(self.blocks),), "Target.weights"))
        object.__setattr__(self, "prior_factor", frozen_array(self.prior_factor, (None, None), "Target.prior_factor"))
        if not any(self.blocks):
            raise BiodanceError("The target names no parameter to excite; choose at least one segment.")

    @property
    def bound(self) -> float:
        """Smallest value that the mass-weighted sum of condition numbers can have: every condition number is at least
        1.
        """
        return float(sum(w for w, block in zip(self.weights, self.blocks, strict=True) if block))


def target(
    body: "Body",
    base: "BaseParameters",
    *,
    kind: Literal["static", "dynamic", "all"] = "all",
    segments: tuple[str, ...] | None = None,
    weights: Array | None = None,
) -> Target:
    """Return the target for the masses and first moments ("static"), the inertias ("dynamic") or all base parameters of
    ``segments``.

    ``weights`` (N,) default to the segments' masses in the table (paper eq. 12).
    """
    from biodance.identification.posterior import prior_factor

    wanted = {body.segment_index(name) for name in (segments if segments is not None else body.segments)}
    kinds = {"static": range(4), "dynamic": range(4, 10), "all": range(10)}[kind]
    columns = tuple(c for c in base.columns if c % 10 in kinds)
    blocks = tuple(tuple(c for c in columns if c // 10 == i) if i in wanted else () for i in range(len(body.segments)))
    return Target(columns, blocks, body.sip.mass if weights is None else weights, prior_factor(body.sip))


def spectrum(triangle: Array, columns: tuple[int, ...]) -> tuple[Array, Array]:
    """Return eigenvalues (descending, floored at 1e-30 of the largest) and eigenvectors of the Gram matrix of the
    chosen ``columns``.

    Taken from the singular values of the triangle, so that condition numbers up to 1e15 are seen, not only up to 1e8.
    """
    _, singular, right = np.linalg.svd(triangle[:, columns], full_matrices=False)
    value = singular**2
    return np.maximum(value, 1e-30 * max(float(value[0]), 1e-300)), right.T

"""Cross-validation: the table's and the identified body on trials, beside the measured wrench; how sure the gain is.

Root mean squares alone cannot rank methods of identification (a wrong body can fit well), so the errors of the
parameters and their intervals belong beside these numbers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.body.body import Body
from biodance.errors import BiodanceError
from biodance.identification.statistics import Fit
from biodance.motion.regressor import Agreement, compare, predict_wrench
from biodance.records import Array, Wrench
from biodance.spatial import wrench_about_point

BLOCK_SECONDS = 1.0
"""s: errors of a person's trial are correlated over about a movement; blocks this long are drawn as units."""


@dataclass(frozen=True, eq=False)
class TrialValidation:
    """One trial: ``measured``, ``table`` and ``identified`` wrenches about ``about`` (3,) m, the frames ``use`` (T,)
    compared, and how well each agrees (paper Table II, Fig. 9).
    """

    name: str
    about: Array
    measured: Wrench
    table: Wrench
    identified: Wrench
    use: NDArray[np.bool_]
    table_agreement: Agreement
    identified_agreement: Agreement


@dataclass(frozen=True, eq=False)
class ResidualRatio:
    """How much smaller the RMS residual of the second model is: ratio first / second of forces and of moments with 95 %
    intervals.

    ``force``, ``moment`` the ratios; ``force_interval``, ``moment_interval`` (2,) from a block bootstrap; ``blocks``
    drawn from.
    """

    force: float
    moment: float
    force_interval: tuple[float, float]
    moment_interval: tuple[float, float]
    blocks: int

    @property
    def is_proven(self) -> bool:
        """Whether the second model is better: both 95 % intervals lie above 1."""
        return min(self.force_interval[0], self.moment_interval[0]) > 1


def validate(body: Body, identified: Body, fit: Fit, *, about: Array) -> TrialValidation:
    """Return how the table (``body.sip``) and the identified body predict the wrench of one trial, moments about
    ``about`` (3,) m lab.

    ``about``: the middle of the plates, or `standing_point` of the session; moments about the distant lab origin hide
    the differences.

    Raises
    ------
    TrialRefused
        No frame of the trial may be compared.
    """
    measured, table, found = (
        Wrench(wrench.time, wrench_about_point(wrench.value, about))
        for wrench in (fit.wrench, predict_wrench(body, fit.motion), predict_wrench(identified, fit.motion))
    )
    return TrialValidation(
        fit.name,
        about,
        measured,
        table,
        found,
        fit.use,
        compare(measured, table, fit.use),
        compare(measured, found, fit.use),
    )


_DRAWS = 1000
"""Of the bootstrap."""


def residual_ratio(trials: tuple[TrialValidation, ...]) -> ResidualRatio:
    """Return the ratio of RMS residuals table / identified over all ``trials`` with a block-bootstrap interval.

    Raises
    ------
    BiodanceError
        There are fewer than three blocks of one second: no interval can be given.
    """
    first, second = [], []
    for trial in trials:
        size = max(1, round(BLOCK_SECONDS * trial.measured.rate))
        use = np.flatnonzero(trial.use)
        for piece in np.array_split(use, max(1, use.size // size)):
            first.append(_squares(trial.measured, trial.table, piece))
            second.append(_squares(trial.measured, trial.identified, piece))
    if len(first) < 3:
        raise BiodanceError(
            f"The trials hold {len(first)} blocks of {BLOCK_SECONDS:g} s; an interval of the gain needs 3. Record "
            f"longer."
        )
    a, b = np.array(first), np.array(second)
    drawn = np.random.default_rng(0).integers(0, len(a), (_DRAWS, len(a)))
    ratio = np.sqrt(a[drawn].sum(axis=1) / b[drawn].sum(axis=1))
    low, high = np.percentile(ratio, [2.5, 97.5], axis=0)
    force, moment = np.sqrt(a.sum(axis=0) / b.sum(axis=0))
    return ResidualRatio(
        float(force), float(moment), (float(low[0]), float(high[0])), (float(low[1]), float(high[1])), len(a)
    )


def _squares(measured: Wrench, simulated: Wrench, frames: NDArray[np.intp]) -> Array:
    """Return the summed squared difference (2,) of forces and of moments."""
    difference = (measured.value[frames] - simulated.value[frames]) ** 2
    return np.array([difference[:, :3].sum(), difference[:, 3:].sum()])

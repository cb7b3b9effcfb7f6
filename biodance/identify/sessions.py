"""Two sessions of one person: which quantities differ, and how sure that is (a limb after a cast, a prosthesis, weight lost)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from biodance.errors import BiodanceError
from biodance.identify.identification import Identification
from biodance.identify.knowledge import QUANTITIES, SIGMAS, UNITS, segment_quantities


@dataclass(frozen=True)
class Difference:
    """``later`` minus ``earlier`` of one quantity of one segment: ``value`` with ``sd`` in ``unit``; ``p`` of a difference at least as
    large if nothing had changed; ``known`` False where neither session's data say anything about it (both values are the table's).
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


def differences(earlier: Identification, later: Identification) -> tuple[Difference, ...]:
    """Return all differences, later minus earlier.

    The two posteriors share the table: what both still owe to it is common and cancels, so the variance of the difference is that of the
    data parts; with gain K = 1 - C P^-1 of each session, Var = C1 + C2 - A1 P A2' - A2 P A1' with A = C P^-1.

    Raises
    ------
    BiodanceError
        The sessions have different segments.
    """
    if earlier.sip.segments != later.sip.segments:
        raise BiodanceError("The two sessions have different segments and cannot be compared. Use the same kind of body in both.")
    first, second = earlier.belief, later.belief
    keep1, keep2 = (belief.covariance @ np.linalg.pinv(belief.prior.covariance, rcond=1e-12, hermitian=True) for belief in (first, second))
    mutual = keep1 @ first.prior.covariance @ keep2.T
    spread = first.covariance + second.covariance - mutual - mutual.T
    rows = []
    for i, segment in enumerate(earlier.sip.segments):
        cut = slice(10 * i, 10 * i + 10)
        before, after = (segment_quantities(one.sip.phi[cut]) for one in (earlier, later))
        slope = 0.5 * (before[1] + after[1])
        sd = np.sqrt(np.maximum(np.diag(slope @ spread[cut, cut] @ slope.T), 0.0))
        for k, (quantity, unit) in enumerate(zip(QUANTITIES, UNITS, strict=True)):
            value = float(after[0][k] - before[0][k])
            p = float(2 * norm.sf(abs(value) / sd[k])) if sd[k] > 0 else 1.0
            informed = any(one.known[10 * i + k].verdict != "cannot be known" for one in (earlier, later))
            rows.append(Difference(segment, quantity, unit, value, float(sd[k]), p, informed))
    return tuple(rows)

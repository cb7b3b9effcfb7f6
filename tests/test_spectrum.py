"""Rows by frequency of trials that were low-passed at different cut-offs: what a filter has taken out of movement and
forces is no quiet part of them.
"""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import RATE, body, windows

from biodance.diagnosis.problem import TrialWindow, problem
from biodance.identification.statistics import statistics
from biodance.lab.prepare import LowPass, low_pass
from biodance.records import Wrench
from biodance.uncertainty.bands import BANDS, Noise

SLOW = 2.0
"""Hz of the one trial's cut-off."""


def filtered(window: TrialWindow, cutoff: float) -> TrialWindow:
    """Return a trial whose movement and forces were low-passed as its settings say: for the forces of this test."""
    settings = window.trial.settings.changed({"filter.cutoff": cutoff})
    own = LowPass(settings.filter.order, cutoff)
    plates = tuple(
        replace(p, wrench=Wrench(p.wrench.time, low_pass(p.wrench.value, RATE, own))) for p in window.trial.plates
    )
    return replace(window, trial=replace(window.trial, plates=plates, settings=settings))


@pytest.fixture(scope="module")
def trials() -> tuple[TrialWindow, ...]:
    """One trial as recorded up to 10 Hz, and one low-passed at `SLOW`."""
    one, other = windows(4, trials=2)
    return filtered(one, 10.0), filtered(other, SLOW)


def test_what_a_trials_own_low_pass_has_taken_out_is_not_looked_at(trials: tuple[TrialWindow, ...]) -> None:
    """Beside a slow trial a band is as loud as in the other one alone: counted, it would seem half as loud."""
    both, alone = problem(body(), trials), problem(body(), trials[:1])
    fastest = len(BANDS) - 1

    def size(put) -> float:
        rows = put.target[: put.wrench_rows].reshape(-1, 6)
        return float(np.sqrt(np.mean(rows[put.spectrum.band == fastest] ** 2)))

    assert size(both) == pytest.approx(size(alone), rel=1e-3)
    counts = [np.bincount(both.spectrum.band[both.spectrum.trial == k], minlength=len(BANDS)) for k in (0, 1)]
    seconds = both.spectrum.seconds / 2
    # 2 T coefficients per Hz of a run of T s: 3.5 Hz in the fastest band, and 1 of its 1.5 Hz in the one before.
    assert counts[0][-1] == pytest.approx(2 * seconds * 3.5, abs=1)
    assert counts[1][-2:].tolist() == pytest.approx([2 * seconds * (SLOW - BANDS.edges[-3]), 0], abs=1)


def test_identification_counts_no_rows_that_the_low_pass_has_taken_out(trials: tuple[TrialWindow, ...]) -> None:
    """The covariance that the body's residuals show of a band is that of the trial which holds it."""
    layout, phi = Noise.unit(np.array([0.4, 0.2, 0.0]), BANDS), body().sip.phi
    whole, slow = (statistics(body(), (window.fit,), layout) for window in trials)
    assert whole.count[-1] > 0
    assert slow.count[-1] == 0
    together = (whole + slow).moments(phi, np.zeros((phi.size, phi.size)))
    alone = whole.moments(phi, np.zeros((phi.size, phi.size)))
    np.testing.assert_allclose(together.residual[-1] / together.count[-1], alone.residual[-1] / alone.count[-1])

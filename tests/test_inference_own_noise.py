"""The noise of a session as it shows it: of rows that were drawn with noise of a known size, and of real walks."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from inferred_rows import DrawnRows, rows

from biodance.diagnosis.own_tolerances import own_tolerances
from biodance.diagnosis.spectrum import power_about, spectrum
from biodance.effects import causes
from biodance.inference.columns import VisibleColumns
from biodance.inference.own_noise import _left, _shown, own_noise
from biodance.inference.rows import rows_of
from biodance.inference.scales import LOUD, fit, nominal, prior_sd, products
from biodance.inference.session import see
from biodance.pipeline.judged_trials import chosen_windows
from biodance.pipeline.results import SessionResult
from biodance.records import CHANNELS
from biodance.settings import USUAL
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import Tolerances

BLOCKS = len(BANDS) * len(CHANNELS)
EXPECTED = np.array([[4.0, 1.0, 0, 0, 0, 0], [1.0, 9.0, 0, 0, 0, 0], *np.eye(6)[2:]])
"""N²: what noise of a coefficient is expected in every band, two channels together."""


def drawn(size: np.ndarray, *, each: int, seed: int = 3) -> DrawnRows:
    """Return rows of ``each`` coefficient in every band and channel that are ``size`` (Q,) times as loud as expected,
    with columns of unit coefficients beside it.
    """
    rng = np.random.default_rng(seed)
    found = rows(rng, plates=each * BLOCKS, blocks=BLOCKS, width=2)
    n = found.plates
    y = np.array(found.y)
    y[:n] = size[found.block[:n]] * rng.normal(size=n)
    y += found.X @ rng.normal(size=found.X.shape[1])
    known = Tolerances({}, np.tile(EXPECTED, (len(BANDS), 1, 1)), np.ones((len(BANDS), 6)))
    return replace(found, y=y, tolerances=known)


def shown(found: DrawnRows) -> np.ndarray:
    """Return (Q,) the standard deviation of every whitened row under the session's own noise."""
    white = np.linalg.inv(np.linalg.cholesky(EXPECTED))
    own = white @ own_noise(found)[0].noise @ white.T
    np.testing.assert_allclose(own, own * np.eye(6), atol=1e-12)
    return np.sqrt(np.einsum("bcc->bc", own)).ravel()


@pytest.mark.parametrize("seed", range(3))
def test_every_band_and_channel_is_as_quiet_as_it_shows(seed: int) -> None:
    size = np.resize([1.0, 0.85, 0.7, 0.55], BLOCKS)
    np.testing.assert_allclose(shown(drawn(size, each=60, seed=seed)), size, rtol=0.25)


def test_none_is_louder_than_expected() -> None:
    size = np.where(np.arange(BLOCKS) % 2, 3.0, 0.6)
    found = shown(drawn(size, each=40))
    np.testing.assert_allclose(found[1::2], 1.0)
    assert (found[::2] < 0.85).all()


def test_few_rows_say_little_and_none_nothing() -> None:
    """A coefficient or two that happen to be small are no quiet channel."""
    quiet = np.full(BLOCKS, 0.55)
    few, many = (np.median(shown(drawn(quiet, each=each))) for each in (2, 40))
    assert few > 1.15 * many
    some = drawn(np.full(BLOCKS, 0.6), each=40)
    gone = np.isin(some.block, [4, 9])
    kept = replace(some, X=some.X[~gone], y=some.y[~gone], block=some.block[~gone])
    np.testing.assert_allclose(shown(kept)[[4, 9]], 1.0)


def test_a_fault_is_not_hidden_by_the_noise_that_it_makes() -> None:
    """Rows that hold a fault stay about as loud as it is; the others become quiet all the same."""
    found = drawn(np.full(BLOCKS, 0.3), each=40)
    faulty = found.block == 7
    y = np.array(found.y)
    y[faulty] += 0.9 * np.sign(np.arange(faulty.sum()) % 2 - 0.5)
    own = shown(replace(found, y=y))
    assert own[7] == pytest.approx(0.95, rel=0.2)
    assert np.delete(own, 7).max() == pytest.approx(0.5)  # none is believed to be quieter


def test_a_fault_that_only_larger_tolerances_would_excuse_is_loud_in_its_rows() -> None:
    """Two columns of a tolerance in one band and channel, sixty times as large as anywhere."""
    found = drawn(np.full(BLOCKS, 0.6), each=40)
    faulty, own = found.block == 7, found.group == 2
    X = np.where(own & ~faulty[:, None], 0.0, found.X)
    y = 0.6 * np.random.default_rng(5).normal(size=len(found.y)) + X[:, own] @ np.array([60.0, -60.0])
    told = shown(replace(found, X=X, y=y))
    assert told[7] == pytest.approx(1.0)
    assert np.delete(told, 7).max() < 0.85


@pytest.mark.parametrize("name", ["biomechzoo/HC032A", "opensim_models/raj_walk", "c3d_parser_Sydney"])
def test_real_walks_are_quieter_than_their_movement_and_markers_let_expect(
    name: str, recording: Callable[[str], SessionResult]
) -> None:
    """A session each of three laboratories: in most bands and channels, not in all."""
    result = recording(name)
    windows, known = chosen_windows(result.trials), causes()
    own = own_tolerances(result.body, windows, result.session.trials).tolerances
    seen = see(result.body, windows, own, known, None)
    found = own_noise(rows_of(seen.problem, seen.causes, own, None))[0].noise
    white = np.linalg.inv(np.linalg.cholesky(own.noise))
    share = np.sqrt(np.einsum("bcc->bc", white @ found @ white.swapaxes(1, 2)))
    assert np.median(share) < 0.9  # the shortest walk has 108 rows, which say little of 30 sizes
    assert share.max() > 0.9


def test_columns_take_degrees_of_freedom_at_the_noise_of_the_session() -> None:
    """Against dense matrices: in a loud session columns take less of a quiet channel than at the expected noise."""
    some = drawn(np.where(np.arange(BLOCKS) % 2, 3.0, 0.8), each=3)
    columns, quiet = VisibleColumns.of(some), np.ones(some.noises + 1)
    quiet[:BLOCKS] = 0.9
    one = fit(products(columns, np.empty((len(some.y), 0)), some.y, 1 / quiet), prior_sd(some), nominal(some))
    assert one.scales.noise > 0.3
    n, X = some.plates, columns.X * one.size
    sure = np.ones(len(some.y))
    sure[:n], sure[some.simulated :] = np.exp(-2 * one.scales.noise) / 0.9**2, one.scales.weights
    # Posterior mean of the rows = H y, H = X (X'WX + 1)^-1 X'W; its trace within a block is what columns take there.
    fitted = X @ np.linalg.solve((X.T * sure) @ X + np.eye(X.shape[1]), X.T * sure)
    left = some.y - fitted @ some.y
    for q in range(0, BLOCKS, 2):
        at = np.flatnonzero(some.block == q)
        free = at.size - np.trace(fitted[np.ix_(at, at)])
        raw = 0.5 * np.log(left[at] @ left[at] / free) * 2 * free / (2 * free + 1 / LOUD**2)
        assert _shown(some, one, quiet, *_left(some, columns, one))[q] == pytest.approx(
            np.clip(np.exp(raw), 0.5, 1.0), rel=1e-6
        )


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_the_share_of_the_noise_that_goes_with_the_movement_is_found(share: float) -> None:
    """Noise is drawn where a movement that repeats has its power: in every eighth coefficient."""
    found = drawn(np.ones(BLOCKS), each=48)
    count = found.plates // len(CHANNELS)
    power = np.where(np.arange(count) % 8 == 0, 4.5, 0.5)
    own = found.block[: found.plates].reshape(-1, len(CHANNELS))
    assert (own // len(CHANNELS) == own[:, :1] // len(CHANNELS)).all(), "six channels of one band in every row"
    y = np.array(found.y)
    y[: found.plates] *= np.repeat(np.sqrt(1 - share + share * power), len(CHANNELS))
    assert own_noise(replace(found, y=y), power)[1] == pytest.approx(share, abs=0.15)


def test_a_loud_fault_does_not_tell_how_noise_is_spread() -> None:
    found = drawn(np.ones(BLOCKS), each=48)
    power = np.where(np.arange(found.plates // len(CHANNELS)) % 8 == 0, 4.5, 0.5)
    y = np.array(found.y)
    y[: found.plates] += 20.0 * np.repeat(power > 1, len(CHANNELS))
    assert own_noise(replace(found, y=y), power)[1] == 0.0


def test_power_lies_where_a_movement_repeats() -> None:
    """A force of 1.5 Hz in 20 s has its power about coefficient 60, and every band has one on average."""
    time = np.arange(0.0, 20.0, 0.04)
    rng = np.random.default_rng(5)
    wrench = np.outer(np.sin(2 * np.pi * 1.5 * time + 0.4), [10.0, 5, 40, 3, 2, 1]) + rng.normal(0, 0.1, (500, 6))
    case: Any = SimpleNamespace(
        motion=SimpleNamespace(rate=25.0), trial=SimpleNamespace(name="t", settings=USUAL), predicted=wrench
    )
    where = spectrum((case,), (np.ones(500, bool),), np.zeros(3))
    power = power_about(where, (case,), np.tile(np.eye(6), (len(BANDS), 1, 1)))
    for b in range(len(BANDS)):
        assert power[where.band == b].mean() == pytest.approx(1.0)
    own = np.flatnonzero(where.band == BANDS.of(500)[60])
    assert abs(int(np.argmax(power)) - 60) <= 1
    assert power[60 - 4 : 60 + 5].sum() > 0.9 * power[own].sum()


def test_power_about_a_coefficient_of_a_short_run_is_its_own() -> None:
    """Four coefficients of half a second: weights 3, 2, 1 of the neighbours that are there."""
    case: Any = SimpleNamespace(
        motion=SimpleNamespace(rate=25.0), trial=SimpleNamespace(name="t", settings=USUAL), predicted=np.zeros((12, 6))
    )
    wave = np.cos(np.pi * 3 * (np.arange(12) + 0.5) / 12)  # coefficient 3 alone, 3.1 Hz
    case.predicted = np.outer(wave, np.eye(6)[2])
    where = spectrum((case,), (np.ones(12, bool),), np.zeros(3), shortest=0.4)
    power = power_about(where, (case,), np.tile(np.eye(6), (len(BANDS), 1, 1)))
    fast = np.flatnonzero(where.band == where.band[3])
    assert int(np.argmax(power)) == 3
    assert power[fast].mean() == pytest.approx(1.0)
    assert power[4] / power[3] == pytest.approx((2 / 8) / (3 / 8), rel=0.15)

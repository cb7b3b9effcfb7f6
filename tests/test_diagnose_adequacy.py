"""What is left of a session without fault is called normal, however short the session is."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import RATE, body, known, redrawn, windows

from biodance.diagnosis.adequacy import (
    CONFLICT_LIMIT,
    LIMIT,
    adequacy,
    conflict_at_loudness,
    conflict_at_own_noise,
    energies,
    loudness,
    prior_data_conflict,
    unlikely,
    verdict,
)
from biodance.diagnosis.evidence import LinearPosterior
from biodance.diagnosis.naming import build_model
from biodance.diagnosis.problem import problem
from biodance.effects import QualityCheck


def test_chance_spreads_more_in_a_short_session() -> None:
    """Three seconds hold one coefficient below 0.3 Hz: its square is more than seven times the mean in one of 150."""
    worst = []
    for seed in range(12):
        window = windows(seed, trials=1)[0]
        use = np.zeros(window.use.size, dtype=bool)
        use[int(2 * RATE) : int(5 * RATE)] = True
        found, _ = build_model(problem(body(), (replace(window, use=use),)), known(), ("plate_offset",))
        worst.append(adequacy(found)[0].z)
    assert max(worst) < LIMIT
    assert max(worst) > 1.0, "the rows still spread"


def test_a_session_louder_in_all_bands_alike_is_no_alarm() -> None:
    """Numbers that spread by a tenth: a seventh more everywhere is nothing, a half more three standard deviations
    beyond that, and a seventh more in Fy alone two.
    """
    found, _ = build_model(problem(body(), windows(3)), known(), ("plate_offset",))
    left, nothing, rows = found.posterior.residual, 0 * found.posterior.mean, 6 * found.problem.spectrum.band.size
    usual = replace(found.tolerances, energy=energies(found), energy_sd=0.1 * energies(found))

    def z(louder: np.ndarray) -> np.ndarray:
        y = np.array(left)
        y[:rows] = (left[:rows].reshape(-1, 6) * louder).ravel()
        posterior = LinearPosterior(found.posterior.X, y, found.posterior.factor, nothing)
        return unlikely(replace(found, tolerances=usual, posterior=posterior))

    assert np.abs(z(np.full(6, 1.14))).max() < 0.2
    assert z(np.full(6, 1.5))[1:].min() > 3.0
    one = z(1 + 0.14 * np.eye(6)[1])
    assert one[2:, 1].min() > 1.9
    assert np.abs(np.delete(one, 1, axis=1)).max() < 0.2


def test_a_body_as_people_are_is_no_strain_and_a_strange_one_is() -> None:
    """Bodies drawn from the prior strain it as a standard normal number does; one with twice the deviations does not
    pass.
    """
    found, _ = build_model(problem(body(), windows(3)), known(), ("plate_offset",))
    rng, columns = np.random.default_rng(7), found.posterior.X
    largest = np.take_along_axis(columns, np.abs(columns).argmax(axis=0)[None], axis=0)[0]

    def in_conflict(size: float) -> float:
        signs = np.sign(largest)  # columns have the kernel's sign, bodies have not
        return prior_data_conflict(redrawn(found, rng, unlike=size, signs=signs))

    usual = np.array([in_conflict(1.0) for _ in range(200)])
    assert abs(usual.mean()) < 0.25
    assert 0.8 < usual.std() < 1.2
    assert usual.max() < CONFLICT_LIMIT
    assert np.median([in_conflict(2.0) for _ in range(20)]) > CONFLICT_LIMIT


def test_a_strange_body_is_excused_by_a_loud_session_and_not_by_one_loud_channel() -> None:
    """Noise everywhere moves the body; noise of Fy alone is what a fault leaves there."""
    found, _ = build_model(problem(body(), windows(3)), known(), ("plate_offset",))
    rows, rng = 6 * found.problem.spectrum.band.size, np.random.default_rng(7)
    drawn = [redrawn(found, rng, unlike=3.0, loud=1.1) for _ in range(20)]
    louder = [one for one in drawn if loudness(one) > 1.05 and prior_data_conflict(one) > CONFLICT_LIMIT]
    assert len(louder) > 5
    assert all(conflict_at_loudness(one) < prior_data_conflict(one) for one in louder)
    assert any(conflict_at_loudness(one) > CONFLICT_LIMIT for one in louder)
    quiet = redrawn(found, rng, unlike=3.0, loud=0.8)
    y = np.array(quiet.posterior.y)
    y[1:rows:6] += 3.0 * rng.normal(size=rows // 6)
    one_channel = replace(quiet, posterior=LinearPosterior.for_target(quiet.posterior.X, quiet.posterior.factor, y))
    assert prior_data_conflict(one_channel) > CONFLICT_LIMIT
    assert conflict_at_loudness(one_channel) == pytest.approx(prior_data_conflict(one_channel), rel=1e-9)
    assert conflict_at_own_noise(one_channel) < prior_data_conflict(one_channel)


def test_a_strained_body_is_never_complete() -> None:
    assert verdict(1, 1.0, ()) == "named, complete"
    assert verdict(1, 1.0, (), in_conflict=True) == "unexplained"
    assert verdict(0, 1.0, (), in_conflict=True) == "unexplained"


@pytest.mark.parametrize(
    ("named", "worst", "expected"),
    [
        (0, 4.4, "nothing wrong"),
        (0, 4.6, "unexplained"),
        (1, 4.4, "named, complete"),
        (1, 4.6, "named, incomplete"),
        (2, 8.9, "named, incomplete"),
        (2, 9.1, "unexplained"),
    ],
)
def test_the_verdict_turns_at_four_and_a_half_and_at_nine_deviations(named: int, worst: float, expected: str) -> None:
    """Thirty numbers of a session without fault stay below 4.5 in all but one of ten thousand; 9 is twice that."""
    assert verdict(named, worst, ()) == expected


def test_a_failed_check_is_a_name_too() -> None:
    failed, passed = (QualityCheck("labels", ok, "Seen.") for ok in (False, True))
    assert verdict(0, 1.0, (failed,)) == "named, complete"
    assert verdict(0, 1.0, (passed,)) == "nothing wrong"
    assert verdict(0, 4.6, (failed, passed)) == "named, incomplete"

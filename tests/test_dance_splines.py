"""Rest-to-rest splines: through their points, at rest at both ends, derivatives consistent."""

import numpy as np
import pytest

from biodance.dance.problem.splines import basis_at, rest_to_rest
from biodance.errors import BiodanceError


@pytest.mark.parametrize("via", [0, 1, 2, 4])
def test_passes_through_its_points_and_rests_at_the_ends(via: int) -> None:
    points = np.random.default_rng(via).normal(size=via + 2)
    at = basis_at(np.linspace(0, 2.0, via + 2), 2.0, via=via)
    np.testing.assert_allclose(at.position @ points, points, atol=1e-10)
    ends = basis_at(np.array([0.0, 2.0]), 2.0, via=via)
    np.testing.assert_allclose(ends.velocity @ points, 0, atol=1e-9)
    np.testing.assert_allclose(ends.acceleration @ points, 0, atol=1e-8)


def test_derivatives_agree_with_finite_differences() -> None:
    points, h = np.array([0.2, 1.0, -0.5, 0.3]), 1e-4
    t = np.linspace(0.1, 1.9, 40)
    here = basis_at(t, 2.0)
    before, after = basis_at(t - h, 2.0), basis_at(t + h, 2.0)
    np.testing.assert_allclose(here.velocity @ points, (after.position - before.position) @ points / (2 * h), atol=1e-5)
    np.testing.assert_allclose(
        here.acceleration @ points, (after.velocity - before.velocity) @ points / (2 * h), atol=1e-4
    )


def test_equal_points_do_not_move() -> None:
    basis = rest_to_rest(2.0)
    assert basis.time.size == 101
    np.testing.assert_allclose(basis.position @ np.full(4, 0.7), 0.7)
    np.testing.assert_allclose(basis.velocity @ np.full(4, 0.7), 0, atol=1e-12)


def test_no_samples_is_refused() -> None:
    with pytest.raises(BiodanceError, match="no samples"):
        rest_to_rest(0.0)

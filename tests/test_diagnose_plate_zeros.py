"""A plate's zero is an error, not noise: what looks like it is hidden by it, however little noise there is."""

import numpy as np
import pytest
from diagnosed_sessions import body, known, windows

from biodance.diagnosis.naming import build_model
from biodance.diagnosis.problem import problem
from biodance.diagnosis.screening import screen
from biodance.diagnosis.transient_contact import _best_size
from biodance.effects.external_contact import ExternalContact
from biodance.uncertainty.session_noise import of_zeros, with_own_noise, with_zeros

STEADY = ("plate_offset", "external_contact")


def shares(tolerances):
    model, causes = build_model(problem(body(), windows(1, trials=2)), tolerances, STEADY)
    return model, {one.names: one.visible for one in screen(model, causes)}


def test_what_looks_like_a_zero_is_seen_less_the_more_zeros_differ() -> None:
    """Counted as noise the zeros hide nothing, so that a zero seems to be seen as well as ever."""
    spread = of_zeros([12.0, 12.0])
    (_, sure), (_, wide), (_, noise) = (
        shares(one) for one in (known(), with_zeros(known(), spread, 70.0), with_own_noise(known(), spread, 70.0))
    )
    zeros = [names for names in sure if names[0] == "plate_offset"]
    assert all(noise[names] > 5.0 * wide[names] for names in zeros)
    assert all(wide[names] < sure[names] for names in sure)


def test_the_length_of_columns_is_that_beside_plates_without_zeros() -> None:
    """Of all columns at once, of one trial's, and of a course that comes and goes."""
    spread = of_zeros([12.0, 12.0])
    put = problem(body(), windows(1, trials=2))
    (alone, _), (model, _) = (build_model(put, one, STEADY) for one in (known(), with_zeros(known(), spread, 70.0)))
    rows = np.random.default_rng(3).normal(size=(len(put.target), 4))
    assert model.length(model.white(rows)) == pytest.approx(np.sum(alone.white(rows) ** 2))
    assert model.length(model.white(rows)) > 1.005 * np.sum(model.white(rows) ** 2)
    touch = ExternalContact("left_foot")
    assert _best_size(model, touch).length == pytest.approx(_best_size(alone, touch).length)

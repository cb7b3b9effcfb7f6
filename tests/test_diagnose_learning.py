"""What sessions without fault have in common is learned and taken off; what differs between them is a size."""

from dataclasses import replace

import numpy as np
import pytest

from biodance.diagnosis.learning import Null, learn_tolerances
from biodance.diagnosis.model import shown_left_out
from biodance.uncertainty.tolerances import Tolerances, mean_key, shipped

BANDS = len(shipped().noise)
BAND = np.repeat(np.arange(BANDS), 12)
KEYS = ("delay", "delay", "sag a", "sag a", "offset")
MEANS = ("delay left", "delay right", "sag a", "sag a", "offset")
TRUE_MEAN = np.array([1.0, -1.0, -2.0, -2.0, 0.0])
TRUE_SIZE = np.array([0.1, 0.1, 0.5, 0.5, 1.0])
MOVED = np.arange(1.0, 6 * BANDS + 1).reshape(BANDS, 6)
"""N², N²·m²: mean square of a coefficient that a session needs."""


def nulls(count: int) -> list[Null]:
    rng = np.random.default_rng(8)
    found = []
    for _ in range(count):
        columns = rng.normal(size=(6 * BAND.size, len(KEYS)))
        theta = TRUE_MEAN + TRUE_SIZE * rng.normal(size=len(KEYS))
        found.append(Null(columns @ theta + rng.normal(size=len(columns)), columns, KEYS, BAND, (), 70.0, MOVED, MEANS))
    return found


def learned(count: int) -> Tolerances:
    flat = np.ones((BANDS, 6))
    start = Tolerances(dict.fromkeys(KEYS, 1.0), np.tile(np.eye(6), (BANDS, 1, 1)), flat)
    return learn_tolerances(nulls(count), start, rounds=8)


def test_means_are_learned_with_their_sides_and_chance_is_none() -> None:
    found = learned(30)
    assert found.mean("delay left") == pytest.approx(1.0, abs=0.1)
    assert found.mean("delay right") == pytest.approx(-1.0, abs=0.1)
    assert found.mean("sag a") == pytest.approx(-2.0, abs=0.2)
    assert "offset" not in found.means
    assert found.size("offset") == pytest.approx(1.0, rel=0.3)


def test_a_mean_is_believed_to_a_third_of_itself() -> None:
    found = learned(30)
    assert found.size("delay") == pytest.approx(np.hypot(0.1, 1 / 3), rel=0.2)
    assert found.size("sag a") == pytest.approx(np.hypot(0.5, 2 / 3), rel=0.2)


def test_the_movement_is_that_of_the_sessions_beside_what_was_known() -> None:
    np.testing.assert_allclose(learned(30).movement, MOVED)
    start = replace(learned(3), movement=2 * MOVED)
    np.testing.assert_allclose(learn_tolerances(nulls(10), start, rounds=1, worth=30.0).movement, 1.75 * MOVED)


def test_two_values_agree_on_nothing() -> None:
    assert not {"delay left", "delay right", "offset"} & set(learned(2).means)


def test_what_everybody_shows_is_expected_of_the_plates_but_not_of_sizes_shown() -> None:
    expected = np.arange(1.0, 7.0)
    np.testing.assert_array_equal(shown_left_out(expected, ("marker a", "shown b")), [1, 2, 3, 4, 5, 0])


def test_sides_keep_their_own_means_and_plates_share_one() -> None:
    assert mean_key("joint_centre", "left_hip", "shift_z") == "joint_centre left_hip shift_z"
    assert mean_key("plate_offset", "plate2:Fx", "offset") == "plate_offset Fx offset"
    assert mean_key("time_delay", "", "delay") == "time_delay delay"


def test_shipped_means_are_of_what_is_a_tolerance() -> None:
    known = shipped()
    assert known.mean("time_delay delay") == 0.0, "no mean is expected that is no physics"
    assert known.sizes["time_delay"] > 0.001, "it widens what is expected instead"
    for key in known.means:
        assert known.knows(key.split()[0]), key

"""Gait profile score, movement analysis profile and gait deviation index on numbers computed by hand."""

import numpy as np
import pytest
from made_cycles import cycle, level_gait

from biodance.cycles.scores import (
    SCORE_ANGLES,
    DeviationReference,
    NormalCurve,
    deviation_of,
    deviation_reference,
    deviation_toml,
    gait_scores,
)
from biodance.errors import BiodanceError

NORMAL = tuple(NormalCurve("gait", name, "deg", 12, np.zeros(101), np.ones(101)) for name in SCORE_ANGLES)


def test_the_profile_score_of_three_degrees_everywhere_is_three() -> None:
    right = level_gait(cycle(0), **dict.fromkeys(SCORE_ANGLES, 3.0))
    left = level_gait(cycle(0.5, "left"), **dict.fromkeys(SCORE_ANGLES, -3.0))
    found = gait_scores([*right, *left], NORMAL)
    assert found is not None
    assert found.gps["right"].mean == pytest.approx(3.0)
    assert found.overall == pytest.approx(3.0)
    assert (found.people, found.gdi) == (12, {})


def test_one_angle_that_is_off_is_seen_in_the_profile_and_a_third_of_it_in_the_score() -> None:
    found = gait_scores(
        [*level_gait(cycle(0), knee_flexion=12.0), *level_gait(cycle(0.5, "left"), pelvis_tilt=9.0)], NORMAL
    )
    assert found is not None
    assert found.variables["knee_flexion", "right"].mean == pytest.approx(12.0)
    assert found.variables["hip_flexion", "right"].mean == 0.0
    assert found.gps["right"].mean == pytest.approx(4.0)  # root of 144 / 9
    assert found.gps["left"].mean == pytest.approx(3.0)  # root of 81 / 9
    assert found.overall == pytest.approx(np.sqrt((144 + 81) / 15))


def test_the_pelvis_counts_once_with_the_left_cycles() -> None:
    found = gait_scores([*level_gait(cycle(0), pelvis_tilt=9.0), *level_gait(cycle(0.5, "left"))], NORMAL)
    assert found is not None
    assert found.overall == 0.0


def test_a_variable_score_is_the_root_mean_square_over_51_instants() -> None:
    walked = level_gait(cycle(0))
    value = np.zeros(101)
    value[100] = 51.0  # one of 51 instants
    value[51] = 1000.0  # between two of them
    at = SCORE_ANGLES.index("hip_flexion")
    walked[at] = type(walked[at])(walked[at].cycle, "hip_flexion", "right", "deg", value, walked[at].sd)
    found = gait_scores(walked, NORMAL)
    assert found is not None
    assert found.variables["hip_flexion", "right"].mean == pytest.approx(np.sqrt(51.0))
    assert np.isnan(found.overall)


def test_without_a_whole_reference_or_a_whole_cycle_there_is_no_score() -> None:
    assert gait_scores(level_gait(cycle(0)), NORMAL[:-1]) is None
    assert gait_scores(level_gait(cycle(0))[:-1], NORMAL) is None


def axes(*rows: tuple[float, ...]) -> np.ndarray:
    """Gait vectors that lie along the first axes."""
    return np.array([np.pad(row, (0, 459 - len(row))) for row in rows])


def test_the_deviation_index_falls_by_ten_for_each_sd_of_the_healthy_people_s_log_distance() -> None:
    """Two features; healthy legs lie e, e and e^3, e^3 from their mean: ln is 1, 1, 3, 3, mean 2, sd 1.1547."""
    e = float(np.e)
    healthy = axes((100 + e, 0), (100 - e, 0), (100, e**3), (100, -(e**3)))
    reference = deviation_reference(healthy, healthy, features=2)
    assert reference.mean == pytest.approx(2.0)
    assert reference.sd == pytest.approx(1.154701)
    (far,) = axes((100 + e**4.309401, 0))
    assert reference.index(far) == pytest.approx(80.0, abs=1e-4)
    (beside,) = axes((100 + e**2, 0, 777.0))  # what no feature sees does not count
    assert reference.index(beside) == pytest.approx(100.0)


def test_the_index_of_a_walk_is_told_by_side() -> None:
    basis = np.zeros((1, 459))
    basis[0, 51 * SCORE_ANGLES.index("knee_flexion")] = 1.0  # the knee at strike
    reference = DeviationReference(basis, np.array([5.0]), 1.0, 0.5)
    found = gait_scores(level_gait(cycle(0), knee_flexion=5.0 + np.e**2), NORMAL, reference)
    assert found is not None
    assert found.gdi["right"].mean == pytest.approx(80.0)


def test_a_reference_comes_back_from_the_file() -> None:
    import tomllib

    made = deviation_reference(axes((1.0, 2.0), (3.0, -1.0), (0.5, 7.0)), axes((1.0, 2.0), (3.0, 1.0)), features=2)
    text = "\n".join(deviation_toml(made))
    assert max(map(len, text.splitlines())) <= 120
    back = deviation_of(tomllib.loads(text)["gait_deviation_index"])
    assert back is not None
    (somebody,) = axes((2.0, 2.5))
    assert back.index(somebody) == pytest.approx(made.index(somebody), rel=1e-4)


def test_too_few_strides_are_refused_with_their_number() -> None:
    with pytest.raises(BiodanceError, match="at least 15 strides"):
        deviation_reference(axes((1.0,), (2.0,)), axes((1.0,), (2.0,)))

"""Postures in order: weight is shifted before a foot is lifted, near postures follow each other."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import feet_in_move, stance
from biodance.dance.search.optimised_course import nearest_neighbours
from biodance.errors import BiodanceError
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
BLOCKS = ("parallel", "right_forward", "single_right", "single_left")


@pytest.mark.parametrize("names", list(permutations(BLOCKS)), ids="-".join)
def test_no_foot_moves_unless_the_other_bears_the_weight(names):
    stances = support_sequence(BODY, Plan("any", "", tuple((name, 2) for name in names)))
    assert [s.name for s in stances if s.over is None] == [name for name in names for _ in range(2)]
    assert stances[-1].planted == (0, 1)
    for before, after in pairwise(stances):
        bearing = feet_in_move(before, after).planted
        for one in (before, after):
            assert set(bearing) <= set(one.planted)
            if len(bearing) == 1 and len(one.planted) == 2:
                assert one.over == bearing[0]
        for side in bearing:
            np.testing.assert_array_equal(before.ankle[side], after.ankle[side])


def test_who_may_not_stand_on_the_left_leg_never_steps():
    stances = support_sequence(BODY, Plan("careful", "", (("parallel", 2), ("right_forward", 3)), alone=()))
    assert [(s.name, s.over) for s in stances] == [("parallel", None)] * 5


def test_sitting_and_standing_do_not_mix():
    with pytest.raises(BiodanceError, match="stool"):
        support_sequence(BODY, Plan("both", "", (("parallel", 2), ("seated", 3))))


def test_weight_over_one_foot_is_inside_both_bases():
    feet = support_sequence(BODY, Plan("one", "", (("parallel", 1), ("single_left", 1))))[1]
    normals, offsets = feet.reduced(0.6)
    assert (normals @ feet.centre + offsets).min() > 0
    for base in (feet.on(0, 1), feet.on(1)):
        inner, offset = base.reduced(0.6)
        assert (inner @ feet.centre + offset).min() > 0


def test_the_order_is_shorter_than_any_single_exchange():
    x = np.random.default_rng(0).normal(size=(9, 29))
    order = nearest_neighbours(x, [[0, 1, 2, 3], [4, 5, 6, 7, 8]])
    assert sorted(order[:4]) == [0, 1, 2, 3]
    assert sorted(order) == list(range(9))
    line = np.zeros((6, 29))
    line[:, 10] = [0.3, 0.1, 0.5, 0.0, 0.4, 0.2]
    assert list(np.diff(line[nearest_neighbours(line, [list(range(6))]), 10])) == pytest.approx([0.1] * 5) or list(
        np.diff(line[nearest_neighbours(line, [list(range(6))]), 10])
    ) == pytest.approx([-0.1] * 5)


def test_the_support_of_both_feet_is_wider_than_of_one():
    feet = stance(BODY, "parallel")
    assert np.ptp(feet.support[:, 1]) > 2 * np.ptp(feet.on(0).support[:, 1])

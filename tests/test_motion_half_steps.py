"""Steps partly beside plates of unknown place, told by what the plates lack (`biodance.motion.half_steps`)."""

import numpy as np
import pytest

from biodance.motion.contact import Contact
from biodance.motion.half_steps import FeetDown, half_steps, told_of, without
from biodance.records import LeftOut, LeftOutSpan

RIGHT, LEFT, BOTH = (np.array(feet) for feet in ([True, False], [False, True], [True, True]))


def walk() -> Contact:
    """A left foot down from 0.0 to 0.6 s, a right one from 0.5 to 1.1 s, all measured but the last frame."""
    time = np.arange(12) / 10
    touching = np.column_stack([(time >= 0.45) & (time < 1.15), time < 0.65])
    measured = time < 1.05
    return Contact(
        time, touching, touching[:, :, None], measured, np.zeros((12, 1)), ("11 of 12", "more"), touching,
        {LeftOut.FOOT_BESIDE: ~measured},
    )  # fmt: skip


@pytest.mark.parametrize("heavier", [0.0, 0.1])
def test_a_step_that_lacks_more_is_half_beside_whatever_the_mass(heavier: float) -> None:
    lacks = (0.02, 0.015, 0.1, 0.5)
    one, two, three, four = (
        FeetDown(10 * k, 10 * k + 5, RIGHT, ("plate1",), lack + heavier) for k, lack in enumerate(lacks)
    )
    assert half_steps([(one, two), (three,), (), (four,)]) == ((), (three,), (), (four,))


def test_a_plate_that_reads_too_much_accuses_no_other_step() -> None:
    usual, heavy = (FeetDown(0, 5, LEFT, (name,), lacks) for name, lacks in (("plate1", 0.02), ("plate2", -0.3)))
    assert half_steps([(usual, heavy)]) == ((),)
    assert half_steps([()]) == ((),)


def test_a_plate_that_lacks_in_all_its_steps_accuses_no_foot() -> None:
    whole, weak = FeetDown(0, 5, LEFT, ("plate1",), 0.02), FeetDown(10, 15, RIGHT, ("plate2",), 0.3)
    assert half_steps([(whole, weak), (weak,)]) == ((), ())
    # Who stands still tells nothing of one plate alone.
    standing = FeetDown(0, 50, BOTH, ("plate1", "plate2"), 0.13)
    assert half_steps([(whole,), (standing,)]) == ((), (standing,))


def test_all_that_a_foot_half_beside_is_down_is_not_measured() -> None:
    whole = walk()
    half = without(whole, (FeetDown(7, 10, RIGHT, ("plate1",), 0.32),))
    assert half.half == (LeftOutSpan(0.5, 1.1, "right"),)
    assert half.measured.tolist() == [True] * 5 + [False] * 7
    assert not half.told[:, 0].any()
    assert half.told[:, 1].tolist() == whole.told[:, 1].tolist()
    # What was left out before stays out.
    assert half.left_out[LeftOut.FOOT_BESIDE].tolist() == [False] * 5 + [True] * 7
    assert half.notes[0].startswith("5 of 12")
    assert half.notes[1].startswith("Left out, 7 of 12: a foot may stand partly beside")
    assert half.notes[2:] == ("more",)
    assert whole.half == ()


def test_who_stands_half_beside_is_told_of_both_feet() -> None:
    assert told_of((FeetDown(0, 9, BOTH, ("plate1", "plate2"), 0.125),)).startswith("both feet may stand partly beside")
    assert told_of(
        tuple(FeetDown(9 * k, 9 * k + 9, LEFT, ("plate1",), lacks) for k, lacks in enumerate((0.125, 0.07)))
    ).endswith("12 % of the weight")

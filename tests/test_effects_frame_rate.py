"""Rate of the cameras and lost frames: told where the clock is wrong, and not where a load or a hand adds force."""

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import failed, session_of
from human_cases import human_case

from biodance.effects import discrete_effects
from biodance.effects.frame_rate import FrameRate, clock_beside_body, late
from biodance.records import Array, Motion, Wrench


def part(step: float, push: float = 0.0) -> tuple[Array, Array, float]:
    """Return a trial of 10 s whose forces come ``step`` seconds later from the middle on, and in which something pushes
    the body by ``push`` N for a tenth of a second while its force falls.
    """
    time = np.arange(0, 10, 0.01)
    needed, late = (20 * np.sin(2 * np.pi * 0.5 * (time - by))[:, None] for by in (0.0, np.where(time < 5, 0, step)))
    pushed = np.where(abs(time - 7) < 0.05, push, 0.0)[:, None]
    return (late + pushed) * np.ones(3), needed * np.ones(3), 100.0


def test_frames_that_are_lost_are_not_found_again() -> None:
    """Forces 30 ms later from the middle on in all trials, or in two of three and 30 ms earlier in the third."""
    assert failed(FrameRate._lost([part(0.03)] * 3)) == [("frame_rate", "")]
    assert FrameRate._lost([part(0.03), part(0.03), part(-0.03)]) == ()


def test_a_hand_that_pushes_loses_no_frames() -> None:
    """Pushes of 60 N move the delay of the second half by more than two frames, and leave themselves."""
    pushed = part(0.0, push=60.0)
    measured, needed, rate = (pushed[0][500:], pushed[1][500:], pushed[2])
    assert late(measured, needed, rate) > 0.018
    assert failed(FrameRate._lost([pushed, pushed])) == []
    assert failed(FrameRate._lost([part(0.03, push=60.0)] * 2)) == [("frame_rate", "")]


@pytest.mark.parametrize("ratio", [0.8, 1.2, 2.0])
def test_a_wrong_rate_is_named(ratio: float) -> None:
    """Forces of the true motion, read with a motion whose time runs too fast or slowly."""
    case = human_case(600)
    motion = Motion(case.motion.time / ratio, case.motion.q, ratio * case.motion.v, ratio**2 * case.motion.a)
    plate = case.trial.plates[0]
    plate = replace(plate, wrench=Wrench(motion.time, plate.wrench.value))
    wrong = replace(case, motion=motion, trial=replace(case.trial, plates=(plate,)))
    found = discrete_effects()["frame_rate"].check(session_of(wrong, wrong))
    assert ("frame_rate", "") in failed(found)
    assert found[0].size == pytest.approx(ratio, rel=0.05)


@pytest.mark.parametrize(("segment", "kilograms"), [("left_forearm_hand", 4.0), ("trunk_head", 10.0)])
def test_a_load_is_no_clock(segment: str, kilograms: float) -> None:
    """The same movement with a load needs more force, but also more weight where it hangs."""
    case = human_case(600)
    phi, start = np.array(case.phi), 10 * case.body.segments.index(segment)
    place = np.array([0.0, -0.2, 0.05])
    phi[start] += kilograms
    phi[start + 1 : start + 4] += kilograms * place
    value = case.trial.plates[0].wrench.value + case.needed(phi - case.phi)
    plate = replace(case.trial.plates[0], wrench=Wrench(case.motion.time, value))
    loaded = replace(case, trial=replace(case.trial, plates=(plate,)))
    ratio, explained = clock_beside_body([loaded])
    assert ratio == pytest.approx(1.0, abs=0.03)
    assert explained > 0.9
    assert failed(discrete_effects()["frame_rate"].check(session_of(loaded, loaded))) == []


def test_a_rate_that_one_trial_alone_asks_for_is_no_rate() -> None:
    """The cameras have one rate: beside a trial whose forces fit, another one's accelerations are something else."""
    case = human_case(600)
    motion = Motion(case.motion.time / 2, case.motion.q, 2 * case.motion.v, 4 * case.motion.a)
    plate = replace(case.trial.plates[0], wrench=Wrench(motion.time, case.trial.plates[0].wrench.value))
    wrong = replace(case, motion=motion, trial=replace(case.trial, plates=(plate,)))
    assert failed(FrameRate._rate([wrong, wrong])) == [("frame_rate", "")]
    assert failed(FrameRate._rate([wrong] * 16 + [case])) == []  # of which all together ask for twice the rate


def test_lost_frames_are_named() -> None:
    case = human_case(600)
    plate, lost = case.trial.plates[0], 6
    value = np.array(plate.wrench.value)
    value[300:] = value[300 - lost : -lost]
    late = replace(case, trial=replace(case.trial, plates=(replace(plate, wrench=Wrench(plate.wrench.time, value)),)))
    found = discrete_effects()["frame_rate"].check(session_of(late, late))
    assert failed(found) == [("frame_rate", "")]
    assert found[-1].size == pytest.approx(0.01 * lost, rel=0.3)

"""All good repetitions of a session together: which count, their means, sides beside each other, and the ground."""

from dataclasses import replace

import numpy as np
import pytest
from made_cycles import curve, cycle, trial

from biodance.body.human.human import human
from biodance.cycles.curves import CycleCurve, ground_curves
from biodance.cycles.cut import Cycle
from biodance.cycles.strides import Stride
from biodance.cycles.summary import LeftOutBecause, key_values, repetitions_of, symmetry_index
from biodance.motion.soles import soles_from_body
from biodance.records import Motion, Subject, Wrench

SHAPE = np.sin(np.linspace(0, np.pi, 101))


def test_the_mean_is_over_all_trials_and_the_first_is_not_privileged() -> None:
    first = trial("one", [curve(cycle(0, trial="one"), 50.0)])
    second = trial("two", [curve(cycle(k, trial="two"), value) for k, value in enumerate((60.0, 61.0, 69.0))])
    found = repetitions_of("gait", [first, second])
    (group,) = found.groups
    assert group.mean == pytest.approx(60.0)  # (50 + 60 + 61 + 69) / 4
    assert group.sd == pytest.approx(7.78888)  # root of (100 + 0 + 1 + 81) / 3
    assert found.trials == ("one", "two")
    off = found.off("right")
    assert off is not None
    assert (off.mean, off.count) == (pytest.approx(60.0), 4)


def test_a_spike_leaves_out_its_own_curve_and_no_other() -> None:
    rng = np.random.default_rng(1)
    curves = []
    for k in range(6):
        bent = 60 * SHAPE + rng.normal(0, 1, 101)
        bent[40:44] += 80.0 * (k == 3)
        curves += [curve(cycle(k), bent), curve(cycle(k), 20 * SHAPE, "hip_flexion")]
    found = repetitions_of("gait", [trial("walk", curves)])
    (out,) = found.left_out
    assert (out.because, out.quantity, out.cycle) == (LeftOutBecause.SPIKE, "knee_flexion", cycle(3))
    assert {one.quantity: len(one.values) for one in found.groups} == {"knee_flexion": 5, "hip_flexion": 6}
    assert len(found.good) == 6


def test_cycles_that_scatter_widely_are_no_spikes() -> None:
    curves = [curve(cycle(k), size * SHAPE) for k, size in enumerate((30.0, 40.0, 50.0, 60.0, 70.0))]
    assert repetitions_of("gait", [trial("walk", curves)]).left_out == ()


def test_deeper_and_offset_repetitions_are_no_spikes_and_a_spike_in_one_of_them_is() -> None:
    alike = [curve(cycle(k), (60.0 + k) * SHAPE) for k in range(8)]
    assert repetitions_of("gait", [trial("walk", [*alike, curve(cycle(9), 110.0 * SHAPE - 8.0)])]).left_out == ()
    spoilt = 110.0 * SHAPE - 8.0
    spoilt[40:44] += 60.0
    (out,) = repetitions_of("gait", [trial("walk", [*alike, curve(cycle(9), spoilt)])]).left_out
    assert (out.because, out.cycle) == (LeftOutBecause.SPIKE, cycle(9))


def test_a_turn_leaves_out_the_whole_cycle_also_over_the_seam() -> None:
    straight = curve(cycle(0), 5 * np.sin(np.linspace(0, 2 * np.pi, 101)), "pelvis_rotation")
    turning = curve(cycle(1), np.linspace(-3, 40, 101), "pelvis_rotation")
    seam = curve(cycle(2), np.where(np.arange(101) < 50, 179.0, -178.0), "pelvis_rotation")  # 3 deg on
    found = repetitions_of("gait", [trial("walk", [straight, turning, seam])])
    assert [(one.because, one.cycle) for one in found.left_out] == [(LeftOutBecause.TURN, cycle(1))]
    assert len(found.good) == len(found.strides) == 2


def test_trials_of_different_speeds_are_told() -> None:
    slow, fast = ([curve(cycle(k, trial=name), SHAPE) for k in range(2)] for name in ("slow", "fast"))
    walked = [
        trial("slow", slow),
        replace(trial("fast", fast), strides=(Stride(cycle(0, trial="fast"), {"speed": 1.6}),)),
    ]
    assert repetitions_of("gait", walked).speeds == (1.2, 1.6)
    assert repetitions_of("gait", walked[:1]).speeds is None


def test_only_strides_with_a_flight_are_running() -> None:
    """A jump has a flight, too."""
    flies = trial("drop", [curve(cycle(0), 1.0)])
    flies = replace(flies, strides=tuple(Stride(one, {"flight_time": 0.1}) for one in flies.cycles))
    assert repetitions_of("gait", [flies]).runs
    jump = replace(flies.cycles[0], kind="jump", side="both")
    jumped = replace(flies, cycles=(jump,), curves=(), strides=(), lifts=(Stride(jump, {"flight_time": 0.4}),))
    assert not repetitions_of("jump", [jumped]).runs


def test_a_shared_plate_is_flagged() -> None:
    found = repetitions_of("gait", [trial("walk", [curve(cycle(0), SHAPE)], shared=(cycle(0),))])
    (out,) = found.left_out
    assert (out.because, out.quantity) == (LeftOutBecause.SHARED_PLATE, "loads")
    assert found.good == (cycle(0),)


def test_sides_stand_beside_each_other_with_the_interval_of_their_difference() -> None:
    right = [curve(cycle(k), value * SHAPE) for k, value in enumerate((60.0, 62.0, 64.0))]
    left = [curve(cycle(k + 0.5, "left"), value * SHAPE) for k, value in enumerate((50.0, 52.0, 54.0))]
    found = repetitions_of("gait", [trial("walk", [*right, *left])])
    keys = {one.key: one for one in found.keys}
    assert keys["maximum"].right is not None
    assert (keys["maximum"].right.mean, keys["maximum"].right.sd) == pytest.approx((62.0, 2.0))
    assert keys["maximum"].difference == pytest.approx(10.0)
    assert keys["maximum"].ci95 is not None
    half = 2.7764 * np.sqrt(4 / 3 + 4 / 3)  # Student's t of 4 degrees of freedom
    assert keys["maximum"].ci95 == pytest.approx((10 - half, 10 + half), abs=1e-3)
    assert keys["range"].symmetry == pytest.approx(100 * 10 / 57)
    assert np.isnan(keys["maximum"].symmetry)  # the zero of an angle is no amount


def stance_of(*at: tuple[float, float]) -> np.ndarray:
    """A curve through points (% of the cycle, value), zero in the swing from 60 %."""
    return np.interp(np.arange(101), [0.0, *(x for x, _ in at), 60.0, 100.0], [0.0, *(y for _, y in at), 0.0, 0.0])


def test_peaks_of_the_ground_reaction_of_both_sides() -> None:
    up = {"right": stance_of((12, 110), (30, 75), (45, 120)), "left": stance_of((12, 100), (30, 80), (45, 115))}
    forward = {"right": stance_of((10, -18), (30, 0), (50, 24)), "left": stance_of((10, -12), (30, 0), (50, 24))}
    curves = [
        curve(cycle(k, side), values[side], f"ground_reaction_{name}", "%")
        for k in range(3)
        for side in ("right", "left")
        for name, values in (("up", up), ("forward", forward))
    ]
    keys = {key.name: key for key in repetitions_of("gait", [trial("walk", curves)]).keys}
    told = {name.removeprefix("ground_reaction_"): (key.right.mean, key.left.mean) for name, key in keys.items()}
    assert told == {
        "up_first_peak": (110.0, 100.0),
        "up_valley": (75.0, 80.0),
        "up_second_peak": (120.0, 115.0),
        "forward_braking_peak": (-18.0, -12.0),
        "forward_pushing_peak": (24.0, 24.0),
    }
    assert keys["ground_reaction_up_first_peak"].difference == pytest.approx(10.0)
    assert keys["ground_reaction_up_first_peak"].symmetry == pytest.approx(200 * 10 / 210)
    assert keys["ground_reaction_forward_braking_peak"].symmetry == pytest.approx(40.0)  # right brakes harder


def test_one_hump_has_one_maximum_and_a_stance_with_a_hole_no_peak() -> None:
    one_hump = curve(cycle(0), stance_of((25, 240)), "ground_reaction_up", "%")
    assert [(one.key, one.value) for one in key_values([one_hump])] == [("maximum", 240.0)]
    for hole, count in ((40, 0), (80, 1)):
        value = one_hump.value.copy()
        value[hole] = np.nan
        assert len(key_values([curve(cycle(0), value, "ground_reaction_up", "%")])) == count


def test_what_both_sides_share_stands_in_the_middle() -> None:
    one = Cycle("squats", "squat", "both", 0.0, 2.0, 1.0)
    bent = CycleCurve(one, "trunk_flexion", "middle", "deg", 30.0 * SHAPE, np.full(101, np.nan))
    keys = {key.key: key for key in repetitions_of("squat", [trial("squats", [bent])]).keys}
    assert keys["maximum"].middle is not None
    assert keys["maximum"].middle.mean == pytest.approx(30.0)
    assert keys["maximum"].right is None


def test_symmetry_means_nothing_where_the_sides_differ_in_sign() -> None:
    assert symmetry_index(3.0, 1.0) == pytest.approx(100.0)
    assert np.isnan(symmetry_index(1.0, -1.0))
    assert np.isnan(symmetry_index(0.0, 0.0))


BODY = human(Subject(62.0, 1.70, "F", 30.0, "S01"))


@pytest.mark.parametrize(("side", "inwards"), [("right", 1.0), ("left", -1.0)])
def test_the_ground_s_force_has_the_direction_of_walking_and_presses_where_it_was_put(
    side: str, inwards: float
) -> None:
    """The body moves along lab x; left is y. 300 N forwards, 31 N to the left, 620 N up, 50 mm ahead of the heel."""
    time = np.linspace(0, 1, 101)
    q = np.tile(BODY.neutral, (101, 1))
    q[:, 0] += 1.2 * time
    motion = Motion(time, q, *np.zeros((2, 101, BODY.nv)), joint_names=tuple(one.name for one in BODY.joints))
    soles = soles_from_body(BODY, motion)
    foot = ("right", "left").index(side)
    sole = soles.outline[:, foot]
    ahead, aside = sole[..., 0].min(axis=1) + 0.05, sole[..., 1].mean(axis=1)
    force, place = np.tile([300.0, 31.0, 620.0], (101, 1)), np.stack([ahead, aside, sole[..., 2].min(axis=1)], axis=1)
    wrench = Wrench(time, np.concatenate([force, np.cross(place, force)], axis=1))
    feet = {f"{one}_foot": wrench for one in ("right", "left")}
    walked = Cycle("walk", "gait", side, 0.0, 1.0, 0.6)
    known = np.ones((101, 2), dtype=bool)
    known[:20] = False
    found = {one.quantity: one for one in ground_curves(walked, BODY, motion, soles, feet, known)}
    weight = 62.0 * 9.80665
    assert np.isnan(found["ground_reaction_up"].value[:20]).all()
    assert found["ground_reaction_up"].value[30] == pytest.approx(100 * 620 / weight)
    assert found["ground_reaction_forward"].value[30] == pytest.approx(100 * 300 / weight)
    assert found["ground_reaction_inward"].value[30] == pytest.approx(100 * 31 / weight * inwards)
    assert found["ground_reaction_up"].value[80] == 0.0
    assert found["pressure_ahead"].value[30] == pytest.approx(0.05, abs=0.01)
    assert abs(found["pressure_outward"].value[30]) < 0.02

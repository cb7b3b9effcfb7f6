"""Cycles and curves on movements whose events, lengths and angles are set by hand."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from squatting import BODY as SQUATTER
from squatting import squat

from biodance.body.human.human import human
from biodance.cycles import compare_angles, compare_events, trial_movement
from biodance.cycles.curves import CycleCurve, angle_curves, group_curves, lab_curves, load_curves
from biodance.cycles.cut import Cycle, agreement_of_events, gait_cycles, joined_events, kinematic_events, repetitions
from biodance.cycles.scores import normal_curves, normal_of, normal_toml
from biodance.cycles.strides import mean_values, strides, vertical_stiffness
from biodance.lab.c3d.subject import FileOutputs
from biodance.motion.dynamics import joint_torques
from biodance.motion.kinematics import centre_of_mass, poses
from biodance.motion.soles import soles_from_body
from biodance.pipeline.trial import movement_of
from biodance.records import FootEvent, Motion, Subject, Wrench

BODY = human(Subject(62.0, 1.70, "F", 30.0, "S01"))
RATE = 100.0
STRIDE, STANCE, SPEED = 1.1, 0.66, 1.2
"""s, s, m/s of the walk made by hand."""


def motion_of(time, columns, root):
    """A motion with the named angles (rad), the others zero; root (T, 3) m, upright, facing lab x."""
    q = np.tile(BODY.neutral, (time.size, 1))
    q[:, :3] = root
    for name, angle in columns.items():
        q[:, 7 + BODY.joint_index(name)] = angle
    v, a = np.zeros((2, time.size, BODY.nv))
    v[:, 6:] = np.gradient(q[:, 7:], time, axis=0)
    v[:, :3] = np.gradient(q[:, :3], time, axis=0) @ BODY_FROM_LAB
    return Motion(time, q, v, a, joint_names=tuple(joint.name for joint in BODY.joints))


BODY_FROM_LAB = Rotation.from_quat(BODY.neutral[3:7]).as_matrix()


def flat_foot(side, ahead, up=0.0):
    """The angles of a leg whose foot is flat, ``ahead`` m of the hip and ``up`` m over the ground: law of cosines."""
    ends = ("knee_flexion", "ankle_dorsiflexion")
    thigh, shank = (np.linalg.norm(BODY.joints[BODY.joint_index(f"{side}_{end}")].translation) for end in ends)
    down = 0.85 * (thigh + shank) - up
    reach = np.hypot(ahead, down)
    knee = np.pi - np.arccos((thigh**2 + shank**2 - reach**2) / (2 * thigh * shank))
    hip = np.arctan2(ahead, down) + np.arcsin(shank * np.sin(knee) / reach)
    return {f"{side}_hip_flexion": hip, f"{side}_knee_flexion": knee, f"{side}_ankle_dorsiflexion": knee - hip}


def walk(*, speed=SPEED, belt=0.0, turned=0.0):
    """Flat feet that go with the ground from strike to leaving: time, motion, true strikes."""
    time = np.arange(0, 5, 1 / RATE)
    columns, strikes = {}, {}
    for side, first in (("right", 0.2), ("left", 0.2 + STRIDE / 2)):
        phase = (time - first) % STRIDE
        half = speed * STANCE / 2
        swing = (phase - STANCE) / (STRIDE - STANCE)
        place = np.where(phase < STANCE, half - speed * phase, -half + 2 * half * (3 * swing**2 - 2 * swing**3))
        columns |= flat_foot(side, place)
        strikes[side] = np.arange(first, 5, STRIDE)
    root = np.stack([(speed - belt) * time, 0 * time, 0.9 + 0 * time], axis=1)
    moved = motion_of(time, columns, root)
    if turned:
        turn = Rotation.from_euler("z", turned)
        q = moved.q.copy()
        q[:, :3], q[:, 3:7] = turn.apply(q[:, :3]), (turn * Rotation.from_quat(q[:, 3:7])).as_quat()
        moved = replace(moved, q=q)
    return moved, strikes


def test_what_tells_a_strike_early_or_late_lengthens_no_step():
    """Some strikes are told by plates and some by markers, 60 ms apart, while the heel slides on to its place."""
    moved, _ = walk()
    events = kinematic_events(BODY, moved)
    soles, centre = soles_from_body(BODY, moved), centre_of_mass(BODY, moved)
    early = tuple(replace(e, time=e.time - 0.06) if e.down and e.side == "left" else e for e in events)
    for side in ("right", "left"):
        plain, other = (
            mean_values(strides(gait_cycles("walk", e), e, BODY, soles, centre), side)["step_length"][0]
            for e in (events, early)
        )
        assert other == pytest.approx(plain, abs=0.006), side


@pytest.mark.parametrize("kind", [{}, {"belt": SPEED}, {"turned": 2.0}])
def test_strikes_and_leavings_are_found_where_the_feet_take_the_ground_s_speed(kind):
    moved, strikes = walk(**kind)
    found = kinematic_events(BODY, moved)
    for side, true in strikes.items():
        for down, shift in ((True, 0.0), (False, STANCE)):
            ours = np.array([e.time for e in found if e.side == side and e.down is down])
            inside = [t for t in true + shift if 0.3 < t < 4.7]
            assert len(inside) >= 3
            for t in inside:
                assert np.abs(ours - t).min() < 0.025


def test_a_runner_s_toes_leave_where_they_rise_though_they_go_back_with_the_ground_still():
    """After 0.25 s on the ground the foot rises with 0.9 m/s, but goes back at 2.4 m/s for 0.08 s more."""
    time, contact, late, stride, speed = np.arange(0, 4, 1 / RATE), 0.25, 0.08, 0.7, 2.4
    columns, offs = {}, {}
    for side, first in (("right", 0.1), ("left", 0.1 + stride / 2)):
        phase, back = (time - first) % stride, contact + late
        swing = np.clip((phase - back) / (stride - back), 0, 1)
        half = speed * back / 2
        ahead = np.where(phase < back, half - speed * phase, -half + 2 * half * (3 * swing**2 - 2 * swing**3))
        up = np.where(phase < back, 0.9 * np.maximum(phase - contact, 0), 0.9 * late * (1 - swing))
        columns |= flat_foot(side, ahead, up)
        offs[side] = np.arange(first, 4, stride) + contact
    moved = motion_of(time, columns, np.stack([speed * time, 0 * time, 0.9 + 0 * time], axis=1))
    found = kinematic_events(BODY, moved)
    for side, true in offs.items():
        ours = np.array([e.time for e in found if e.side == side and not e.down])
        inside = [t for t in true if 0.5 < t < 3.5]
        assert len(inside) >= 4
        for t in inside:
            # 2 cm at 0.9 m/s take 0.022 s.
            assert np.abs(ours - t).min() < 0.03


def test_strides_have_the_speed_length_cadence_and_width_that_were_walked():
    moved, _ = walk()
    events = kinematic_events(BODY, moved)
    cycles, soles = gait_cycles("walk", events), soles_from_body(BODY, moved)
    centre = centre_of_mass(BODY, moved)
    found = mean_values(strides(cycles, events, BODY, soles, centre))
    hips = 2 * BODY.joints[BODY.joint_index("right_hip_flexion")].translation[2]
    expected = {
        "cadence": (120 / STRIDE, 1.0),
        "speed": (SPEED, 0.02),
        "stride_length": (SPEED * STRIDE, 0.02),
        "step_length": (SPEED * STRIDE / 2, 0.03),
        "step_width": (hips, 0.003),
        "stance": (100 * STANCE / STRIDE, 3.5),
        "double_support": (100 * (2 * STANCE / STRIDE - 1), 7.0),
    }
    for name, (value, within) in expected.items():
        assert found[name][0] == pytest.approx(value, abs=within), name


@pytest.mark.parametrize("belt", [0.0, SPEED])
def test_the_margin_of_stability_is_what_the_sole_reaches_beyond_the_extrapolated_centre_of_mass(belt):
    """The centre of mass goes straight ahead, on a belt too, so that nothing is added to it sideways."""
    moved, _ = walk(belt=belt)
    events, soles, centre = kinematic_events(BODY, moved), soles_from_body(BODY, moved), centre_of_mass(BODY, moved)
    cycles = gait_cycles("walk", events)
    found = strides(cycles, events, BODY, soles, centre)
    for one in found[1:-1]:
        foot = 0 if one.cycle.side == "right" else 1
        outer = np.abs(soles.outline[150, foot, :, 1]).max()
        assert one.values["margin_aside"] == pytest.approx(outer, abs=0.015)
        frame = round(one.cycle.start * RATE)
        tip, height = soles.outline[frame, foot, :, 0].max(), centre[frame, 2]
        speed = (centre[frame + 2, 0] - centre[frame - 2, 0]) / (4 / RATE) + belt
        beyond = centre[frame, 0] + speed * np.sqrt(height / 9.81)
        assert one.values["margin_ahead"] == pytest.approx(tip - beyond, abs=0.03)


def test_the_vertical_stiffness_of_a_runner_is_the_one_computed_by_hand():
    """60 kg, 0.25 s on the ground, 0.10 s in the air: 1293.96 N over 59.95 mm."""
    assert vertical_stiffness(60.0, 0.25, 0.10) == pytest.approx(21582, rel=1e-3)


def test_contact_and_flight_are_told_where_the_other_foot_strikes_after_this_one_has_left():
    moved, _ = walk()
    soles, centre = soles_from_body(BODY, moved), centre_of_mass(BODY, moved)
    steps = [(1.0, "right", True), (1.25, "right", False), (1.35, "left", True), (1.6, "left", False)]
    events = tuple(FootEvent(*one) for one in (*steps, (1.7, "right", True)))
    (one,) = strides(gait_cycles("run", events), events, BODY, soles, centre)
    assert (one.values["contact_time"], one.values["flight_time"]) == pytest.approx((0.25, 0.10))
    expected = vertical_stiffness(float(BODY.sip.mass.sum()), 0.25, 0.10) / 1000
    assert one.values["vertical_stiffness"] == pytest.approx(expected)
    assert "double_support" not in one.values


def test_double_support_is_not_told_where_a_foot_s_own_lift_is_unknown():
    moved, _ = walk()
    soles, centre = soles_from_body(BODY, moved), centre_of_mass(BODY, moved)
    steps = [(1.0, "right", True), (1.1, "left", False), (1.5, "left", True), (1.6, "right", False)]
    for known in (True, False):
        events = tuple(FootEvent(*one) for one in (*(steps if known else steps[:-1]), (2.0, "right", True)))
        cycles = [one for one in gait_cycles("walk", events) if one.side == "right"]
        (one,) = strides(tuple(cycles), events, BODY, soles, centre)
        assert np.isfinite(one.cycle.off) == known
        assert one.values.get("double_support") == (pytest.approx(20.0) if known else None)


def test_who_walks_slowly_has_cycles_and_who_stands_between_two_steps_has_none():
    def found(*times):
        sides = itertools.cycle(("left", "right"))
        return [one.duration for one in gait_cycles("t", tuple(FootEvent(t, next(sides), True) for t in times))]

    assert found(0.0, 1.3, 2.6, 3.9) == pytest.approx([2.6, 2.6])  # 0.2 m/s
    assert found(0.0, 2.1, 4.2) == []
    # Steps of 0.6 s; before the last two somebody stands for a second and a half: each foot has one such cycle.
    assert found(0.0, 0.6, 1.2, 1.8, 2.4, 4.5, 5.1) == pytest.approx([1.2, 1.2, 1.2])


def test_on_a_treadmill_the_belt_s_way_is_walked():
    moved, _ = walk(belt=SPEED)
    events = kinematic_events(BODY, moved)
    found = mean_values(
        strides(gait_cycles("walk", events), events, BODY, soles_from_body(BODY, moved), centre_of_mass(BODY, moved))
    )
    assert found["speed"][0] == pytest.approx(SPEED, abs=0.05)


def test_who_stands_makes_no_step_and_a_lone_swing_is_no_cycle():
    time = np.arange(0, 3, 1 / RATE)
    still = motion_of(time, {}, np.tile([0, 0, 0.9], (time.size, 1)))
    assert kinematic_events(BODY, still) == ()
    same = tuple(FootEvent(t, "right", True) for t in (0.5, 1.5))
    assert gait_cycles("swing", same) == ()
    assert len(gait_cycles("walk", (*same, FootEvent(1.0, "left", True)))) == 1


def test_a_plate_s_event_comes_before_the_markers_and_how_late_they_are_is_said():
    force = (FootEvent(1.0, "right", True),)
    markers = (FootEvent(1.02, "right", True, "markers"), FootEvent(1.6, "right", False, "markers"))
    assert [e.source for e in joined_events(force, markers)] == ["force", "markers"]
    strikes, leavings = agreement_of_events(force, markers)
    assert strikes == pytest.approx([0.02])
    assert leavings.size == 0


def bent(time, hip, knee, lean=0.0):
    """Knees and hips bent with the feet where they were: the root follows."""
    columns = {
        f"{side}_{name}": angle
        for side in ("right", "left")
        for name, angle in (("hip_flexion", hip), ("knee_flexion", knee), ("ankle_dorsiflexion", knee - hip))
    }
    moved = motion_of(time, columns | {"trunk_flexion": lean + 0 * time}, np.zeros((time.size, 3)))
    foot = poses(BODY, moved.q).position[:, BODY.segment_index("right_foot")]
    q = moved.q.copy()
    q[:, :3] = foot[:1] * [1, 1, 0] - foot + [0, 0, 0.08] + [0.0, 0.0, 0.0]
    return replace(moved, q=q)


def test_of_two_leavings_the_one_that_a_plate_saw_is_believed():
    strikes = (FootEvent(0.0, "right", True), FootEvent(0.5, "left", True), FootEvent(1.0, "right", True))
    offs = (FootEvent(0.62, "right", False), FootEvent(0.75, "right", False, "markers"))
    (one,) = gait_cycles("walk", (*strikes, *offs))
    assert one.off == 0.62
    (unsure,) = gait_cycles("walk", (*strikes, *offs[1:], FootEvent(0.6, "right", False, "markers")))
    assert np.isnan(unsure.off)


def test_squats_are_counted_from_standing_to_standing():
    time = np.arange(0, 9, 1 / RATE)
    depth = np.where((time > 1) & (time < 7), 0.5 - 0.5 * np.cos(np.pi * (time - 1)), 0.0)
    moved = bent(time, np.radians(62) * depth, np.radians(95) * depth, lean=np.radians(45) * depth)
    found = repetitions("squat", BODY, moved, soles_from_body(BODY, moved))
    assert [one.kind for one in found] == ["squat"] * 3
    assert [one.off for one in found] == pytest.approx([2.0, 4.0, 6.0], abs=0.02)
    assert all(1.0 < one.duration < 2.0 for one in found)


def test_a_rise_from_a_chair_begins_seated_and_ends_standing():
    time = np.arange(0, 5, 1 / RATE)
    up = np.clip((time - 2) / 1.5, 0, 1)
    up = up**2 * (3 - 2 * up)
    moved = bent(time, np.radians(90) * (1 - up), np.radians(90) * (1 - up), lean=np.radians(30) * np.sin(np.pi * up))
    (one,) = repetitions("chair", BODY, moved, soles_from_body(BODY, moved))
    assert one.kind == "sit_to_stand"
    assert 1.9 < one.start < 2.3
    assert 2.2 < one.off < one.end < 3.6


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_pelvis_has_the_signs_that_the_docstring_says(side):
    time = np.arange(0, 2, 1 / RATE)
    sign = 1.0 if side == "right" else -1.0
    turn = Rotation.from_euler("ZXY", [sign * 10, -sign * 6, 4], degrees=True)  # lab: up, forward, left
    still = motion_of(time, {}, np.stack([1.2 * time, 0 * time, 0.9 + 0 * time], axis=1))
    q = still.q.copy()
    q[:, 3:7] = (turn * Rotation.from_quat(BODY.neutral[3:7])).as_quat()
    moved = replace(still, q=q)
    cycle = Cycle("walk", "gait", side, 0.2, 1.6, np.nan)
    curves = lab_curves(cycle, BODY, moved, soles_from_body(BODY, moved), centre_of_mass(BODY, moved))
    found = {one.quantity: one.value.mean() for one in curves}
    assert found["pelvis_tilt"] == pytest.approx(4, abs=1e-6)  # about the left axis: forwards
    assert found["pelvis_obliquity"] == pytest.approx(6, abs=1e-6)
    assert found["pelvis_rotation"] == pytest.approx(10, abs=1e-6)
    assert found["centre_of_mass_height"] > 0.5


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_foot_that_is_turned_about_its_length_with_the_heel_up_has_no_progression(side):
    time = np.arange(0, 2, 1 / RATE)
    angles = {
        f"{side}_ankle_{name}": np.full(time.size, angle)
        for name, angle in (("dorsiflexion", -1.1), ("inversion", 0.3))
    }
    moved = motion_of(time, angles, np.stack([1.2 * time, 0 * time, 0.9 + 0 * time], axis=1))
    cycle = Cycle("walk", "gait", side, 0.2, 1.6, np.nan)
    curves = lab_curves(cycle, BODY, moved, soles_from_body(BODY, moved), centre_of_mass(BODY, moved))
    (told,) = [one.value for one in curves if one.quantity == "foot_progression"]
    assert np.abs(told).max() < 3.0


def test_repeats_have_mean_and_sd_and_gaps_stay_gaps():
    time = np.arange(0, 4, 1 / RATE)
    angle = np.where(time < 2, 0.2, 0.4)
    moved = motion_of(time, {"right_knee_flexion": angle}, np.zeros((time.size, 3)))
    moved = replace(moved, determined=(time < 2.5) | (time > 3.0))
    cycles = [Cycle("t", "gait", "right", start, start + 1.0, np.nan) for start in (0.5, 2.4)]
    curves = [one for cycle in cycles for one in angle_curves(cycle, BODY, moved)]
    (knee,) = [one for one in group_curves(curves) if one.quantity == "knee_flexion"]
    assert knee.values.shape == (2, 101)
    assert knee.mean[0] == pytest.approx(np.degrees(0.3))
    assert knee.sd[0] == pytest.approx(np.degrees(0.2) / np.sqrt(2))
    assert knee.mean[30] == pytest.approx(np.degrees(0.2))
    assert np.isnan(knee.sd[30])
    assert {one.side for one in curves} == {"right"}


def test_moments_and_powers_are_those_of_recursive_newton_euler_per_kg():
    rng = np.random.default_rng(3)
    moved, _ = walk()
    moved = replace(moved, a=rng.normal(0, 1, moved.a.shape))
    feet = {foot: Wrench(moved.time, rng.normal(0, 100, (moved.time.size, 6))) for foot in ("right_foot", "left_foot")}
    told = np.ones((moved.time.size, 2), dtype=bool)
    cycle = Cycle("walk", "gait", "left", 0.5, 1.5, np.nan)
    step = rng.normal(0, 1e-2, BODY.sip.phi.size) * np.abs(BODY.sip.phi)
    sip = replace(BODY.sip, covariance=np.outer(step, step))
    found = {one.quantity: one for one in load_curves(cycle, BODY, sip, moved, feet, told)}
    mass = BODY.sip.mass.sum()

    def torque(phi):
        return joint_torques(replace(BODY, sip=replace(BODY.sip, phi=phi)), moved, feet).torque

    frames, j = np.arange(50, 151), BODY.joint_index("left_hip_flexion")
    now = torque(BODY.sip.phi)
    np.testing.assert_allclose(found["hip_flexion_moment"].value, now[frames, j] / mass, atol=1e-8)
    np.testing.assert_allclose(
        found["hip_flexion_moment"].sd, np.abs(torque(BODY.sip.phi + step) - now)[frames, j] / mass, atol=1e-8
    )
    axes = slice(j, j + 3)
    power = np.sum(now[:, axes] * moved.v[:, 6:][:, axes], axis=1)
    np.testing.assert_allclose(found["hip_power"].value, power[frames] / mass, atol=1e-8)
    told[60:90, 1] = False
    known = {one.quantity: one.value for one in load_curves(cycle, BODY, sip, moved, feet, told)}
    assert "hip_power" not in known  # less than 80 % of the cycle
    assert np.isfinite(known["trunk_flexion_moment"]).all()  # needs no foot


def test_another_program_s_angles_and_events_stand_beside_ours():
    time = np.arange(0, 2, 1 / RATE)
    moved = motion_of(time, {"left_knee_flexion": 0.5 + 0.4 * np.sin(3 * time)}, np.zeros((time.size, 3)))
    theirs = np.zeros((time.size, 3))
    theirs[:, 0] = np.degrees(0.5 + 0.4 * np.sin(3 * time)) - 2.0
    theirs[:10] = np.nan
    outputs = FileOutputs(
        {"LKneeAngles": theirs}, (FootEvent(1.0, "left", True, "file"), FootEvent(1.9, "left", True, "file"))
    )
    (one,) = compare_angles(BODY, moved, outputs)
    assert (one.joint, one.label, one.frames) == ("left_knee_flexion", "LKneeAngles x", 190)
    assert one.offset == pytest.approx(2.0)
    assert one.correlation == pytest.approx(1.0)
    (strikes,) = compare_events((FootEvent(1.01, "left", True),), outputs)
    assert (strikes.count, strikes.missed) == (1, 1)
    assert strikes.late == pytest.approx(0.01)


def person_of(level, *, count=1):
    cycle = Cycle("walk", "gait", "right", 0.0, 1.0, 0.6)
    line = np.full(101, float(level))
    one = [CycleCurve(cycle, "knee_flexion", side, "deg", line, line) for side in ("right", "left")] * count
    broken = CycleCurve(cycle, "hip_power", "right", "W/kg", np.where(np.arange(101) < 50, np.nan, level), line)
    return group_curves([*one, broken])


def test_a_normal_band_counts_every_person_once_and_comes_back_from_the_file():
    import tomllib

    assert normal_curves({"a": person_of(10), "b": person_of(20)}) == ()
    bands = normal_curves({"a": person_of(10, count=9), "b": person_of(20), "c": person_of(60)})
    assert [one.quantity for one in bands] == ["knee_flexion"]  # a power that is known of half the cycle makes no band
    assert (bands[0].people, bands[0].unit) == (3, "deg")
    np.testing.assert_allclose(bands[0].mean, 30.0)
    np.testing.assert_allclose(bands[0].sd, np.std([10, 20, 60], ddof=1))
    (back,) = normal_of(tomllib.loads("\n".join(normal_toml(bands)))["normal"])
    assert (back.kind, back.people) == ("gait", 3)
    np.testing.assert_allclose(back.sd, bands[0].sd, rtol=1e-3)
    with pytest.raises(ValueError, match="unpack"):
        normal_of({"knee": {"mean": [1], "sd": [1]}})


def test_that_the_shares_of_two_feet_on_one_plate_are_an_estimate_is_said():
    one = squat()
    moved = movement_of(one, SQUATTER, None)
    assert moved.told == "1 squat"
    assert any("not measured" in note for note in moved.notes)
    assert "no moments" in movement_of(replace(one, trial=replace(one.trial, plates=())), SQUATTER, None).notes[0]


def test_events_by_hand_take_the_place_of_those_found_of_their_foot_and_the_cycles_follow():
    moved, _ = walk()
    trial = squat().trial
    found = trial_movement(trial, BODY, moved)
    times = {True: (0.31, 1.41, 2.51), False: (1.0, 2.2)}
    events = tuple(FootEvent(t, "left", down, "hand") for down, some in times.items() for t in some)
    told = trial_movement(replace(trial, events=events), BODY, moved)
    left = [one for one in told.events if one.side == "left"]
    assert [one.time for one in left] == [0.31, 1.0, 1.41, 2.2, 2.51]
    assert {one.source for one in left} == {"hand"}
    assert [one for one in told.events if one.side == "right"] == [one for one in found.events if one.side == "right"]
    ours = [(one.start, one.end, one.off) for one in told.cycles if one.side == "left"]
    assert ours == [(0.31, 1.41, 1.0), (1.41, 2.51, 2.2)]
    strides_left = [one.values for one in told.strides if one.cycle.side == "left"]
    assert strides_left[0]["stance"] == pytest.approx(100 * 0.69 / 1.1)
    assert strides_left[0]["stride_time"] == pytest.approx(1.1)

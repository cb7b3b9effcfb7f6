"""Every cause that can be hidden is made, arrives in the files and is what it claims, by other mathematics than that
which made it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from biodance.effects import FAMILY
from biodance.errors import BiodanceError, UnknownName
from biodance.lab.read import read_trial
from biodance.records import Subject, Trial
from biodance.virtual_lab.faults.causes import CAUSES, hide, parse_cause
from biodance.virtual_lab.faults.forces import Spring, swing
from biodance.virtual_lab.movement.performance import perform
from biodance.virtual_lab.movement.protocol import Protocol, read_protocol
from biodance.virtual_lab.person.person import make_person
from biodance.virtual_lab.recording.laboratory import FIRST_VISIT, LabVisit
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.tolerances import instruments_perfect

SUBJECT = Subject(60.0, 1.70, "F", 30.0)
PERFECT = LabVisit(tolerances=instruments_perfect())
EXAMPLES = (
    "plate_offset:target=Fz,offset=20", "plate_gain:target=Fz,gain=0.04", "plate_crosstalk:target=Fz->My,ratio=0.02",
    "plate_drift:target=Mx,drift=8", "time_delay:delay=0.02", "clock_drift:stretch=0.03",
    "plate_position:target=plate1:x,shift=0.02",
    "plate_rotation:target=plate1:z,angle=0.07", "body_mass:error=3", "unit_error:factor=4.448", "axis_error:target=Fx",
    "clipping:target=Fz,limit=500", "mains_hum:target=Fz,amplitude=8", "labels_swapped:target=LKNE/RKNE",
    "filter_mismatch:cutoff=3",
    "plate_hysteresis:target=Fz,width=6", "plate_creep:target=Fz,ratio=0.02", "plate_bending:size=0.02",
    "loose_connection:target=Fz,gain=0.1", "trigger_jitter:jitter=0.03", "object_on_plate:weight=40",
    "saturating:target=Fz,ratio=0.1",
    "frame_rate:ratio=1.2", "dropped_frames:count=12", "swaying_cameras:sway=0.004",
    "external_contact:target=right_forearm_hand,force=20",
    "body_weight_support:force=100,stiffness=200", "slack_harness:stiffness=8000", "table_edge:force=25",
    "spinning_wheel:momentum=20",
    "added_mass:target=left_forearm_hand,mass=2", "wobbling_mass:target=trunk_head,mass=10",
    "sloshing_load:target=trunk_head,mass=4,sloshing=3", "lab_tilt:target=x,angle=0.03",
    "joint_centre:target=right_hip,shift=0.03;0;0",
    "marker_misplaced:target=RKNE,shift=0.04;0;0", "segment_length:target=right_thigh,error=0.03",
    "unequal_limbs:target=left_shank,lighter=1.5",
    "head_joint:angle=0.2",
    "trunk_joint:angle=0.15", "shoulder_girdle:angle=0.15",
)  # fmt: skip


@pytest.fixture(scope="module")
def squats() -> Protocol:
    plan = read_protocol("short")
    static, squat = plan.trials[0], plan.trials[2]
    steps = (replace(squat.steps[0], cycles=2),)
    return replace(plan, trials=(replace(static, lead=0.4), replace(squat, steps=steps)))


def made(folder: Path, plan: Protocol, *texts: str, visit: LabVisit = PERFECT) -> Trial:
    visit, loads = hide(tuple(parse_cause(text) for text in texts), SUBJECT, plan, seed=4, visit=visit)
    simulate_session(SUBJECT, plan, folder, seed=4, visit=visit, loads=loads)
    return read_trial(folder / "squat_1.c3d")


@pytest.fixture(scope="module")
def clean(squats: Protocol, tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return made(tmp_path_factory.mktemp("clean") / "s", squats)


def test_every_cause_has_an_example_and_some_are_no_effects() -> None:
    assert sorted(parse_cause(text).name for text in EXAMPLES) == sorted(CAUSES)
    assert len(set(CAUSES) - set(FAMILY.members())) >= 6


@pytest.mark.parametrize("text", EXAMPLES, ids=lambda text: text.partition(":")[0])
def test_every_cause_arrives_in_the_files(text: str, squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    after = made(tmp_path / "s", squats, text)
    before_bytes, after_bytes = clean.source.path.read_bytes(), after.source.path.read_bytes()
    assert before_bytes != after_bytes


def added(after: Trial, before: Trial) -> np.ndarray:
    return after.wrench.value - before.wrench.value


def test_a_rail_takes_what_the_plate_loses_and_three_channels_are_free(
    squats: Protocol, clean: Trial, tmp_path: Path
) -> None:
    change = -added(made(tmp_path / "s", squats, "external_contact:target=right_forearm_hand,force=20"), clean)
    force, moment = change[:, :3], change[:, 3:]
    size = np.linalg.norm(force, axis=1)
    assert size.max() == pytest.approx(20.0, abs=0.6)
    assert 0.2 < np.mean(size > 10) < 0.7
    held = size > 15
    assert (
        np.abs(np.sum(force * moment, axis=1)[held]).max() < 0.02 * 20 * 20
    )  # a force at a point has no moment along itself


def test_a_rope_lifts_less_when_the_person_is_up(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    lift = -added(made(tmp_path / "s", squats, "body_weight_support:force=100,stiffness=200"), clean)[:, 2]
    hips = clean.markers["LPSI"][:, 2]
    low = clean.wrench.time[np.argmin(np.interp(clean.wrench.time, clean.markers.time, hips))]
    assert lift[50] == pytest.approx(100.0, abs=1.5)
    depth = hips[0] - hips.min()
    assert np.interp(low, clean.wrench.time, lift) == pytest.approx(100 + 200 * depth, rel=0.06)


def test_a_spinning_wheel_makes_a_pure_moment(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    change = added(made(tmp_path / "s", squats, "spinning_wheel:momentum=40"), clean)
    assert np.abs(change[:, :3]).max() < 0.5
    assert np.abs(change[:, 3:]).max() > 5.0


def test_springs_are_integrated_as_another_integrator_does() -> None:
    time, spring = np.arange(0, 3, 0.005), Spring(5.5, 0.3)
    push = np.stack([np.sin(9 * time) * time, np.cos(4 * time) - 1, 0 * time], axis=1)

    def rate(t: float, state: np.ndarray) -> list[float]:
        w = 2 * np.pi * spring.frequency
        return [state[1], -w * w * state[0] - 2 * spring.damping * w * state[1] - np.sin(9 * t) * t]

    z, z2 = swing(push, 0.005, spring)
    true = solve_ivp(rate, (0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(z[:, 0], true.y[0], atol=2e-6)
    np.testing.assert_allclose(z2[:, 0], np.gradient(true.y[1], time), atol=3e-2)
    assert not z[:, 2].any()


def test_loose_flesh_weighs_the_same_and_shows_only_in_motion(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    change = added(made(tmp_path / "s", squats, "wobbling_mass:target=trunk_head,mass=10"), clean)
    still = clean.wrench.time < 0.7
    assert np.abs(change[still, :3]).max() < 2.0
    assert np.abs(change[:, 2]).max() > 8.0
    assert abs(change[:, 2].mean()) < 0.5


def test_a_tilted_laboratory_turns_gravity(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    after = made(tmp_path / "s", squats, "lab_tilt:target=x,angle=0.03")
    turn = np.array([[1, 0, 0], [0, np.cos(0.03), -np.sin(0.03)], [0, np.sin(0.03), np.cos(0.03)]])
    np.testing.assert_allclose(after.wrench.force, clean.wrench.force @ turn.T, atol=0.3)
    np.testing.assert_allclose(after.markers["C7"], clean.markers["C7"] @ turn.T, atol=1e-5)


def test_a_joint_centre_moves_with_what_hangs_on_it() -> None:
    here, there = (
        make_person(SUBJECT, 4),
        make_person(SUBJECT, 4, joint_shifts={"right_hip": np.array([0.03, 0.0, 0.0])}),
    )
    for name, shift in (("right_hip_flexion", 0.03), ("left_hip_flexion", 0.0), ("right_knee_flexion", 0.0)):
        place = [person.body.joints[person.body.joint_index(name)].translation[0] for person in (here, there)]
        assert place[1] - place[0] == pytest.approx(shift, abs=1e-12)


def test_a_marker_falls_off_after_the_static_trial(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    after = made(tmp_path / "s", squats, "marker_misplaced:target=RKNE,shift=0.04;0;0")
    moved = np.linalg.norm(after.markers["RKNE"] - clean.markers["RKNE"], axis=1)
    np.testing.assert_allclose(moved, 0.04, atol=1e-4)
    static = [read_trial(path.parent / "static.c3d").markers["RKNE"] for path in (clean.source.path, after.source.path)]
    np.testing.assert_array_equal(*static)


def test_hysteresis_reads_low_on_the_way_up_and_high_on_the_way_down(
    squats: Protocol, clean: Trial, tmp_path: Path
) -> None:
    error = added(made(tmp_path / "s", squats, "plate_hysteresis:target=Fz,width=6"), clean)[:, 2]
    rising = np.gradient(clean.wrench.value[:, 2], clean.wrench.time)
    fast = np.abs(rising) > 800
    assert error[fast & (rising > 0)].mean() < -4
    assert error[fast & (rising < 0)].mean() > 4
    assert np.abs(error).max() < 6.1


def test_lost_frames_make_the_forces_late_from_then_on(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    after = made(tmp_path / "s", squats, "dropped_frames:count=12")
    frames = clean.markers.time.size
    assert after.markers.time.size == frames - 12
    np.testing.assert_array_equal(after.markers.xyz[: frames // 2], clean.markers.xyz[: frames // 2])
    np.testing.assert_array_equal(after.markers.xyz[frames // 2 :], clean.markers.xyz[frames // 2 + 12 :])
    np.testing.assert_array_equal(after.wrench.value, clean.wrench.value[: len(after.wrench.value)])


def test_a_wrong_rate_is_declared_for_both_clocks(squats: Protocol, clean: Trial, tmp_path: Path) -> None:
    after = made(tmp_path / "s", squats, "frame_rate:ratio=1.2")
    assert after.markers.rate == pytest.approx(1.2 * clean.markers.rate)
    assert after.wrench.rate == pytest.approx(1.2 * clean.wrench.rate, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("joint_centre:target=right_toe,shift=0.1;0;0", "right_hip"),
        ("joint_centre:target=right_hip,shift=0.1", "3 numbers"),
        ("marker_misplaced:target=NOPE,shift=0.1;0;0", "RKNE"),
        ("external_contact:target=head,force=10", "right_forearm_hand"),
        ("external_contact:target=pelvis,frce=10", "parameters force"),
        ("wobbling_mass:target=tail,mass=1", "trunk_head"),
        ("lab_tilt:target=q,angle=0.1", "axis"),
        ("segment_length:target=pelvis,error=0.1", "right_thigh"),
        ("frame_rate:ratio=100", "ratio"),
    ],
)
def test_wrong_words_are_refused(text: str, match: str, squats: Protocol, tmp_path: Path) -> None:
    with pytest.raises((BiodanceError, UnknownName), match=match):
        made(tmp_path / "s", squats, text, visit=FIRST_VISIT)


def test_without_a_fault_nothing_hums() -> None:
    """Balance is found in rounds; what alternates between its nodes, 50 Hz, once grew into 1 N and 1 N·m of hum for
    this person.
    """
    subject = Subject(65.0, 1.712, "M")
    plan = next(trial for trial in read_protocol("diagnosis").trials if trial.name == "move_2")
    done = perform(make_person(subject, 909), plan, 0, centre=np.array([0.3, 0.2]))
    wrench = done.wrench(np.arange(0.0, plan.duration, 0.002)).value
    spectrum = (
        np.abs(np.fft.rfft((wrench - wrench.mean(axis=0)) * np.hanning(len(wrench))[:, None], axis=0)) * 4 / len(wrench)
    )
    frequency = np.fft.rfftfreq(len(wrench), 0.002)
    assert spectrum[np.abs(frequency - 50) < 1].max() < 0.2

"""Every cause that can be hidden is made, arrives in the files and is what it claims, by other mathematics than that
which made it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_faults import about_centre, standing_recording
from inject import inject
from perfect_recordings import PERFECT_INSTRUMENTS
from scipy.integrate import solve_ivp

from biodance.effects import FAMILY
from biodance.errors import BiodanceError, UnknownName
from biodance.lab.c3d.raw import read_raw
from biodance.lab.readers import read_trial
from biodance.records import Subject, Trial
from biodance.virtual_lab.causes import CAUSES, Hidden, Spring, fault_of, hide, parse_cause, swing
from biodance.virtual_lab.movement import Protocol, read_protocol
from biodance.virtual_lab.movement.performance import perform
from biodance.virtual_lab.person import make_person
from biodance.virtual_lab.simulate import simulate_session
from biodance.virtual_lab.visit import FIRST_VISIT, Laboratory, LabVisit

SUBJECT = Subject(60.0, 1.70, "F", 30.0)
PERFECT = LabVisit(tolerances=PERFECT_INSTRUMENTS)
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
    simulate_session(SUBJECT, plan, folder, seed=4, hidden=tuple(parse_cause(text) for text in texts), visit=visit)
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


# ---- Faults written into copies of recordings

CLOCK = (0.1, 0.9)
FAULTS = (
    "plate_gain:target=Fz,gain=0.04", "plate_offset:target=Mx,offset=8", "plate_position:target=plate1:x,shift=0.02",
    "plate_rotation:target=plate1:z,angle=0.07", "time_delay:delay=0.02", "labels_swapped:target=LKNE/RKNE",
)  # fmt: skip


def written(path: Path, out: Path, text: str) -> Trial:
    return read_trial(inject(path, out, fault_of(parse_cause(text), {path.stem: CLOCK})))


def simulated(folder: Path, plate_type: int, *texts: str) -> Path:
    return standing_recording(folder, *texts, visit=LabVisit(laboratory=Laboratory(plate_type=plate_type)))


@pytest.fixture(scope="module", params=[2, 4])
def session_clean(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    return request.param, simulated(tmp_path_factory.mktemp("session_clean") / "s", request.param)


@pytest.mark.parametrize("text", FAULTS, ids=lambda text: text.partition(":")[0])
def test_a_copy_with_a_fault_is_a_recording_with_that_fault(
    text: str, session_clean: tuple[int, Path], tmp_path: Path
) -> None:
    kind, path = session_clean
    copy = written(path, tmp_path / path.name, text)
    again = read_trial(simulated(tmp_path / "s", kind, text))
    np.testing.assert_allclose(copy.plates[0].wrench.value, again.plates[0].wrench.value, atol=2e-3)
    np.testing.assert_allclose(copy.plates[0].corners, again.plates[0].corners, atol=1e-6)
    np.testing.assert_allclose(copy.markers["LKNE"], again.markers["LKNE"], atol=1e-6)


def test_a_drift_runs_with_the_clock_given(session_clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = session_clean
    change = (
        written(path, tmp_path / "c.c3d", "plate_drift:target=Fx,drift=9").wrench.value - read_trial(path).wrench.value
    )
    np.testing.assert_allclose(change[:, 0], 9 * (np.linspace(*CLOCK, len(change)) - 0.5), atol=2e-3)


def test_all_other_bytes_are_the_originals(session_clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = session_clean
    inject(path, tmp_path / "c.c3d", fault_of(parse_cause("plate_position:target=plate1:x,shift=0.02"), {}))
    one, two = path.read_bytes(), (tmp_path / "c.c3d").read_bytes()
    assert len(one) == len(two)
    assert 4 <= sum(a != b for a, b in zip(one, two, strict=True)) <= 16  # the x of four corners, four bytes each
    inject(path, tmp_path / "same.c3d", lambda recording: recording)
    assert one == (tmp_path / "same.c3d").read_bytes()


def test_what_does_not_fit_into_a_copy_is_refused(session_clean: tuple[int, Path], tmp_path: Path) -> None:
    _, path = session_clean
    with pytest.raises(BiodanceError, match="rates, lengths"):
        inject(path, tmp_path / "a.c3d", fault_of(parse_cause("frame_rate:ratio=1.2"), {}))
    inject(path, tmp_path / "b.c3d", lambda recording: recording)
    with pytest.raises(BiodanceError, match="exists already"):
        inject(path, tmp_path / "b.c3d", lambda recording: recording)


REAL = (
    "biomechzoo/HC030A/HC030A05.c3d",
    "biomechzoo/HC032A/HC032A01.c3d",
    "pycgm/Movement_trial.c3d",
    "adl_gait/2014001_C1_01.c3d",
)


@pytest.mark.parametrize("name", REAL)
def test_real_recordings_of_four_laboratories_take_faults(name: str, data: Path, tmp_path: Path) -> None:
    path = data / name
    before = read_trial(path)
    centre = before.plates[0].centre
    x = about_centre(before.plates[0], centre)
    gain = about_centre(written(path, tmp_path / "gain.c3d", "plate_gain:target=plate1:Fz,gain=0.04").plates[0], centre)
    np.testing.assert_allclose(gain - x, 0.04 * x * np.eye(6)[2], atol=0.05)
    moved = written(path, tmp_path / "moved.c3d", "plate_position:target=plate1:y,shift=0.02")
    np.testing.assert_allclose(moved.plates[0].centre - before.plates[0].centre, [0, 0.02, 0], atol=1e-6)
    np.testing.assert_allclose(about_centre(moved.plates[0], moved.plates[0].centre), x, atol=1e-3)
    late = about_centre(written(path, tmp_path / "late.c3d", "time_delay:delay=0.02").plates[0], centre)
    shift = 0.02 * before.plates[0].wrench.rate
    if shift == round(shift):
        np.testing.assert_allclose(
            late[round(shift) :], x[: -round(shift)], atol=0.6
        )  # the empty plate's mean moves a little
    raw = read_raw(path), read_raw(tmp_path / "late.c3d")
    np.testing.assert_array_equal(raw[0].points, raw[1].points)


def test_a_wrong_sign_of_fz_on_a_belt_is_turned_back_by_the_reader(data: Path, tmp_path: Path) -> None:
    path = data / "gaitalytics" / "treadmill_no_events.c3d"
    copy, before = written(path, tmp_path / "c.c3d", "axis_error:target=plate2:Fz"), read_trial(path)
    assert any("Fz alone was turned round" in one for one in copy.plates[1].decisions)
    assert not any("Two signs" in one for one in copy.warnings)
    for one, other in zip(copy.plates, before.plates, strict=True):
        np.testing.assert_allclose(one.wrench.value, other.wrench.value, atol=0.1)


# ---- Hidden faults arrive in the files as they were asked for

TRIAL = "standing_1"


def recorded(folder: Path, texts: tuple[str, ...], *, plate_type: int = 2) -> Trial:
    visit = LabVisit(laboratory=Laboratory(plate_type=plate_type), tolerances=PERFECT_INSTRUMENTS)
    return read_trial(standing_recording(folder, *texts, visit=visit))


@pytest.fixture(scope="module", params=[2, 4])
def both_types(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Trial]:
    return request.param, recorded(tmp_path_factory.mktemp("both_types") / "s", (), plate_type=request.param)


def test_channel_faults_have_the_size_asked_for(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    centre = before.plates[0].centre
    texts = (
        "plate_gain:target=Fz,gain=0.04",
        "plate_crosstalk:target=Fz->My,ratio=0.01",
        "plate_offset:target=Mx,offset=8",
    )
    after = recorded(tmp_path / "s", texts, plate_type=kind)
    x, y = (about_centre(one.plates[0], centre) for one in (before, after))
    tolerance = 0.2 if kind == 2 else 2.0  # TYPE 4 is stored in coarse volts
    np.testing.assert_allclose(y[:, 2], 1.04 * x[:, 2], atol=tolerance)
    np.testing.assert_allclose(y[:, 4], x[:, 4] + 0.01 * 1.04 * x[:, 2], atol=tolerance)
    np.testing.assert_allclose(y[:, 3], x[:, 3] + 8, atol=tolerance)


def test_forces_come_late(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    after = recorded(tmp_path / "s", ("time_delay:delay=0.02",), plate_type=kind)
    shift = round(0.02 * before.plates[0].wrench.rate)
    np.testing.assert_allclose(after.plates[0].wrench.value[shift:], before.plates[0].wrench.value[:-shift], atol=2.0)


def test_a_shifted_plate_shifts_the_centre_of_pressure(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    after = recorded(tmp_path / "s", ("plate_position:target=plate1:x,shift=0.02",), plate_type=kind)
    np.testing.assert_allclose(after.plates[0].centre - before.plates[0].centre, [0.02, 0, 0], atol=1e-6)
    moved = np.nanmedian(after.plates[0].wrench.cop() - before.plates[0].wrench.cop(), axis=0)
    np.testing.assert_allclose(moved[:2], [0.02, 0.0], atol=5e-4)


def test_a_turned_plate_turns_the_forces(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    after = recorded(tmp_path / "s", ("plate_rotation:target=plate1:z,angle=0.1",), plate_type=kind)
    c, s = np.cos(0.1), np.sin(0.1)
    turned = before.plates[0].wrench.force @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    np.testing.assert_allclose(after.plates[0].wrench.force, turned, atol=0.3)


def test_a_load_is_weighed_but_not_declared(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    after = recorded(tmp_path / "s", ("added_mass:target=left_forearm_hand,mass=2.4",), plate_type=kind)
    more = (after.plates[0].wrench.force[:, 2].mean() - before.plates[0].wrench.force[:, 2].mean()) / 9.80665
    assert more == pytest.approx(2.4, abs=0.02)
    assert after.measurements["Bodymass"] == before.measurements["Bodymass"]


def test_labels_are_exchanged_and_mass_is_underdeclared(both_types: tuple[int, Trial], tmp_path: Path) -> None:
    kind, before = both_types
    after = recorded(tmp_path / "s", ("labels_swapped:target=LKNE/RKNE", "body_mass:error=3"), plate_type=kind)
    np.testing.assert_allclose(np.nanmean(after.markers["LKNE"] - before.markers["RKNE"], axis=0), 0, atol=1e-4)
    assert after.measurements["Bodymass"] == pytest.approx(before.measurements["Bodymass"] - 3)


def test_words_are_read_and_wrong_ones_refused() -> None:
    assert parse_cause("added_mass:target=left_shank,mass=1,place=0;-0.1;0.05") == Hidden(
        "added_mass", "left_shank", {"mass": (1.0,), "place": (0.0, -0.1, 0.05)}
    )
    plan = read_protocol("standing")
    for text, match in (
        ("plate_gain:target=Fz,gian=0.1", "gain"),
        ("plate_gain:target=Fq,gain=0.1", "channel"),
        ("nothing", "Legal"),
    ):
        with pytest.raises((BiodanceError, UnknownName), match=match):
            hide((parse_cause(text),), SUBJECT, plan, seed=1)
    with pytest.raises(BiodanceError, match="not a number"):
        parse_cause("plate_gain:target=Fz,gain=much")

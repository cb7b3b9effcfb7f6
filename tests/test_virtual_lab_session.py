"""Simulated sessions pass through the same door as real ones, and what was hidden comes out again."""

import ast
import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from perfect_recordings import PERFECT_INSTRUMENTS

from biodance import virtual_lab
from biodance.errors import BiodanceError
from biodance.lab.readers.c3d import read_c3d
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.records import Subject
from biodance.virtual_lab.instruments import CALIBRATION, TISSUES, TruePlate, digitise
from biodance.virtual_lab.movement import Protocol, read_protocol
from biodance.virtual_lab.person import AddedLoad, make_person, of_parameters, place_inertia
from biodance.virtual_lab.person.skeleton import REALISTIC, small_rotation
from biodance.virtual_lab.simulate import simulate_session, sip_in_frames
from biodance.virtual_lab.visit import (
    CAMERAS,
    PLATES,
    Laboratory,
    LabVisit,
    draw_laboratory,
    draw_visitor,
    perform_in,
    record,
    set_up,
    soft_parts,
)

SUBJECT = Subject(58.0, 1.66, "F", 28.0, "S07")
FAITHFUL = PERFECT_INSTRUMENTS


@pytest.fixture(scope="module")
def protocol():
    short = read_protocol("short")
    return Protocol("shorter", (short.trials[0], short.trials[2]))


@pytest.fixture(scope="module")
def session(tmp_path_factory, protocol):
    return simulate_session(SUBJECT, protocol, tmp_path_factory.mktemp("lab") / "S07", seed=11)


def test_a_simulated_session_is_read_like_a_real_one(session):
    found = read_session(session)
    assert not found.refused
    assert {t.name: t.role for t in found.trials} == {"static": "static", "squat_1": "validate"}
    assert (found.subject.sex, found.subject.stature) == ("F", 1.66)
    assert found.subject.mass == pytest.approx(58.0, abs=0.2)
    for trial in found.trials:
        assert trial.marker_set == "plug_in_gait"
        assert len(trial.markers.names) == 39
        assert (trial.markers.rate, trial.plates[0].wrench.rate) == (pytest.approx(100), pytest.approx(1000))
        assert not trial.warnings


def test_the_static_trial_weighs_the_subject(session):
    static = read_c3d(session / "static.c3d")
    assert static.wrench.force[:, 2].mean() / 9.80665 == pytest.approx(58.0, rel=0.01)
    xyz = static.markers.xyz
    assert np.isfinite(xyz).all()
    assert 0.0 < xyz[..., 2].min() < 0.1
    assert 1.5 < xyz[..., 2].max() < 1.7


def test_the_truth_lies_apart_and_adds_up(session):
    truth = json.loads((session / "truth" / "truth.json").read_text())
    for key in ("segments_12", "segments_16"):
        assert sum(s["mass_kg"] for s in truth[key]) == pytest.approx(58.0)
    assert [s["name"] for s in truth["segments_12"]][7] == "trunk_head"
    assert truth["joint_centres"]["right_hip"]["segment"] == "pelvis"
    assert truth["joint_centres"]["left_elbow"]["segment"] == "left_upper_arm"
    assert [t["name"] for t in truth["trials"]] == ["static", "squat_1"]


def test_the_truth_can_be_told_in_another_model_s_frames(session):
    truth = json.loads((session / "truth" / "truth.json").read_text())
    own = truth["static_pose"]["segments_12"]
    turn, place = np.array([s["rotation"] for s in own]), np.array([s["position_m"] for s in own])
    same = sip_in_frames(truth, turn, place)
    np.testing.assert_allclose(same.com, [s["com_m"] for s in truth["segments_12"]], atol=1e-12)
    np.testing.assert_allclose(
        same.phi.reshape(-1, 10)[:, 4:], [s["inertia_kgm2"] for s in truth["segments_12"]], atol=1e-12
    )
    rng = np.random.default_rng(0)
    other_turn = np.stack([small_rotation(r) for r in 0.2 * rng.normal(size=(12, 3))]) @ turn
    other_place = place + 0.03 * rng.normal(size=(12, 3))
    other = sip_in_frames(truth, other_turn, other_place)
    for i in range(12):
        one = place_inertia(of_parameters(same.phi[10 * i : 10 * i + 10]), turn[i], place[i])
        two = place_inertia(of_parameters(other.phi[10 * i : 10 * i + 10]), other_turn[i], other_place[i])
        np.testing.assert_allclose(two, one, atol=1e-12)


def test_the_same_seed_writes_the_same_bytes_and_another_day_does_not(tmp_path, protocol, session):
    again = simulate_session(SUBJECT, protocol, tmp_path / "again", seed=11)
    for path in sorted(session.rglob("*.*")):
        if path.is_file():
            assert (again / path.relative_to(session)).read_bytes() == path.read_bytes(), path.name
    other = simulate_session(SUBJECT, protocol, tmp_path / "other", seed=11, visit=LabVisit(1))
    assert (other / "static.c3d").read_bytes() != (session / "static.c3d").read_bytes()
    one, two = (json.loads((s / "truth" / "truth.json").read_text()) for s in (session, other))
    assert one["segments_16"] == two["segments_16"]
    assert one["markers"] != two["markers"]


@pytest.mark.parametrize(
    "laboratory", [Laboratory(bits=32), Laboratory(bits=32, plate_type=4, heading=1.2), Laboratory(bits=32, plates=2)]
)
def test_a_perfect_laboratory_gives_the_truth_back(tmp_path, protocol, laboratory):
    out = simulate_session(SUBJECT, protocol, tmp_path / "S", seed=3, visit=LabVisit(0, laboratory, FAITHFUL))
    person = make_person(SUBJECT, 3, tolerances=FAITHFUL)
    act = perform_in(set_up(person, LabVisit(0, laboratory, FAITHFUL)), person, protocol.trials[1])
    trial = read_c3d(out / "squat_1.c3d")
    assert len(trial.plates) == laboratory.plates
    wanted = act.wrench(trial.plates[0].wrench.time).value
    np.testing.assert_allclose(trial.wrench.value, wanted, atol=2e-3)
    pose = poses(person.body, act.motion(trial.markers.time).q)
    bone = pose.points(person.body.markers.segment, np.array(person.body.markers.position))
    order = [trial.markers.names.index(name) for name in person.body.markers.names]
    np.testing.assert_allclose(trial.markers.xyz[:, order], bone, atol=1e-6)


def test_the_two_plates_carry_the_two_feet(tmp_path):
    short = read_protocol("short")
    one_leg = Protocol("one leg", (short.trials[0], short.trials[1]))
    out = simulate_session(SUBJECT, one_leg, tmp_path / "S", seed=3, visit=LabVisit(0, Laboratory(plates=2), FAITHFUL))
    trial = read_c3d(out / "dance_1.c3d")
    right, left = sorted(trial.plates, key=lambda plate: plate.centre[1])
    time = trial.plates[0].wrench.time
    mean = {}
    for name, start in (("right_leg_up", 8.8), ("left_leg_up", 13.0)):
        frames = (time > start) & (time < start + 0.3)
        mean[name] = [p.wrench.force[frames, 2].mean() for p in (right, left)]
    assert mean["right_leg_up"][0] == pytest.approx(0, abs=1)
    assert mean["right_leg_up"][1] == pytest.approx(58 * 9.80665, rel=0.05)
    assert mean["left_leg_up"][1] == pytest.approx(0, abs=1)


def test_each_instrument_fault_is_where_it_was_put(protocol):
    """One tolerance at a time: what the channels then say differs from the truth in the way its name promises."""
    person = make_person(SUBJECT, 3, tolerances=FAITHFUL)
    lab = Laboratory(bits=32)

    def channels(**changed):
        tolerances = replace(FAITHFUL, **changed)
        instruments = set_up(person, LabVisit(0, lab, tolerances))
        act = perform_in(instruments, person, protocol.trials[1])
        return record(act, instruments).plates[0].channels, instruments

    clean, _ = channels()
    late, _ = channels(plate_delay=0.005)
    np.testing.assert_allclose(late[5:], clean[:-5], atol=1e-4)
    gained, instruments = channels(plate_gain=0.003)
    np.testing.assert_allclose(gained, clean * np.diag(instruments.plates[0].mixing), atol=1e-3)
    assert 0.0005 < np.abs(np.diag(instruments.plates[0].mixing) - 1).max() < 0.01
    moved, instruments = channels(plate_position=0.01)
    shift = instruments.plates[0].centre - np.array([0.3, 0.2, 0.0])
    plate_shift = instruments.plates[0].turn.T @ shift
    np.testing.assert_allclose(moved[:, 3:] - clean[:, 3:], -np.cross(plate_shift, clean[:, :3]), atol=1e-3)
    noisy, _ = channels(plate_noise=0.7)
    assert (noisy - clean)[:, 2].std() == pytest.approx(0.7, rel=0.05)
    offset, instruments = channels(plate_offset=2.0)
    np.testing.assert_allclose(offset - clean, np.tile(instruments.plates[0].offset, (len(clean), 1)), atol=1e-3)


def test_plates_stay_installed_and_are_zeroed_anew():
    person = make_person(SUBJECT, 3)
    first, second = (set_up(person, LabVisit(day)).plates[0] for day in (0, 1))
    np.testing.assert_array_equal(first.mixing, second.mixing)
    np.testing.assert_array_equal(first.centre, second.centre)
    assert np.all(first.offset != second.offset)


def test_markers_wander_on_the_skin_by_some_millimetres(protocol):
    person = make_person(SUBJECT, 3)
    wander = replace(REALISTIC, camera_noise=0.0, camera_wander=0.0, gaps_per_minute=0.0, lab_tilt=0.0)
    instruments = set_up(person, LabVisit(tolerances=wander))
    act = perform_in(instruments, person, protocol.trials[1])
    markers = record(act, instruments).markers
    pose = poses(person.body, act.motion(markers.time).q)
    apart = markers.xyz - pose.points(person.body.markers.segment, np.array(person.body.markers.position))
    local = np.einsum("tkji,tkj->tki", pose.rotation[:, list(person.body.markers.segment)], apart)
    rms = np.sqrt(np.mean(np.sum((local - local.mean(axis=0)) ** 2, axis=2), axis=0))
    thigh = [k for k, name in enumerate(markers.names) if name.endswith(("THI", "KNE"))]
    assert 0.003 < rms[thigh].mean() < 0.02
    assert 0.001 < np.median(rms) < 0.01


def test_loads_weigh_on_the_plate_but_not_in_what_the_analyst_declares(tmp_path, protocol):
    load = AddedLoad("left_forearm", 2.4, np.array([0.0, -0.1, 0.0]))
    out = simulate_session(SUBJECT, protocol, tmp_path / "loaded", seed=11, visit=LabVisit(1, loads=(load,)))
    assert read_session(out).subject.mass == pytest.approx(58.0, abs=0.2)
    static = read_c3d(out / "static.c3d")
    assert static.wrench.force[:, 2].mean() / 9.80665 == pytest.approx(60.4, rel=0.01)
    truth = json.loads((out / "truth" / "truth.json").read_text())
    arm, loaded = (
        next(s for s in truth[key] if s["name"] == "left_forearm_hand")
        for key in ("segments_12", "segments_12_with_loads")
    )
    assert loaded["mass_kg"] - arm["mass_kg"] == pytest.approx(2.4)


def test_a_fault_changes_the_raw_recording_before_it_is_written(tmp_path, protocol):
    def dead_channel(recording):
        plate = recording.plates[0]
        channels = np.array(plate.channels)
        channels[:, 4] = 0.0
        return replace(recording, plates=(replace(plate, channels=channels),))

    out = simulate_session(SUBJECT, protocol, tmp_path / "S", seed=11, visit=LabVisit(faults=(dead_channel,)))
    from biodance.lab.c3d.raw import read_raw

    assert not read_raw(out / "static.c3d").analog[:, 4].any()


def test_what_cannot_be_simulated_is_refused_before_anything_is_written(tmp_path, protocol):
    with pytest.raises(BiodanceError, match=r"mass = 20 kg"):
        simulate_session(Subject(20, 1.2, "F"), protocol, tmp_path / "S", seed=1)
    with pytest.raises(BiodanceError, match=r"stature = 175 m"):
        simulate_session(Subject(60, 175, "F"), protocol, tmp_path / "S", seed=1)
    assert not (tmp_path / "S").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    with pytest.raises(BiodanceError, match="not an empty folder"):
        simulate_session(SUBJECT, protocol, tmp_path / "full", seed=1)
    with pytest.raises(BiodanceError, match="TYPE 3"):
        Laboratory(plate_type=3)


TESTED = (
    "biodance.effects",
    "biodance.observations",
    "biodance.diagnosis",
    "biodance.identification",
    "biodance.uncertainty",
    "biodance.spatial",
    "biodance.motion.dynamics",
    "biodance.motion.ik.inverse_kinematics",
    "biodance.body.tables.anthropometry",
    "biodance.body.human.human",
)
"""What sessions of the virtual laboratory test: a formula that maker and finder share would hide its own bug."""


def test_the_virtual_laboratory_imports_nothing_that_its_sessions_test():
    assert all(find_spec(name) for name in TESTED)
    for path in sorted(Path(virtual_lab.__file__).parent.rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        modules = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
        modules |= {
            f"{node.module}.{one.name}" for node in nodes if isinstance(node, ast.ImportFrom) for one in node.names
        }
        modules |= {one.name for node in nodes if isinstance(node, ast.Import) for one in node.names}
        assert not [name for name in modules if f"{name}.".startswith(tuple(f"{one}." for one in TESTED))], path


# ---- Laboratories drawn from a seed


def test_a_number_is_one_laboratory_and_the_family_is_wide() -> None:
    family = [draw_laboratory(seed) for seed in range(60)]
    assert family[7] == draw_laboratory(7)
    assert {one.tissue for one in family} == set(TISSUES)
    assert {one.plates for one in family} == {1, 2, 3, 4}
    assert {one.segments for one in family} == {12, 14, 16, 18, 20, 22}
    assert {one.joints for one in family} == {"functional", "static"}
    assert {one.children for one in family} == {True, False}
    cameras = np.array([one.tolerances.camera_noise for one in family])
    density = np.array([one.tolerances.plate_noise for one in family]) * np.sqrt(2 / 1000)
    for drawn, (low, high) in ((cameras, CAMERAS), (density, PLATES)):
        assert low <= drawn.min() < 2 * low
        assert high / 2 < drawn.max() <= high
    times = np.log([one.tolerances.plate_gain / REALISTIC.plate_gain for one in family])
    assert np.std(times) == pytest.approx(0.4, abs=0.1)
    assert all((one.tolerances.head_motion == 0) == (one.segments < 14) for one in family)
    assert all(len(soft_parts(one)) == max(0, one.segments - 16) for one in family)
    ages = [draw_visitor(one, 1).age for one in family]
    assert all((age < 16) == one.children for age, one in zip(ages, family, strict=True))


def test_a_drawn_laboratory_records_what_can_be_read(tmp_path) -> None:
    here = replace(draw_laboratory(3), plates=4, plate_type=2, segments=22, tissue="wavy", joints="static")
    who = draw_visitor(here, 1)
    session = read_session(simulate_session(who, "standing", tmp_path / "s", seed=1, visit=LabVisit(laboratory=here)))
    assert session.settings.joints == "static"
    trial = session.trials[0]
    weight = [abs(float(plate.wrench.force[:, 2].mean())) for plate in trial.plates]
    assert sum(weight[:2]) == pytest.approx(9.81 * who.mass, rel=0.02)
    assert max(weight[2:]) < 5


@pytest.mark.parametrize("wrong", [{"plates": 5}, {"tissue": "firm"}, {"segments": 11}, {"plate_type": 3}])
def test_an_impossible_laboratory_is_refused(wrong) -> None:
    with pytest.raises(BiodanceError, match="legal are"):
        Laboratory(**wrong)


def test_a_converter_rounds_to_its_steps_and_ends_at_ten_volts():
    corners = np.array([[0.2, 0.3, 0.0], [-0.2, 0.3, 0.0], [-0.2, -0.3, 0.0], [0.2, -0.3, 0.0]])
    plate = TruePlate(corners, np.eye(3), np.zeros(3), np.eye(6), np.zeros(6))
    volts = np.array([[12.0] * 6, [-12.0] * 6, [3.001] * 6, [0.0] * 6])
    for bits in (8, 16):
        kept = digitise(volts @ CALIBRATION.T, plate, kind=4, bits=bits).channels
        np.testing.assert_allclose(kept[[0, 1, 3]], [[10.0] * 6, [-10.0] * 6, [0.0] * 6], atol=1e-12)
        np.testing.assert_allclose(kept[2], 3.001, atol=10.0 / 2**bits + 1e-12)

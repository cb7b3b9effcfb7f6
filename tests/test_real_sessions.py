"""Real sessions through the whole pipeline, each examined once: what is known of them is found, and no fault where
there is none.
"""

from collections.abc import Callable

import numpy as np
import pytest

from biodance.cycles.scores import gait_scores, gait_vectors, normal_curves
from biodance.diagnosis.diagnosis import ABOUT
from biodance.pipeline.diagnosis import diagnose_session
from biodance.pipeline.judged_trials import failed_checks
from biodance.pipeline.movement import describe_movement
from biodance.pipeline.results import SessionResult

RATE = 100.0


Recording = Callable[[str], SessionResult]


@pytest.fixture
def completed(recording: Recording) -> Recording:
    """Return what gives the result of a real session in which no step failed."""

    def by_name(name: str) -> SessionResult:
        result = recording(name)
        assert [step.text for trial in result.trials for step in trial.steps if step.status == "failed"] == []
        return result

    return by_name


@pytest.mark.parametrize(("name", "declared"), [("HC030A", 45.80), ("HC032A", 60.30), ("HC038A", 56.80)])
def test_the_weight_of_real_statics_is_the_declared_one(name, declared, completed):
    result = completed(f"biomechzoo/{name}")
    assert result.subject.mass == pytest.approx(declared, abs=0.01)
    assert abs(result.mass_difference) < 0.3
    static, walk, *_ = result.trials
    assert static.trial.role == "static"
    assert static.fit.total_rms < 0.002
    assert 0.3 < walk.comparison.used.sum() / RATE < 1.5
    assert walk.comparison.correlation[3] > 0.5
    near_what_vicon_says(describe_movement(result)[walk.name])


def near_what_vicon_says(moved):
    """Events and joint angles of a real walk lie where the software of its laboratory puts them."""
    for one in moved.file_events:
        assert one.missed <= 1
        assert abs(one.late) < 0.012
    limits = {"hip_flexion": (8.0, 0.95), "knee_flexion": (6.0, 0.97), "ankle_dorsiflexion": (5.0, 0.95)}
    found = {one.joint.partition("_")[2]: one for one in moved.file_angles}
    for joint, (offset, correlation) in limits.items():
        assert abs(found[joint].offset) < offset, joint
        assert found[joint].correlation > correlation, joint


def test_a_static_off_the_plates_is_refused_and_the_stairs_are_compared(completed):
    result = completed("pycgm")
    static, stairs = result.trials
    assert "nobody stands on the plates" in static.reason
    assert static.fit is not None
    assert result.standing is None
    assert stairs.comparison.used.sum() > 150
    assert stairs.comparison.correlation[2] > 0.9


def test_a_static_of_one_frame_scales_the_body(completed):
    result = completed("adl_gait")
    assert "static trial 2014001_ST" in result.placed.source
    walk = result.trials[1]
    assert walk.fit.total_rms < 0.025
    assert walk.comparison.correlation.min() > 0.8


def test_plates_alone_are_weighed(completed):
    result = completed("biomdp")
    weights = {trial.trial.name: trial.standing.mass for trial in result.trials}
    assert weights["kistler_COP"] == pytest.approx(666 / 9.80665, abs=0.5)
    assert all("no markers" in trial.reason for trial in result.trials)


def test_labels_of_no_known_set_are_guessed_and_legs_and_trunk_followed(completed):
    result = completed("c3d_parser")
    assert {trial.trial.worn for trial in result.trials} == {"guessed"}
    assert all(trial.fit.total_rms < 0.02 for trial in result.trials)
    assert "the map was guessed from names and posture: " in " ".join(result.session.notes)
    assert "carry no markers that place elbow and wrist" in " ".join(result.body.notes)
    assert result.session.subject.mass == pytest.approx(36.3, abs=0.1)


def test_a_real_walk_is_followed_closer_and_the_page_says_what_the_forces_make_of_it(recording: Recording) -> None:
    result = recording("adl_gait")
    (walk,) = (one for one in result.trials if one.trial.role == "fit")
    assert "forearms" in result.placed.taken
    assert walk.fit is not None
    assert walk.fit.total_rms < 0.012  # 18.9 mm with 23 axes
    assert result.body is not None
    assert "vertical force" in result.body.notes[-1]
    assert len(result.identification.identification.sip.segments) == 12  # type: ignore[union-attr]


EXCHANGED = {
    "HC038A": ("LWRA/LWRB", "RWRA/RWRB"),
    "HC050A": ("LWRA/LWRB",),
    "HC055A": ("LBHD/RBHD", "LFHD/RFHD"),
}
"""Truly exchanged in one walk each: finger markers on the palm, distances to elbow and within the head say so, too."""
CHILDREN = ("HC031A", "HC032A", "HC038A", "HC044A", "HC050A", "HC055A")


@pytest.mark.parametrize("name", [*(f"biomechzoo/{child}" for child in CHILDREN), "adl_gait", "pycgm"])
def test_a_real_recording_without_fault_gets_no_name(name: str, recording: Recording) -> None:
    found = diagnose_session(recording(name)).diagnosis
    said = next(one for one in found.attention if one.about == ABOUT)
    named = {(one.effect, one.target) for one in found.faults}
    assert named == {("labels_swapped", pair) for pair in EXCHANGED.get(name.removeprefix("biomechzoo/"), ())}
    assert named or found.status in ("clean", "cannot tell")
    assert all(said.level == "note" for said in found.attention) is (found.status == "clean")
    assert said is found.attention[0]


def test_identify_finds_the_exchanged_wrist_that_the_diagnosis_finds(recording: Recording) -> None:
    checks = failed_checks(recording("biomechzoo/HC030A"))
    assert [(one.effect, one.target) for one in checks] == [("labels_swapped", "LWRA/LWRB")]


def test_knee_and_hip_of_five_real_walks_are_within_two_degrees_of_plug_in_gait(recording: Recording) -> None:
    moved = describe_movement(recording("c3d_parser_Sydney"))
    assert moved.gait is not None
    assert {side: sum(one.side == side for one in moved.gait.good) for side in ("right", "left")} == {
        "right": 5,
        "left": 5,
    }
    keys = [one for one in moved.gait.keys if one.quantity in ("hip_flexion", "knee_flexion")]
    assert len(keys) == 10
    for one in keys:
        for side, ours in (("right", one.right), ("left", one.left)):
            assert ours is not None
            assert abs(ours.mean - one.beside[side].mean) < 2.0, (one.name, side)
    assert {one.because.value for one in moved.gait.left_out} == {"shared_plate"}
    loads = next(one for one in moved.gait.groups if (one.quantity, one.side) == ("hip_flexion_moment", "right"))
    assert np.nanmax(np.abs(loads.values)) < 2.0  # N·m/kg: no spikes from the shares of a plate under both feet


WALKERS = (*(f"biomechzoo/{child}" for child in (*CHILDREN, "HC002D", "HC030A", "HC036A")), "c3d_parser_MH", "pycgm")


@pytest.mark.parametrize("name", WALKERS)
def test_plug_in_gait_computed_here_is_that_of_the_file(name: str, recording: Recording) -> None:
    gait = describe_movement(recording(name)).gait
    assert gait is not None
    keys = [one for one in gait.keys if one.quantity in ("hip_flexion", "hip_adduction", "knee_flexion")]
    assert len(keys) == 15
    for one in keys:
        for side, theirs in one.beside.items():
            assert abs(one.conventional[side].mean - theirs.mean) < 0.5, (one.name, side)


def test_profile_scores_of_plug_in_gait_computed_here_and_in_the_files_are_the_same(recording: Recording) -> None:
    gaits = {name: describe_movement(recording(name)).gait for name in WALKERS}
    for name in ("biomechzoo/HC002D", "biomechzoo/HC031A", "biomechzoo/HC036A", "c3d_parser_MH"):
        others = {one: gait.file_groups for one, gait in gaits.items() if gait is not None and one != name}
        normal, walked = normal_curves(others), gaits[name]
        assert walked is not None
        seen = gait_vectors(walked.file_curves)
        here = gait_scores([one for one in walked.conventional_curves if one.cycle in seen], normal)
        theirs = gait_scores(walked.file_curves, normal)
        assert here is not None
        assert theirs is not None
        assert here.overall == pytest.approx(theirs.overall, abs=0.2)


def test_axes_that_a_laboratory_corrected_by_hand_are_seen_beside_the_static_trial(recording: Recording) -> None:
    """Sydney's static holds thigh rotations of -1.0 and -1.1 degrees, its walks of 2.6 and 2.0: made with others."""
    hips = {
        (one.joint, walk.trial): one.conventional
        for walk in describe_movement(recording("c3d_parser_Sydney"))
        for one in walk.file_angles
        if one.joint.endswith("hip_rotation") and walk.cycles
    }
    assert len(hips) == 10
    assert all(4.0 < rms < 6.5 for rms in hips.values())


@pytest.mark.parametrize("child", ["HC050A", "HC055A"])
def test_a_child_bends_the_knee_more_in_swing_than_plug_in_gait_says(child: str, recording: Recording) -> None:
    """Its knee goes with one marker, which slides backwards (docs/benchmarks/movement.md)."""
    moved = describe_movement(recording(f"biomechzoo/{child}"))
    assert moved.gait is not None
    (knee,) = [one for one in moved.gait.keys if one.name == "knee_flexion_maximum"]
    for side, ours in (("right", knee.right), ("left", knee.left)):
        assert ours is not None
        assert 1.5 < ours.mean - knee.beside[side].mean < 4.5
    muscles = {(one.quantity, one.side) for one in moved.gait.groups if one.quantity.endswith("_emg")}
    assert ("gastrocnemius_emg", "left") in muscles

"""Scaling on a static trial: bodies that stand under their markers, clear refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.measures import (
    Measures,
)
from biodance.body.human.scaling import chain_angles, measure_static
from biodance.body.human.skeleton import standing_tilt
from biodance.body.human.static_centres import arm_centres
from biodance.body.parts import smallest_eigenvalues
from biodance.errors import SessionRefused, TrialRefused
from biodance.lab.prepare import prepare
from biodance.lab.session.read import read_session
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import poses
from biodance.records import SIDES, Markers, Source, Subject, Trial
from biodance.records.attention import NotUsed
from biodance.spatial import elementary_rotation

SUBJECT = Subject(65.0, 1.75, "F", 33.0)
STATICS = ("biomechzoo/HC030A", "biomechzoo/HC032A", "biomechzoo/HC038A", "pycgm")


def standing_trial(
    *, drop: tuple[str, ...] = (), measurements: dict[str, float] | None = None, frames: int = 60
) -> Trial:
    """Return a static trial of the generic person: every marker at its usual place, standing on the floor."""
    body = human(SUBJECT)
    q = np.tile(body.neutral, (frames, 1))
    q[:, 2] = 0.95
    for joint, degrees in (
        ("right_shoulder_adduction", -25),
        ("left_shoulder_adduction", -25),
        ("right_elbow_flexion", 25),
        ("left_elbow_flexion", 25),
        ("right_knee_flexion", 5),
        ("left_knee_flexion", 5),
    ):
        q[:, 7 + body.joint_index(joint)] = np.radians(degrees)
    keep = [i for i, name in enumerate(body.markers.names) if name not in drop]
    xyz = poses(body, q).points([body.markers.segment[i] for i in keep], body.markers.position[keep])
    markers = Markers(tuple(body.markers.names[i] for i in keep), np.arange(frames) / 100, xyz)
    return Trial(
        "static",
        "static",
        markers,
        (),
        Source(Path("static.c3d"), "", "test", 100.0),
        "plug_in_gait",
        measurements or {},
    )


def scaled(subject: Subject, static: Trial) -> tuple[Body, np.ndarray]:
    """Return the body and its standing posture."""
    return measure_static(subject, static).body()


def test_the_body_stands_exactly_under_its_markers() -> None:
    trial = standing_trial()
    body, q = scaled(SUBJECT, trial)
    found = poses(body, q[None]).points(body.markers.segment, body.markers.position)[0]
    expected = np.stack([trial.markers[name][0] for name in body.markers.names])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_generic_person_is_found_again() -> None:
    body, _ = scaled(SUBJECT, standing_trial())
    generic = human(SUBJECT)
    for name in ("right_knee_flexion", "left_knee_flexion", "right_ankle_dorsiflexion", "right_elbow_flexion"):
        i = body.joint_index(name)
        assert np.linalg.norm(body.joints[i].translation) == pytest.approx(
            np.linalg.norm(generic.joints[i].translation), rel=0.12
        ), name
    assert body.sip.mass.sum() == pytest.approx(65.0)
    assert smallest_eigenvalues(body.sip.phi).min() > 0


@pytest.mark.parametrize(
    "drop", [("LUPA", "RUPA", "LFRM", "RFRM"), ("LFHD", "RFHD", "LBHD", "RBHD", "RBAK"), ("T10", "STRN")]
)
def test_fewer_markers_still_make_a_body(drop: tuple[str, ...]) -> None:
    body, _ = scaled(SUBJECT, standing_trial(drop=drop))
    assert not set(drop) & set(body.markers.names)


@pytest.mark.parametrize("kept", [("C7",), ("STRN",), ("RELB", "RWRA", "RWRB", "LELB", "LWRA", "LWRB")])
def test_what_hangs_on_a_trunk_that_is_held_does_not_tilt_the_pelvis(kept: tuple[str, ...]) -> None:
    """What one marker of a trunk does, or arms on it, is no posture of the pelvis."""
    whole = human(SUBJECT)
    on_top = [
        name
        for name, k in zip(whole.markers.names, whole.markers.segment, strict=True)
        if whole.segments[k] not in {"pelvis", *(f"{s}_{p}" for s in SIDES for p in ("thigh", "shank", "foot"))}
    ]
    static = standing_trial(drop=tuple(name for name in on_top if name not in kept))
    body, _ = scaled(SUBJECT, static)
    assert not body.free[[body.joint_index("trunk_flexion")]].any()
    bent = np.tile(whole.neutral, (20, 1))
    bent[:, 2], bent[:, 7 + whole.joint_index("trunk_flexion")] = 0.95, np.radians(np.linspace(0, 30, 20))
    assert static.markers is not None
    columns = [whole.markers.names.index(name) for name in static.markers.names]
    seen = poses(whole, bent).points([whole.markers.segment[k] for k in columns], whole.markers.position[columns])
    found = solve_ik(body, Markers(static.markers.names, np.arange(20) / 100, seen))
    tilt = poses(body, found.q).rotation[:, 0]
    turned = np.degrees(np.arccos((np.einsum("ij,tij->t", tilt[0], tilt) - 1) / 2 - 1e-12))
    assert turned.max() < 0.1


def test_missing_landmarks_are_named() -> None:
    with pytest.raises(TrialRefused, match=r"knee|KNE"):
        scaled(SUBJECT, standing_trial(drop=("RKNE",)))


def test_unknown_labels_no_markers_and_unknown_mass_are_refused() -> None:
    trial = standing_trial()
    with pytest.raises(TrialRefused, match="no known marker set"):
        scaled(SUBJECT, replace(trial, marker_set=""))
    with pytest.raises(TrialRefused, match="no markers"):
        scaled(SUBJECT, replace(trial, markers=None))
    with pytest.raises(SessionRefused, match="mass_kg"):
        scaled(replace(SUBJECT, mass=float("nan")), trial)


def test_a_thigh_marker_that_was_not_placed_for_the_set_is_not_believed() -> None:
    trial = standing_trial()
    right, _ = scaled(SUBJECT, trial)
    names, xyz = trial.markers.names, trial.markers.xyz.copy()
    knee_marker, height = xyz[0, names.index("RKNE")], xyz[0, names.index("RTHI"), 2]
    xyz[:, names.index("RTHI")] = [
        knee_marker[0] + 0.1,
        knee_marker[1] + 0.06,
        height,
    ]  # in front of the thigh instead of beside it
    wrong, _ = scaled(SUBJECT, replace(trial, markers=Markers(names, trial.markers.time, xyz)))
    assert any(
        "right thigh marker would turn the knee's axis" in note and note.startswith("Warning") for note in wrong.notes
    )
    assert not any("thigh marker would turn" in note for note in right.notes)
    knee = right.joint_index("right_knee_flexion")
    assert np.linalg.norm(wrong.joints[knee].translation - right.joints[knee].translation) < 0.005


def test_wrist_markers_on_the_styloids_and_on_a_bar() -> None:
    centre = np.array([0.0, 0.0, 0.0])
    radial, ulnar, elbow_at = np.array([0.04, 0, 0]), np.array([-0.04, 0, 0]), np.array([0.0, 0, 0.25])
    place = {
        "right_elbow_lateral": elbow_at + np.array([0.04, 0, 0]),
        "right_wrist_radial": radial,
        "right_wrist_ulnar": ulnar,
    }
    sizes = measures_of(wrist=0.06)
    _, middle = arm_centres(place, sizes, np.array([0.0, 0.01, 0.55]), "right")
    np.testing.assert_allclose(middle, centre, atol=1e-12)
    _, palmar = arm_centres(place, measures_of(wrist=0.03), np.array([0.0, 0.01, 0.55]), "right")
    assert np.linalg.norm(palmar - centre) == pytest.approx(0.015 + 0.007)


def measures_of(*, wrist: float) -> Measures:
    sides = {"right": 0.9, "left": 0.9}
    widths = {
        f"{side}_{joint}": wrist if joint == "wrist" else 0.08
        for side in sides
        for joint in ("knee", "ankle", "elbow", "wrist")
    }
    return Measures(0.007, 0.25, 0.16, sides, sides, sides, widths, ())


def test_the_angles_of_a_chain_give_its_rotation_back() -> None:
    rng = np.random.default_rng(3)
    for count, order in ((1, "z"), (2, "zx"), (3, "zxy")):
        signs = rng.choice([-1.0, 1.0], count)
        axes = np.eye(3)[["xyz".index(letter) for letter in order]] * signs[:, None]
        angles = rng.uniform(-1.2, 1.2, count)
        rotation = np.eye(3)
        for letter, sign, angle in zip(order, signs, angles, strict=True):
            rotation = rotation @ elementary_rotation(letter, sign * angle)
        np.testing.assert_allclose(chain_angles(rotation, axes), angles, atol=1e-12)


def test_ranges_of_hip_and_trunk_follow_the_tilt_of_the_pelvis_markers() -> None:
    trial = standing_trial()
    names, xyz = trial.markers.names, trial.markers.xyz.copy()
    for label in ("LPSI", "RPSI"):
        xyz[:, names.index(label), 2] += 0.05
    upright, _ = scaled(SUBJECT, trial)
    tilted, q = scaled(SUBJECT, replace(trial, markers=Markers(names, trial.markers.time, xyz)))
    tilt = standing_tilt(q)
    assert np.degrees(tilt) == pytest.approx(np.degrees(np.arcsin(0.05 / np.hypot(0.05, 0.1878))), abs=0.5)
    hip, trunk = tilted.joint_index("right_hip_flexion"), tilted.joint_index("trunk_flexion")
    assert tilted.limits.upper[hip] - upright.limits.upper[hip] == pytest.approx(tilt, abs=1e-6)
    assert tilted.limits.lower[trunk] - upright.limits.lower[trunk] == pytest.approx(-tilt, abs=1e-6)


@pytest.mark.parametrize("joint", ["trunk_flexion", "trunk_bending", "right_hip_rotation", "left_ankle_inversion"])
def test_whoever_passes_the_anatomical_range_is_followed_exactly(joint: str) -> None:
    body, q = scaled(SUBJECT, standing_trial())
    stop = human(SUBJECT).limits.upper[body.joint_index(joint)]
    q[7 + body.joint_index(joint)] = stop + np.radians(20.0)
    there = Markers(body.markers.names, [0.0], poses(body, q[None]).points(body.markers.segment, body.markers.position))
    found = solve_ik(body, there)
    assert found.residual.max() < 1e-6
    assert found.q[0, 7 + body.joint_index(joint)] == pytest.approx(stop + np.radians(20.0), abs=1e-5)


def test_knees_and_elbows_still_do_not_bend_backwards() -> None:
    body, q = scaled(SUBJECT, standing_trial())
    for joint in ("right_knee_flexion", "left_knee_flexion", "right_elbow_flexion", "left_elbow_flexion"):
        j = body.joint_index(joint)
        assert body.limits.lower[j] == pytest.approx(min(human(SUBJECT).limits.lower[j], q[7 + j] - np.radians(5.0)))


def test_a_typed_width_that_contradicts_the_markers_is_warned_about() -> None:
    true = 2 * 0.5 * 0.13 * 1.75
    body, _ = scaled(SUBJECT, standing_trial(measurements={"InterAsisDistance": true - 0.08}))
    assert any("InterAsisDistance" in note and note.startswith("Warning") for note in body.notes)


def test_hidden_frames_of_the_static_do_no_harm() -> None:
    trial = standing_trial()
    xyz = trial.markers.xyz.copy()
    xyz[10:40, 3] = np.nan
    hidden = replace(trial, markers=Markers(trial.markers.names, trial.markers.time, xyz))
    a, b = scaled(SUBJECT, trial)[0], scaled(SUBJECT, hidden)[0]
    np.testing.assert_allclose(a.markers.position, b.markers.position, atol=1e-9)


@pytest.mark.parametrize("folder", [*STATICS, "adl_gait"])
def test_real_people_are_scaled_and_stand_under_their_markers(folder: str, data: Path) -> None:
    session = read_session(data / folder)
    (static,) = session.of_role("static")
    body, q = scaled(session.subject, prepare(static))
    found = poses(body, q[None]).points(body.markers.segment, body.markers.position)[0]
    measured = np.stack([np.nanmedian(prepare(static).markers[name], axis=0) for name in body.markers.names])
    assert np.median(np.linalg.norm(found - measured, axis=1)) < 0.003
    assert smallest_eigenvalues(body.sip.phi).min() > 0
    assert body.sip.mass.sum() == pytest.approx(session.subject.mass)


def test_a_typed_leg_that_the_markers_contradict_is_refused_aloud_and_does_not_move_the_hips() -> None:
    trial = standing_trial()
    shown = scaled(SUBJECT, trial)[0]
    legs = measure_static(SUBJECT, trial).sizes.leg_length
    typed = {"LLegLength": legs["left"] - 0.1, "RLegLength": legs["right"] - 0.01}
    wrong = scaled(SUBJECT, replace(trial, measurements=typed))[0]
    (said,) = (note for note in wrong.notes if isinstance(note, NotUsed))
    assert "LLegLength was typed as" in said
    hip = wrong.joint_index("left_hip_flexion")
    assert np.linalg.norm(wrong.joints[hip].translation - shown.joints[hip].translation) < 0.002

"""Neck, collar bones, turning forearms and wrists: chosen where markers left out show them, and moving what they
should.
"""

from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from biodance.body.body import Body, body_text, parse_body
from biodance.body.changes import parts_as_segments
from biodance.body.human.human import human
from biodance.body.human.skeleton import OPTIONAL_JOINTS, marker_groups, with_optional
from biodance.body.parts import RigidInertia, inertial_parameters, shift_matter, smallest_eigenvalues
from biodance.lab.markers.sets import read_marker_set
from biodance.motion.dynamics import joint_torques, predict_wrench
from biodance.motion.ik.functional_joints import NEED, with_shown_joints
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Motion, Sip, Source, Subject, Trial
from biodance.settings import Settings

LANDMARKS = read_marker_set("plug_in_gait").landmarks
SKIN = 0.003
"""m of random displacement of every marker."""
FRAMES = 40


@pytest.fixture(scope="module")
def plain() -> Body:
    return human(Subject(70.0, 1.75, "M"))


def wider(body: Body, *names: str) -> Body:
    return reduce(lambda one, name: with_optional(one, name, LANDMARKS), names, body)


def walked(body: Body, moved: dict[str, float], seed: int = 1) -> Array:
    """Return postures (T, nq): hips, shoulders and elbows swing, every other joint whose name starts as in ``moved`` by
    so many rad.
    """
    rng, q = np.random.default_rng(seed), np.tile(body.neutral, (FRAMES, 1))
    for i, joint in enumerate(body.joints):
        name = joint.name.removeprefix("right_").removeprefix("left_")
        usual = 0.3 if name in ("hip_flexion", "shoulder_flexion", "knee_flexion") else 0.0
        usual = 0.6 if name == "elbow_flexion" else usual
        size = next((size for start, size in moved.items() if name.startswith(start)), usual)
        q[:, 7 + i] = size * (1.0 + 0.5 * np.sin(np.linspace(0, 6, FRAMES) + rng.uniform(0, 6)))
    return q


def seen(body: Body, q: Array) -> Markers:
    """Return the markers of the body in the postures, with skin that slides."""
    place = poses(body, q).points(list(body.markers.segment), body.markers.position)
    noise = np.random.default_rng(3).normal(0, SKIN, place.shape)
    return Markers(body.markers.names, np.arange(len(q)) / 100.0, place + noise)


@pytest.mark.parametrize(
    ("moved", "expected"),
    [
        ({}, set()),
        ({"neck": 0.3}, {"neck"}),
        ({"elbow_pronation": 0.9}, {"forearms"}),
        ({"elbow_pronation": 0.9, "wrist": 0.5, "neck": 0.3, "clavicle": 0.3}, set(OPTIONAL_JOINTS)),
    ],
)
def test_exactly_the_joints_that_moved_are_shown(plain: Body, moved: dict[str, float], expected: set[str]) -> None:
    truth = wider(plain, *OPTIONAL_JOINTS)
    markers = seen(truth, walked(truth, moved))
    body, gains = with_shown_joints(plain, (markers,), LANDMARKS)
    assert {gain.name for gain in gains if gain.taken} == expected
    assert all(gain.fitted > NEED and gain.with_it < gain.without for gain in gains if gain.taken)
    # A marker that is left out of a least-squares fit lies farther from it than as one of it.
    assert all(gain.without > gain.fitted for gain in gains)
    motion = track(body, Trial("walk", "fit", markers, (), Source(Path("x"), "", "", 100.0), settings=Settings()))
    assert np.sqrt(np.mean(motion.residual**2)) < 2 * SKIN


def test_a_marker_set_without_head_and_wrists_shows_nothing(plain: Body) -> None:
    truth = wider(plain, *OPTIONAL_JOINTS)
    whole = seen(truth, walked(truth, {"neck": 0.3, "elbow_pronation": 0.9}))
    few = whole.select([name for name in whole.names if not name.endswith(("HD", "FRM", "WRA", "WRB", "FIN", "SHO"))])
    assert with_shown_joints(plain, (few,), LANDMARKS) == (plain, ())
    assert with_shown_joints(plain, (), LANDMARKS) == (plain, ())


def test_at_zero_angles_a_part_weighs_as_in_the_whole_and_moving_it_takes_its_own_wrench(plain: Body) -> None:
    body = wider(plain, *OPTIONAL_JOINTS)
    rng, count = np.random.default_rng(5), 6
    v, a = rng.normal(0, 1, (2, count, body.nv))
    old = [i for i, joint in enumerate(body.joints) if joint.name in {one.name for one in plain.joints}]
    new = np.setdiff1d(np.arange(len(body.joints)), old)
    q = np.tile(body.neutral, (count, 1))
    q[:, 7 + np.array(old)] = rng.normal(0, 0.4, (count, len(old)))
    v[:, 6 + new] = a[:, 6 + new] = 0.0
    few = np.concatenate([np.arange(6), 6 + np.array(old)])
    places = np.concatenate([np.arange(7), 7 + np.array(old)])
    time = np.arange(count) / 100.0
    still = predict_wrench(plain, Motion(time, q[:, places], v[:, few], a[:, few]))
    whole = predict_wrench(body, Motion(time, q, v, a))
    np.testing.assert_allclose(whole.value, still.value, atol=1e-9)
    q[:, 7 + new] = rng.normal(0, 0.3, (count, new.size))
    v[:, 6 + new], a[:, 6 + new] = rng.normal(0, 1, (2, count, new.size))
    motion = Motion(time, q, v, a)
    np.testing.assert_allclose(joint_torques(body, motion, {}).residual, predict_wrench(body, motion).value, atol=1e-6)
    assert np.abs(predict_wrench(body, motion).value - still.value).max() > 5


def test_parts_stand_in_a_file_and_as_segments_of_possible_mass(plain: Body) -> None:
    body = wider(plain, *OPTIONAL_JOINTS)
    again, _ = parse_body(body_text(body, "here"), "there")
    assert [part.name for part in again.parts] == ["head", "right_hand", "left_hand", "right_clavicle", "left_clavicle"]
    np.testing.assert_array_equal(again.sharing, body.sharing)
    index = body.segment_index("trunk_head")
    phi = np.array(body.sip.phi)
    flat = RigidInertia(phi[10 * index], body.sip.com[index], np.diag([0.4, 1e-6, 0.4]))  # thin as a wire
    phi[10 * index : 10 * index + 10] = inertial_parameters(flat)
    thin = parts_as_segments(replace(body, sip=Sip(body.segments, phi, body.sip.covariance)))
    assert smallest_eigenvalues(body.link_parameters(phi)).min() < -1e-3
    assert smallest_eigenvalues(thin.sip.phi).min() > -1e-9
    head, collars = thin.segment_index("head"), [thin.segment_index(f"{side}_clavicle") for side in ("right", "left")]
    total = np.array(thin.sip.phi[10 * index : 10 * index + 10])
    for part in (head, *collars):
        place = thin.joints[next(i for i, j in enumerate(thin.joints) if _first_of(thin, i, part))].translation
        total += shift_matter(place) @ thin.sip.phi[10 * part : 10 * part + 10]
    np.testing.assert_allclose(total, phi[10 * index : 10 * index + 10], atol=1e-9)


def _first_of(body: Body, joint: int, segment: int) -> bool:
    """Return whether a joint is the first of those that carry a segment on the trunk."""
    trunk, last = body.segment_joint[body.segment_index("trunk_head")], body.segment_joint[segment]
    while body.joints[last].parent != trunk:
        last = body.joints[last].parent
    return joint == last


def test_markers_are_judged_in_four_groups(plain: Body) -> None:
    for body in (plain, wider(plain, *OPTIONAL_JOINTS)):
        groups = dict(zip(body.markers.names, marker_groups(body), strict=True))
        wanted = {"RASI": "legs", "LTOE": "legs", "C7": "trunk", "RSHO": "trunk", "LFIN": "arms", "RELB": "arms"}
        assert {name: groups[name] for name in wanted} == wanted
        assert {groups[name] for name in groups if name.endswith("HD")} == {"head"}

"""The virtual person: physically possible, unlike the tables, the same on every day; loads and the merge to 12
segments keep all mass.
"""

import numpy as np
import pytest

from biodance.errors import BiodanceError, UnknownName
from biodance.motion.kinematics import poses
from biodance.records import Subject
from biodance.virtual_lab.person import (
    MERGED,
    AddedLoad,
    load_on,
    make_person,
    merged_sip,
    of_parameters,
    parameters_of_inertia,
    place_in_12,
    place_inertia,
    reference_angles,
    true_pseudo_inertia,
)
from biodance.virtual_lab.person.skeleton import PERFECT, TRUE_SEGMENTS, UPRIGHT_CHAIN, virtual_people

SUBJECTS = [Subject(45, 1.50, "F"), Subject(65, 1.75, "F"), Subject(80, 1.70, "M"), Subject(110, 1.95, "M")]


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda s: f"{s.sex}{s.mass:g}")
def test_a_person_is_physically_possible_and_adds_up(subject):
    person = make_person(subject, 3)
    assert person.body.sip.mass.sum() == pytest.approx(subject.mass, abs=1e-9)
    assert sum(person.size[name] for name in UPRIGHT_CHAIN) == pytest.approx(subject.stature, abs=1e-12)
    for segment in TRUE_SEGMENTS:
        assert np.linalg.eigvalsh(of_parameters(person.body.sip.of(segment))).min() > 0
    assert len(person.body.segments) == 16
    assert person.body.nv == 6 + 39


def test_masses_scatter_around_the_mean_by_the_stated_tolerance():
    thighs = [make_person(SUBJECTS[1], seed).body.sip.of("right_thigh")[0] for seed in range(60)]
    table = virtual_people()["segments"]["F"]
    mean = table["thigh"][0] / sum(
        row[0] * (1 if kind in ("pelvis", "lumbar", "thorax", "head") else 2) for kind, row in table.items()
    )
    assert np.mean(thighs) == pytest.approx(65 * mean, rel=0.05)
    assert 0.07 < np.std(thighs) / np.mean(thighs) < 0.16


def test_without_tolerances_the_person_is_the_mean_and_symmetric():
    sip = make_person(SUBJECTS[1], 3, tolerances=PERFECT).body.sip
    right, left = sip.of("right_thigh"), sip.of("left_thigh")
    np.testing.assert_allclose(right * np.array([1, 1, 1, -1, 1, 1, 1, -1, -1, 1]), left, atol=1e-12)


def test_the_same_person_on_another_day_has_the_same_body_and_other_markers():
    one, other = make_person(SUBJECTS[1], 5), make_person(SUBJECTS[1], 5, session=1)
    np.testing.assert_array_equal(one.body.sip.phi, other.body.sip.phi)
    apart = np.linalg.norm(one.body.markers.position - other.body.markers.position, axis=1)
    assert 0.002 < np.sqrt(np.mean(apart**2)) < 0.010
    assert not np.array_equal(one.body.sip.phi, make_person(SUBJECTS[1], 6).body.sip.phi)


def test_a_load_changes_its_segment_alone():
    load = AddedLoad("left_forearm", 2.4, np.array([0.0, -0.12, 0.0]))
    bare, loaded = make_person(SUBJECTS[1], 5), make_person(SUBJECTS[1], 5, loads=(load,))
    change = (loaded.loaded_body.sip.phi - bare.body.sip.phi).reshape(-1, 10)
    assert set(np.flatnonzero(np.abs(change).max(axis=1))) == {TRUE_SEGMENTS.index("left_forearm")}
    row = change[TRUE_SEGMENTS.index("left_forearm")]
    np.testing.assert_allclose(row[:4], [2.4, 0.0, -0.288, 0.0], atol=1e-12)
    assert row[9] == pytest.approx(2.4 * (0.12**2 + 2 * 0.03**2 - 0.03**2), rel=1e-9)
    assert loaded.mass == pytest.approx(67.4)


def test_loads_that_make_no_sense_are_refused():
    with pytest.raises(UnknownName, match="left_forearm"):
        AddedLoad("left_forarm", 1.0, np.zeros(3))
    with pytest.raises(BiodanceError, match=r"mass = 0"):
        AddedLoad("head", 0.0, np.zeros(3))


def test_pseudo_inertia_round_trip_and_change_of_frame():
    rng = np.random.default_rng(1)
    J = true_pseudo_inertia(2.0, np.array([0.1, -0.2, 0.05]), np.array([0.1, 0.06, 0.11]))
    np.testing.assert_allclose(of_parameters(parameters_of_inertia(J)), J, atol=1e-15)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = rng.normal(size=(50, 3))
    cloud = np.concatenate([points, np.ones((50, 1))], axis=1)
    moved = np.concatenate([points @ turn.T + 0.3, np.ones((50, 1))], axis=1)
    np.testing.assert_allclose(place_inertia(cloud.T @ cloud, turn, np.full(3, 0.3)), moved.T @ moved, atol=1e-10)


def test_the_merge_to_12_segments_keeps_mass_centre_and_kinetic_energy():
    person = make_person(SUBJECTS[3], 8)
    body, merged = person.body, merged_sip(person, person.body)
    assert merged.mass.sum() == pytest.approx(110, abs=1e-9)
    q = body.neutral
    q[7:] = reference_angles(person)
    pose = poses(body, q)
    fine = sum(
        place_inertia(of_parameters(body.sip.of(s)), pose.rotation[0, i], pose.position[0, i])
        for i, s in enumerate(TRUE_SEGMENTS)
    )
    coarse = np.zeros((4, 4))
    for segment, (joint, _) in MERGED.items():
        index = body.joint_index(joint) if joint else -1
        turn = pose.joint_rotation[0, index] if joint else pose.root_rotation[0]
        place = pose.joint_position[0, index] if joint else pose.root_position[0]
        coarse += place_inertia(of_parameters(merged.of(segment)), turn, place)
    np.testing.assert_allclose(coarse, fine, atol=1e-10)


@pytest.mark.parametrize("segment", list(MERGED))
def test_a_load_can_be_put_on_each_of_the_12_segments(segment):
    bare = make_person(SUBJECTS[1], 5)
    load = load_on(bare, segment, 1.0)
    loaded = make_person(SUBJECTS[1], 5, loads=(load,))
    change = (merged_sip(loaded, loaded.loaded_body).phi - merged_sip(bare, bare.body).phi).reshape(-1, 10)
    row = change[list(MERGED).index(segment)]
    assert row[0] == pytest.approx(1.0)
    named, place = place_in_12(loaded, load)
    assert named == segment
    np.testing.assert_allclose(row[1:4], place, atol=1e-12)
    away = np.linalg.norm(place - merged_sip(bare, bare.body).com[list(MERGED).index(segment)])
    assert away == pytest.approx(0.10 if segment in ("pelvis", "trunk_head") else 0.06)
    with pytest.raises(UnknownName, match="left_foot"):
        load_on(bare, "left_foott", 1.0)

"""Joints that the model lacks: a person who has them, read by a model without."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from human_cases import CORNERS, human_case, moving

from biodance.body.body import Body
from biodance.body.changes import recentre_joint, with_part
from biodance.body.human.human import human
from biodance.body.human.skeleton import collar_bone
from biodance.body.parts import JointError, shift_matter, smallest_eigenvalues
from biodance.diagnosis.accept import case_fit
from biodance.effects import UNLIKE, Case, effect
from biodance.effects.head_joint import HeadJoint
from biodance.effects.shoulder_girdle import ShoulderGirdle
from biodance.effects.trunk_joint import TrunkJoint
from biodance.identification.identification import identify_body
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.motion.track import smooth, track
from biodance.records import Array, Markers, Plate, Source, Subject, Trial

KINDS = {
    "head_joint": HeadJoint.extended_body,
    "trunk_joint": TrunkJoint.extended_body,
    "shoulder_girdle": ShoulderGirdle.extended_body,
}
INSIDE = slice(60, -60)


def longer(body: Body, extended: Body, q: Array) -> Array:
    """Return the postures ``q`` of a body as those of the extended one, new joints at zero."""
    old = [joint.name for joint in body.joints]
    out = np.zeros((len(q), extended.nq))
    out[:, :7] = q[:, :7]
    for i, joint in enumerate(extended.joints):
        if joint.name in old:
            out[:, 7 + i] = q[:, 7 + old.index(joint.name)]
    return out


def person(name: str, size: float) -> tuple[Case, Array]:
    """Return a trial of a person who moves the joint by ``size`` rad rms, tracked without it, and the wrench (T, 6)
    of that motion; a movement has placed the trunk.
    """
    rng = np.random.default_rng(4)
    body = replace(human(Subject(70, 1.75, "M", 30)), joint_errors=(JointError("trunk", 0.004, 0.0),))
    extended = KINDS[name](human_case(120))
    assert extended is not None
    time = np.arange(400) / 100
    q = longer(body, extended, moving(body, 400, rng))
    new = [i for i, joint in enumerate(extended.joints) if joint.name not in [j.name for j in body.joints]]
    for k, i in enumerate(new):
        q[:, 7 + i] = size * np.sqrt(2) * np.sin(2 * np.pi * (0.5 + 0.2 * k) * time + k)
    markers = Markers(
        body.markers.names, time, poses(extended, q).points(extended.markers.segment, extended.markers.position)
    )
    true = predict_wrench(extended, smooth(extended, time, q))
    trial = Trial("t", "fit", markers, (Plate("plate1", 2, CORNERS, true),), Source(Path(__file__), "", "test"))
    case = Case(body, trial, track(body, trial), body.sip.phi, np.linspace(0, 1, 400))
    return case, case.residual


@pytest.mark.parametrize("name", KINDS)
def test_body_with_the_joint_is_the_same_body_at_zero(name: str) -> None:
    case = human_case(120)
    extended = KINDS[name](case)
    assert extended is not None
    motion = smooth(extended, case.motion.time, longer(case.body, extended, case.motion.q))
    plain = smooth(case.body, case.motion.time, case.motion.q)
    np.testing.assert_allclose(
        predict_wrench(extended, motion).value, predict_wrench(case.body, plain).value, atol=1e-8
    )
    assert extended.sip.mass.sum() == pytest.approx(case.body.sip.mass.sum())
    assert (smallest_eigenvalues(extended.sip.phi) > 0).all()
    assert (extended.com_boxes[:, 0] < extended.sip.com).all()
    assert (extended.com_boxes[:, 1] > extended.sip.com).all()


@pytest.mark.parametrize("name", KINDS)
def test_the_parts_are_together_the_whole_whatever_it_weighs(name: str) -> None:
    case, rng = human_case(120), np.random.default_rng(3)
    extended = KINDS[name](case)
    assert extended is not None
    old, whole = (
        case.body.segment_index("trunk_head"),
        case.body.sip.phi * rng.uniform(0.8, 1.2, case.body.sip.phi.size),
    )
    links = extended.link_parameters(whole).reshape(-1, 10)
    together = links[old].copy()
    for k in range(len(case.body.segments), len(links)):
        _, place = extended.place_on_segment(extended.segment_joint[k])
        together += shift_matter(place) @ links[k]
    np.testing.assert_allclose(together, whole.reshape(-1, 10)[old], atol=1e-9)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_collar_bone_is_asked_for_where_the_other_one_moves_already(side: str) -> None:
    case, other = human_case(120), "left" if side == "right" else "right"
    both = KINDS["shoulder_girdle"](case)
    assert both is not None
    one = with_part(case.body, collar_bone(case.body, side))
    asked = KINDS["shoulder_girdle"](replace(case, body=one))
    assert asked is not None
    assert [joint.name for joint in asked.joints if joint.name not in [j.name for j in one.joints]] == [
        f"{other}_clavicle_elevation",
        f"{other}_clavicle_protraction",
    ]
    assert KINDS["shoulder_girdle"](replace(case, body=both)) is None


def test_what_is_unlike_the_table_goes_along_with_the_thorax() -> None:
    case = human_case(120)
    extended = KINDS["trunk_joint"](case)
    assert extended is not None
    old, change = 10 * case.body.segment_index("trunk_head"), np.zeros(case.body.sip.phi.size)
    change[old + 1] = 0.2  # kg m: matter of the trunk farther ahead, nothing heavier
    links = extended.link_parameters(change).reshape(-1, 10)
    np.testing.assert_allclose(links[-1][:4], [0.0, 0.2, 0.0, 0.0], atol=1e-12)
    assert not np.delete(links, -1, axis=0).any()


@pytest.mark.parametrize("name", KINDS)
def test_accepting_the_joint_identifies_the_body_that_has_it(name: str) -> None:
    case, _ = person(name, 0.12)
    right = effect(name).at("", case).corrected(case, np.array([0.12, 0.0]))
    use = np.zeros(400, dtype=bool)
    use[INSIDE] = True
    found = identify_body(right.body, (case_fit(right, use),))
    assert found.status == "solved", found.cause
    assert all(np.isfinite([known.value, known.sd]).all() for known in found.known)
    assert max(known.from_data for known in found.known if known.quantity == "mass") > 0.3
    assert np.abs(found.sip.mass - right.body.sip.mass).max() < 1.0, "the table's masses are the true ones"


@pytest.mark.parametrize("name", KINDS)
def test_markers_show_the_joint_and_the_wrench_follows(name: str) -> None:
    case, residual = person(name, 0.12)
    found = effect(name).at("", case)
    shown = found.shown(case)
    assert shown is not None
    assert shown[0] == pytest.approx(0.12, rel=0.12)
    explained = 0.12 * found.columns(case)[INSIDE, :, 0]
    before = np.linalg.norm(residual[INSIDE])
    assert np.linalg.norm(residual[INSIDE] - explained) < 0.2 * before
    right = found.corrected(case, shown)
    assert np.linalg.norm(right.residual[INSIDE]) < 0.1 * before


def higher_trunk(far: float) -> Case:
    """Return a squat of a person whose trunk bends ``far`` m above the model's joint, which no movement has placed."""
    model = human(Subject(70, 1.75, "M", 30))
    true = recentre_joint(model, model.joint_index("trunk_flexion"), np.array([0.0, far, 0.0]))
    time = np.arange(600) / 100
    q = np.tile(true.neutral, (600, 1))
    q[:, 7 + true.joint_index("trunk_flexion")] = -0.25 * (1 - np.cos(np.pi * time))
    markers = Markers(true.markers.names, time, poses(true, q).points(true.markers.segment, true.markers.position))
    wrench = predict_wrench(true, smooth(true, time, q))
    trial = Trial("t", "fit", markers, (Plate("plate1", 2, CORNERS, wrench),), Source(Path(__file__), "", "test"))
    return Case(model, trial, track(model, trial), model.sip.phi, np.linspace(0, 1, 600))


def test_a_trunk_that_bends_elsewhere_is_no_second_joint() -> None:
    case = higher_trunk(0.06)
    found = effect("trunk_joint").at("", case)
    shown = found.shown(case)
    assert shown is not None
    assert shown[0] == 0.0
    placed = replace(case, body=replace(case.body, joint_errors=(JointError("trunk", 0.004, 0.0),)))
    shown = found.shown(placed)
    assert shown is not None
    assert shown[0] > 0.07


def test_the_size_reported_is_the_one_shown_and_the_wrenchs_sum_stays() -> None:
    case, _ = person("head_joint", 0.2)
    found = effect("head_joint").at("", case)
    angle, beyond = found.measured(np.array([0.07, -0.03]), case)
    assert angle == pytest.approx(0.2, rel=0.12)
    assert angle + beyond == pytest.approx(0.04)


@pytest.mark.parametrize("name", KINDS)
def test_without_its_markers_there_is_no_target(name: str) -> None:
    case = human_case(120)
    assert case.trial.markers is not None
    few = case.trial.markers.select(
        n for n in case.trial.markers.names if not n.endswith(("HD", "SHO")) and n not in ("C7", "CLAV")
    )
    blind = replace(case, trial=replace(case.trial, markers=few))
    assert effect(name).targets(blind) == ()
    assert not effect(name).columns(blind).any(), "a trial of a session in which others have the markers"


def test_a_joint_that_markers_and_wrench_show_opposite_ways_is_none() -> None:
    girdle = effect("shoulder_girdle")
    assert girdle.possible(np.array([0.2, -0.1]))
    assert not girdle.possible(np.array([0.04, -0.067]))


def test_still_joint_adds_nothing() -> None:
    case, _ = person("head_joint", 0.0)
    found = effect("head_joint").at("", case)
    shown = found.shown(case)
    assert shown is not None
    assert shown[0] == 0


@pytest.mark.parametrize("name", [*KINDS, "marker_misplaced"])
def test_the_wrench_of_what_markers_show_is_known_poorly(name: str) -> None:
    """The size shown is known to 6 to 50 %; that says nothing of the wrench, which the joint's place decides."""
    assert 0.4 <= effect(name).unlike <= 0.6
    assert effect("plate_gain").unlike == UNLIKE < 0.4

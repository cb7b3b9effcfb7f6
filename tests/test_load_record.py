"""One load, one record: page, terminal and JSON name the same segments, kilograms, interval and place."""

from dataclasses import replace

import numpy as np
import pytest
from found_loads import GAIN, NOTHING, OWN, found
from human_cases import human_case
from identified_sessions import session_result

from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.effects.added_mass import AddedMass
from biodance.identification.loads import nearest_segment
from biodance.motion.kinematics import poses
from biodance.pipeline.diagnosis import with_load, with_weighed_load
from biodance.pipeline.results import SessionDiagnosis
from biodance.pipeline.trial import Check
from biodance.pipeline.words import alternatives, in_words, say_load
from biodance.report.tables.diagnosis import diagnosis_document
from biodance.report.tables.identification import added_mass_document
from biodance.report.wording import sizes_in_words

FOREARM = (("left_forearm_hand", 0.8), ("left_upper_arm", 0.2))


@pytest.mark.parametrize("named", [(), (OWN,)])
def test_the_finding_is_the_record_of_the_search(named: tuple[Finding, ...]) -> None:
    search = found(*FOREARM)
    told = with_load(replace(NOTHING, findings=named), search)
    record, (one,) = added_mass_document(search), told.findings
    numbers = diagnosis_document(SessionDiagnosis(told))["findings"][0]
    assert one.target == numbers["target"] == record["segment"] == "left_forearm_hand"
    assert numbers["parameters"]["mass"]["value"] == record["kg"]
    assert tuple(numbers["parameters"]["mass"]["ci95"]) == tuple(record["ci95_kg"])
    np.testing.assert_array_equal(numbers["parameters"]["place"]["value"], record["place_m"])
    assert [a["target"] for a in numbers["set"]] == list(record["set"]) == [name for name, _ in FOREARM]
    assert in_words(one) == "added mass left forearm with hand or left upper arm (mass 2.4 ± 0.6 kg)"
    assert sizes_in_words(numbers["parameters"]) == "mass 2.40 ± 0.59 kg, place 10, −120, 20 ± 2, −24, 4 mm"
    assert "2.40 kg on the left forearm with hand (80 % probable) or left upper arm" in say_load(search)


def test_a_load_is_never_beside_nothing_wrong() -> None:
    assert with_load(NOTHING, found(*FOREARM)).verdict == "named, complete"
    assert with_load(replace(NOTHING, explained=False), found(*FOREARM)).verdict == "named, incomplete"
    assert with_load(NOTHING, None) is NOTHING
    assert with_load(NOTHING, replace(found(*FOREARM), p_no_load=0.9)) is NOTHING


def test_weight_that_a_gain_explains_is_no_second_cause() -> None:
    told = with_load(replace(NOTHING, explained=True, findings=(GAIN,)), found(*FOREARM))
    (one,) = told.findings
    assert (one.effect, [a.effect for a in one.set]) == ("plate_gain", ["plate_gain", "added_mass", "added_mass"])
    assert alternatives(one) == ["a load"]
    assert in_words(one) == "plate gain Fz (gain 4 ± 2 %)"


HEAVY = Finding(
    "body_mass",
    "",
    (Estimate("error", 2.3, 0.5, "kg"),),
    (Alias("body_mass", "", 9.0), Alias("added_mass", "", 9.0)),
    1.0,
)


def test_a_load_of_which_only_the_weight_is_known_lies_where_the_search_says() -> None:
    weighed = replace(NOTHING, explained=False, findings=(HEAVY,))
    (sure,) = with_load(weighed, found(*FOREARM)).findings
    assert (sure.effect, sure.target, sure.parameters[0].value) == (
        "added_mass", "left_forearm_hand", found(*FOREARM).best.mass
    )  # fmt: skip
    assert [a.effect for a in sure.set] == ["added_mass", "added_mass", "body_mass"]
    (likely,) = with_load(weighed, replace(found(*FOREARM), p_no_load=0.3)).findings
    assert likely.effect == "added_mass"
    for other in (replace(found(*FOREARM), p_no_load=0.8), found(*FOREARM, doubts=("Far.",))):
        (one,) = with_load(weighed, other).findings
        assert (one.effect, one.parameters) == ("body_mass", HEAVY.parameters)
        assert [(a.effect, a.target) for a in one.set[1:]] == [("added_mass", name) for name, _ in FOREARM]


def test_a_load_that_was_found_goes_before_a_gain_that_is_not_told_from_it() -> None:
    same = replace(GAIN, set=(*GAIN.set, Alias("added_mass", "trunk_head", 8.0)))
    (one,) = with_load(replace(NOTHING, explained=True, findings=(same,)), found(*FOREARM)).findings
    assert [a.effect for a in one.set] == ["added_mass", "added_mass", "plate_gain"]
    unsure = replace(NOTHING, explained=True, findings=(same,))
    assert with_load(unsure, replace(found(*FOREARM), p_no_load=0.3)).findings == (same,)


def test_a_place_on_another_segment_widens_the_set() -> None:
    sure = found(("trunk_head", 0.99), ("pelvis", 0.01))
    assert sure.segments == ("trunk_head",)
    other = replace(sure, lies_on="pelvis")
    assert other.segments == ("trunk_head", "pelvis")
    text = say_load(other)
    assert "on the trunk with head (99 % probable) or pelvis" in text
    assert "there the pelvis is nearer" in text
    record = added_mass_document(other)
    assert (record["segment"], record["place_on"], record["set"]) == ("trunk_head", "pelvis", ("trunk_head", "pelvis"))


def test_the_nearest_segment_is_the_one_whose_box_holds_the_place_while_the_person_moves() -> None:
    result = session_result()
    body, motion = result.body, next(one.motion for one in result.trials if one.motion is not None)
    for name in body.segments:
        middle = body.boxes[body.segment_index(name)].mean(axis=0)
        assert nearest_segment(body, (motion,), name, middle) == name
    pose, shank, thigh = poses(body, motion.q[:1]), *(body.segment_index(f"left_{n}") for n in ("shank", "thigh"))
    lab = pose.points([thigh], body.boxes[thigh].mean(axis=0)[None])[0, 0]
    place = pose.rotation[0, shank].T @ (lab - pose.position[0, shank])  # on the thigh, in the shank's frame
    assert nearest_segment(body, (motion,), "left_shank", place) == "left_thigh"
    assert nearest_segment(body, (motion,), "left_shank", np.full(3, np.nan)) == ""


def test_the_weight_of_a_load_that_is_named_is_no_doubt_about_it() -> None:
    result = session_result()
    weighed = Check("mass on the plates against declared", "static", "3.9 %", "at most 2 %", False, "Weigh again.")
    doubt = "mass on the plates against declared, static: 3.9 % (at most 2 %). Weigh again."
    search = found(*FOREARM, doubts=(doubt,))
    session = replace(result, checks=(weighed,), identification=replace(result.identification, search=search))
    assert with_weighed_load(session, NOTHING) is session
    named = with_weighed_load(session, replace(NOTHING, findings=(OWN,)))
    assert named.identification.search.found
    far = replace(session, identification=replace(session.identification, search=replace(search, doubts=("Far.",))))
    assert with_weighed_load(far, replace(NOTHING, findings=(OWN,))) is far


def test_the_place_that_a_finding_tells_is_where_its_load_pulls() -> None:
    case = human_case()
    effect = AddedMass("left_shank")
    theta = np.array([2.0, 0.03, -0.1, 0.05])
    told = dict(zip("mxyz", theta + effect.origin(case), strict=True))
    segment = case.body.segment_index("left_shank")
    place = np.array([told[axis] for axis in "xyz"])
    wrench = effect.added(case, theta)
    point = case.poses.points([segment], place[None])[:, 0]
    moment = np.cross(point, wrench[:, :3])
    assert np.abs(wrench[:, 3:] - moment).max() < 0.02 * np.abs(moment).max()  # what is left turns a ball of 40 mm


@pytest.mark.parametrize(
    ("smallest", "told"),
    [
        ((1.0, 8.7), "1.0 kg (left foot) to 8.7 kg (trunk with head)."),
        ((1.0, np.inf), "cases: 1.0 kg (left foot); none of any size on trunk with head."),
        ((np.inf, np.inf), "in half of the cases: none of any size on left foot, trunk with head."),
    ],
)
def test_no_size_is_infinite(smallest: tuple[float, float], told: str) -> None:
    search = found(("left_foot", 0.6), ("trunk_head", 0.4))
    suspects = tuple(replace(one, smallest=size) for one, size in zip(search.suspects, smallest, strict=True))
    said = say_load(replace(search, suspects=suspects, p_no_load=0.9, reference="the table"))
    assert said.startswith("No load is found")
    assert said.endswith(told)

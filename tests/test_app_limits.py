"""The form for a person's limits: every template as it was, what is changed and nothing else, and what is not legal."""

import tomllib
from pathlib import Path

import pytest

from biodance.app.limits import limits_form, limits_text
from biodance.dance.problem.person import limits_in, named_movement, read_person
from biodance.errors import BiodanceError, UnknownName
from biodance.library import folder, names

FORM = limits_form()
TEMPLATES = names("protocols/limits")


def shipped(template: str) -> Path:
    return folder("protocols") / "limits" / f"{template}.toml"


@pytest.mark.parametrize("template", TEMPLATES)
def test_a_template_that_nobody_changed_is_written_as_it_was(template: str) -> None:
    assert limits_text(template, FORM["templates"][template]) == shipped(template).read_text(encoding="utf-8")


@pytest.mark.parametrize("template", TEMPLATES)
def test_from_nobody_the_same_person_is_written(template: str, tmp_path: Path) -> None:
    path = tmp_path / "person.toml"
    path.write_text(limits_text("nobody", FORM["templates"][template]), encoding="utf-8")
    given, same = read_person(path), read_person(shipped(template))
    assert {*given.ranges} == {*same.ranges}
    assert (given.reason, given.care, given.rest, given.bearing) == (same.reason, same.care, same.rest, same.bearing)
    assert (given.alone, given.hands_low, given.max_speed) == (same.alone, same.hands_low, same.max_speed)
    assert dict(given.strengths) == dict(same.strengths)


def test_one_side_is_changed_and_its_comment_stays() -> None:
    values = {**FORM["templates"]["old"]}
    values["at_most_deg"] = {**values["at_most_deg"], "left_arm_lift": 60}
    text = limits_text("old", values)
    assert tomllib.loads(text)["at_most_deg"] == {
        "trunk_turn": 25,
        "knee_bend": 60,
        "right_arm_lift": 100,
        "left_arm_lift": 60,
    }
    assert "rest_after_s = 25                       # s of dancing after which" in text


def test_what_is_taken_out_of_the_form_is_not_in_the_file() -> None:
    values = {**FORM["templates"]["stroke"], "cannot": [], "reason": "", "strength": {}}
    assert not {"cannot", "reason", "strength"} & set(tomllib.loads(limits_text("stroke", values)))


def test_what_is_new_comes_with_what_it_means() -> None:
    values = {"seat_height_m": 0.6, "weight_bearing": {"left": 0.7}, "strength": {"left_arm": "grade 4"}}
    text = limits_text("nobody", values)
    assert tomllib.loads(text) == values
    assert text.count("#") == 7  # four lines of what such a file is, three of what a value is
    assert limits_in(values, Path("form")).strengths == (("left_arm", 0.6),)


def test_everything_that_the_form_asks_can_be_read() -> None:
    for one in FORM["movements"]:
        named, isb = named_movement(one["key"]), named_movement(one["isb"])
        assert set(isb) <= set(named)  # leaning and turning go to both sides
    sides = [f"{side}_{one['key']}" for one in FORM["strengths"] if one["sided"] for side in FORM["sides"]]
    person = limits_in({"cannot": [*FORM["cannot"]], "strength": dict.fromkeys(sides, "grade 3")}, Path("form"))
    assert person.seated
    assert {share for _, share in person.strengths} == {0.25}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"seat_height_m": 60}, "seat_height_m = 60; it must be positive and lie between 0.3 and 1.2"),
        ({"at_most_deg": {"left_arm_forward": 300}}, "0 to 180 degrees"),
        ({"strength": {"left_arm": "grade 2"}}, "grade 5, grade 4, grade 3"),
        ({"strength": {"left_arm": "weak"}}, "a share from 0 to 1"),
    ],
)
def test_what_is_not_legal_is_said(values: dict, said: str) -> None:
    with pytest.raises(BiodanceError, match=said.replace(".", r"\.")):
        limits_text("nobody", values)


def test_other_names_are_refused_with_the_legal_ones() -> None:
    with pytest.raises(UnknownName, match="stroke"):
        limits_text("headache", {})
    with pytest.raises(UnknownName, match="seat_height_m"):
        limits_text("nobody", {"seat": 1})

"""A leg that is lighter than the other is a sentence, and can be declared, as what is worn can: the body of a
prosthesis, the keys of session.toml, and the way through `biodance identify`.
"""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effect_cases import CASES
from hidden_faults import hidden
from identified_sessions import SUBJECT, body
from lab_sessions import said, two_trials

from biodance.body.body import Body
from biodance.cli import run
from biodance.effects.unequal_limbs import UnequalLimbs
from biodance.errors import BiodanceError, SessionRefused, UnknownName
from biodance.identification.loads import (
    more_probable_table,
    possible_tables,
    segments_beyond,
    with_declared_limbs,
    with_open_limb,
)
from biodance.identification.posterior import Information
from biodance.lab.session.read import read_session
from biodance.motion.kinematics import poses
from biodance.pipeline.accepted import write_corrected
from biodance.records import Motion
from biodance.uncertainty.caution import widened_prior
from biodance.virtual_lab.person import make_person, with_prostheses

TRIALS = ("static", "move_1", "move_3", "move_5", "squat_1")
LESS = 2.0


def mass_sd(one: Body, name: str) -> float:
    """Return the standard deviation (kg) of the mass of a segment before the data."""
    at = 10 * one.segment_index(name)
    return float(widened_prior(one.sip).covariance[at, at] ** 0.5)


def unequal_thighs(one: Body) -> Information:
    """Return data that show the masses of both thighs, the right one 2 kg heavier than the table's, to 50 g."""
    rows, true = np.zeros((3, 121)), np.array(one.sip.phi)
    rows[0, 10], rows[1, 40], rows[2, :-1:10] = 20.0, 20.0, 20.0
    true[[10, 40]] += 2.0, -2.0
    rows[:, -1] = rows[:, :-1] @ true
    return Information(np.linalg.qr(np.vstack([rows, np.zeros((121, 121))]), mode="r"), 3)


def test_a_prosthesis_is_open_below_its_joint_and_all_else_stays_known():
    plain, open_ = body(), with_open_limb(body(), "left_shank")
    assert [plain.segments[i] for i in segments_beyond(plain, "left_shank")] == ["left_shank", "left_foot"]
    assert [plain.segments[i] for i in segments_beyond(plain, "right_foot")] == ["right_foot"]
    np.testing.assert_array_equal(open_.sip.phi, plain.sip.phi)
    for name, mass in zip(plain.segments, plain.sip.mass, strict=True):
        if name in ("left_shank", "left_foot"):
            assert mass_sd(open_, name) > 0.49 * mass
        else:
            assert mass_sd(open_, name) < max(1.2 * mass_sd(plain, name), 0.35 * mass)
    total = np.tile(np.eye(10)[0], 12)
    sure, now = (float(total @ one.sip.covariance @ total) for one in (plain, open_))
    assert now == pytest.approx(sure, abs=1e-9)  # what the whole body weighs is as known as before
    table = widened_prior(open_.sip)
    for one, sides in ((table, False), (widened_prior(plain.sip), True)):  # where a limb is open, nobody asks
        alone = replace(plain, at_joint=None)
        assert more_probable_table(unequal_thighs(plain), possible_tables(one, alone), alone)[1] is sides


def test_what_is_worn_is_known_and_the_person_is_lighter_by_it():
    worn = replace(SUBJECT, devices={"right_shank": 0.6}, prosthesis="left_foot")
    found, source = with_declared_limbs(body(), worn)
    change = found.sip.mass - body().sip.mass * (SUBJECT.mass - 0.6) / SUBJECT.mass
    np.testing.assert_allclose(change, 0.6 * (np.array(body().segments) == "right_shank"), atol=1e-9)
    assert found.sip.mass.sum() == pytest.approx(SUBJECT.mass)
    assert mass_sd(found, "right_shank") < 1.2 * mass_sd(body(), "right_shank")
    assert "0.6 kg on the right shank" in source
    assert "From the left foot on it is a prosthesis" in source


def test_a_leg_that_is_lighter_carries_less_on_its_side():
    """By hand: standing still, d kg fewer at the middle of one leg, g of them at that of the other, the rest at that of
    the rest; the weight stays.
    """
    case = CASES["human"]
    still = replace(case, motion=Motion(case.motion.time, case.motion.q, 0 * case.motion.v, 0 * case.motion.a))
    effect = UnequalLimbs("left_shank")
    lost = effect.added(still, np.array([1.5, 0.2, 0.0]))
    np.testing.assert_allclose(lost[:, :3], 0.0, atol=1e-9)
    every = list(range(12))
    place = poses(still.body, still.motion.q).points(every, still.body.sip.com)
    mass, middle = still.phi[::10], {}
    for name in ("left", "right"):
        limb = [still.body.segment_index(f"{name}_{end}") for end in ("shank", "foot")]
        middle[name] = np.average(place[:, limb], axis=1, weights=mass[limb])
    rest = [i for i, name in enumerate(still.body.segments) if not name.endswith(("shank", "foot"))]
    middle["rest"] = np.average(place[:, rest], axis=1, weights=mass[rest])
    first = 1.5 * (-0.8 * middle["left"] + 0.2 * middle["right"] + 0.6 * middle["rest"])
    np.testing.assert_allclose(lost[:, 3:5], 9.80665 * np.stack([first[:, 1], -first[:, 0]], axis=1), atol=1e-9)
    assert not effect.possible_in(still, np.array([-1.0, 0.0, 0.0]))
    assert not effect.possible_in(still, np.array([6.0, 0.0, 0.0]))
    knee = poses(still.body, still.motion.q[:1]).position[0, still.body.segment_index("left_shank")]
    above = float(np.linalg.norm(middle["left"][0] - knee))
    for place, possible in ((-above - 0.01, False), (-above + 0.01, True), (0.3, True), (0.4, False)):
        assert effect.possible_in(still, np.array([1.5, 0.2, place])) is possible


def test_a_virtual_prosthesis_is_lighter_and_nearer_to_the_knee_and_the_scale_says_the_same():
    person = make_person(SUBJECT, 7)
    whole, fitted = (with_prostheses(person, limbs).body.sip for limbs in ({}, {"right_shank": 1.2}))
    before, after = (dict(zip(one.segments, one.mass, strict=True)) for one in (whole, fitted))
    lost = [before[name] - after[name] for name in ("right_shank", "right_foot")]
    assert sum(lost) == pytest.approx(1.2)
    assert sum(after.values()) == pytest.approx(sum(before.values()))
    assert after["left_shank"] > before["left_shank"]
    index = whole.segments.index("right_shank")
    assert fitted.com[index, 1] == pytest.approx(0.85 * whole.com[index, 1])
    with pytest.raises(UnknownName, match="prosthesis"):
        with_prostheses(person, {"right_thigh": 1.0})
    with pytest.raises(BiodanceError, match="the limb weighs"):
        with_prostheses(person, {"right_foot": 3.0})


def test_prosthesis_and_devices_are_read_and_come_on_top_of_the_declared_mass(tmp_path: Path):
    folder = two_trials(tmp_path)
    text = '[subject]\nmass_kg = 61.4\nheight_m = 1.7\nsex = "F"\nprosthesis = "left_shank"\n'
    (folder / "session.toml").write_text(f"{text}[devices]\nright_shank = 0.6\n")
    session = read_session(folder)
    assert session.subject.mass == pytest.approx(62.0)
    assert (session.subject.prosthesis, dict(session.subject.devices)) == ("left_shank", {"right_shank": 0.6})
    assert "0.6 kg on the right shank are worn and come on top of the 61.4 kg declared: 62 kg" in said(session)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[subject]\nprosthesis = "left_shin"', "left_shank"),
        ('[subject]\nprosthesis = "pelvis"', "arm or leg"),
        ("[subject]\nprosthesis = true", "left_shank"),
        ("[devices]\nright_shin = 0.6", "right_shank"),
        ("[devices]\nright_shank = 600", "above 0 and at most 30 kg"),
        ("[devices]\nright_shank = -1", "above 0"),
        ('[devices]\nright_shank = "0.6"', "right_shank = '0.6'"),
        ('[devices]\nleft_shank = 0.6\n[subject]\nprothesis = "left_shank"', "Did you mean 'prosthesis'"),
    ],
)
def test_a_wrong_name_or_mass_is_refused_with_what_is_legal(text: str, told: str, tmp_path: Path):
    folder = two_trials(tmp_path)
    (folder / "session.toml").write_text(text)
    with pytest.raises(SessionRefused, match=r"session\.toml") as refused:
        read_session(folder)
    assert told in str(refused.value)


def identified(folder: Path, out: Path) -> tuple[dict, str]:
    """Return results.json and the page of `biodance identify`."""
    run(["identify", str(folder), "--out", str(out)])
    return json.loads((out / "results.json").read_text()), (out / "report.html").read_text()


def test_an_amputee_is_told_so_and_identified_as_one_and_as_well_where_it_is_declared(tmp_path: Path):
    folder = hidden(tmp_path / "S01", f"unequal_limbs:target=left_shank,lighter={LESS}", trials=TRIALS)
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    true = {row["name"]: row["mass_kg"] for row in truth["segments_12"]}
    found, page = identified(folder, tmp_path / "found")
    one = next(row for row in found["corrected"] if row["effect"] == "unequal_limbs")
    assert (one["target"], one["unit"]) == ("left_shank", "kg")
    apart = sum(true[f"right_{end}"] - true[f"left_{end}"] for end in ("shank", "foot"))
    assert abs(one["value"] - apart) < 2 * one["sd"] < 1.5
    assert "left open when the body was fitted, in all trials: the left leg below the knee is" in page
    assert "lighter than the right" in page
    (folder / "session.toml").write_text(
        (folder / "session.toml").read_text().replace("[subject]", '[subject]\nprosthesis = "left_shank"')
    )
    declared, page = identified(folder, tmp_path / "declared")
    assert "unequal_limbs" not in {row["effect"] for row in declared["corrected"]}
    assert "From the left shank on it is a prosthesis" in page
    for told in (found, declared):
        rows = {row["name"]: row for row in told["segments"]}
        leg = sum(rows[f"left_{end}"]["mass_kg"] for end in ("shank", "foot"))
        assert abs(leg - true["left_shank"] - true["left_foot"]) < 0.7  # the table's leg is LESS kg too heavy
        assert told["added_mass"] is None


def test_a_corrected_copy_says_what_was_declared(tmp_path: Path):
    folder = two_trials(tmp_path)
    text = '[subject]\nmass_kg = 61.4\nheight_m = 1.7\nsex = "F"\nprosthesis = "left_shank"\n'
    (folder / "session.toml").write_text(f"{text}[devices]\nright_shank = 0.6\n")
    write_corrected(read_session(folder), (), (), tmp_path / "corrected")
    said = tomllib.loads((tmp_path / "corrected" / "session.toml").read_text())
    assert said["subject"]["mass_kg"] == pytest.approx(61.4)
    assert (said["subject"]["prosthesis"], said["devices"]) == ("left_shank", {"right_shank": 0.6})

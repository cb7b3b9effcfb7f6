"""The feet of a dance and the force plate: they fit on it with room around, or the plate is refused; and it is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import small_dance
from walkers import Stand, plate, walker

from biodance.body.human.human import human
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan, read_plan
from biodance.errors import BiodanceError
from biodance.pipeline.dance_result import plate_sentence, plates_too_small
from biodance.records import Session, Subject
from biodance.report.feedback.write import scene_of

TALL = human(Subject(110.0, 1.80, "M", 40.0))


def occupied(plan: Plan) -> np.ndarray:
    """Return the sides (2,) m, side to side and ahead, of the box around all soles that stand."""
    soles = [stance.soles[side] for stance in support_sequence(TALL, plan) for side in stance.planted]
    return np.ptp(np.concatenate(soles)[:, :2], axis=0)[::-1]


def test_every_dance_of_people_is_made_for_the_usual_plate_unless_it_says_otherwise(tmp_path: Path) -> None:
    assert read_plan("short").plate == read_plan("full").plate == (0.40, 0.60)
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\nplate_m = [0.464, 0.508]\n[postures]\nparallel = 3\n')
    assert read_plan(own).plate == (0.464, 0.508)


def test_a_tall_mans_feet_fit_on_the_usual_plate_and_did_not_without_it() -> None:
    plan = read_plan("short")
    side, ahead = occupied(plan)
    assert side == pytest.approx(0.40 - 2 * 0.025)
    assert ahead < 0.60 - 2 * 0.025
    assert occupied(replace(plan, plate=None))[0] > 0.40


def test_a_plate_that_is_large_enough_moves_no_foot() -> None:
    plan = read_plan("short")
    free, large = (support_sequence(TALL, replace(plan, plate=size)) for size in (None, (0.6, 0.6)))
    for one, other in zip(free, large, strict=True):
        np.testing.assert_array_equal(one.ankle, other.ankle)


def test_across_the_plate_the_front_foot_steps_less_far() -> None:
    plan = replace(read_plan("short"), plate=(0.60, 0.40))
    side, ahead = occupied(plan)
    assert side == pytest.approx(occupied(replace(plan, plate=None))[0])
    assert ahead == pytest.approx(0.40 - 2 * 0.025)


@pytest.mark.parametrize(
    ("name", "size", "said"),
    [
        ("short", (0.3, 0.6), r"on a plate of 0.3 m from side to side .* the feet need 0.33 m .*Use a larger plate"),
        ("full", (0.6, 0.3), r"the feet need .* and 0.37 m ahead, .*Use a larger plate"),
        ("patient", (0.6, 0.31), r"Use a larger plate"),
        ("patient", (0.325, 0.42), r"Let the person face across it \(--plate 0.42,0.325\)"),
        ("chair", (0.3, 0.6), r"the stool's legs need 0.40 m of force plate from side to side and 0.40 m ahead\. Use"),
    ],
)
def test_a_plate_that_is_too_small_is_refused(name: str, size: tuple[float, float], said: str) -> None:
    with pytest.raises(BiodanceError, match=said):
        support_sequence(TALL, replace(read_plan(name), plate=size))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.4", "expected two lengths in m"),
        ("0.4,wide", "expected two lengths in m"),
        ("400,600", "plate = 400 by 600 m; legal are 0.2 to 3 m"),
        ("0.4,nan", "legal are 0.2 to 3 m"),
    ],
)
def test_a_wrong_plate_on_the_command_line_is_one_sentence(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    who = ["--sex", "M", "--height", "1.8", "--mass", "110"]
    assert run(["dance", *who, "--plate", text, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_robots_feet_are_not_set_by_a_plate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = ["--urdf", "robot.urdf", "--feet", "r,l"]
    assert run(["dance", *robot, "--plate", "0.4,0.6", "--out", str(tmp_path / "out")]) == 2
    assert "--plate is for people" in capsys.readouterr().err


def test_the_plate_is_kept_with_the_dance(tmp_path: Path) -> None:
    for size in (None, (0.4, 0.6)):
        replace(small_dance(), plate=size).save(tmp_path / "dance.npz")
        assert Dance.load(tmp_path / "dance.npz").plate == size


def test_the_page_draws_the_plate_with_the_feet_in_its_middle() -> None:
    dance = replace(small_dance(), plate=(0.4, 0.6))
    corners = np.array(scene_of(dance)["plate"])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.6, 0.4], atol=2e-4)
    soles = dance.stances[0].soles.reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(corners.mean(axis=0), (soles.min(axis=0) + soles.max(axis=0)) / 2, atol=2e-4)
    np.testing.assert_allclose(np.ptp(scene_of(small_dance())["plate"], axis=0), 0.6, atol=2e-4)


def session(*sides: tuple[tuple[float, float], tuple[float, float]]) -> Session:
    """Return a session with a trial to fit on plates from x to x and from y to y, m."""
    plates = [plate(f"plate{k}", *one) for k, one in enumerate(sides)]
    trial, *_ = walker([Stand(0, 1, (0.1, -0.1, 0))], [Stand(0, 1, (0.1, 0.1, 0))], plates, duration=1.0)
    return Session(Subject(65.0, 1.75, "F"), (replace(trial, role="fit"),), Path("visit"))


def test_identify_says_beforehand_which_plates_are_too_small() -> None:
    dance = small_dance()  # its feet take 0.36 m by 0.32 m with the room around them
    assert plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.4)))) == ""
    assert plates_too_small(dance, session(((0.0, 0.33), (0.0, 0.4)))) == "", "the person may face across it"
    assert plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.25)), ((0.0, 0.6), (0.25, 0.5)))) == ""
    said = plates_too_small(dance, session(((0.0, 0.6), (0.0, 0.3))))
    assert said.startswith(plate_sentence(dance))
    assert "The plates of visit cover 0.60 m by 0.30 m" in said or "0.30 m by 0.60 m" in said
    assert "--plate" in said


def test_how_much_plate_it_takes_is_said_of_feet_and_stool() -> None:
    assert plate_sentence(small_dance()) == (
        "The feet need 0.36 m of force plate from side to side and 0.32 m ahead, 2.5 cm around them included; mark "
        "their outlines."
    )
    made = plate_sentence(replace(small_dance(), plate=(0.4, 0.6)))
    assert made.endswith("It is made for a plate of 0.40 m by 0.60 m (--plate).")

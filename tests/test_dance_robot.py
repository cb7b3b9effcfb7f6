"""Robots dance: the closure and slopes of persons, plans of their own size, one small dance from a URDF file to
every file, refusals.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from direct_information import information
from robots import biped
from small_dances import without_pictures

from biodance.body.export import write_model
from biodance.body.human.human import human
from biodance.body.similarity import hoap3, standing_frames
from biodance.body.urdf import read_urdf
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.expectation import ROBOT_ERROR, ROBOT_RATE
from biodance.dance.limits import family
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import dynamic_grams, excitation_blocks
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import HEALTHY, fit_to_person
from biodance.dance.problem.plan import read_plan
from biodance.dance.problem.shapes import capsule_pairs, pairs_of
from biodance.dance.problem.stance import _WIDTH, apart, hip_width, stance, stature_of
from biodance.dance.problem.state import Closure, close_legs
from biodance.dance.robot import leg_length, person_sized, person_sized_plan, robot_plan
from biodance.dance.search.move import Task, evaluate_move
from biodance.dance.verify import broken, verify
from biodance.errors import BiodanceError
from biodance.identification.base_parameters import estimate_base, structural_base
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.pipeline.dance import robot_dancer
from biodance.records import Subject, Wrench
from biodance.uncertainty.bands import Noise

HOAP = standing_frames(hoap3())
PROTOCOL = 'name = "tiny"\nmove_s = 2.0\nhold_s = 1.0\n[postures]\nparallel = 1\nsingle_left = 1\n'
FEET = ["--feet", "right_foot,left_foot"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    place = tmp_path_factory.mktemp("robot")
    (place / "tiny.toml").write_text(PROTOCOL)
    write_model(hoap3(), place / "hoap3.urdf", format="urdf")
    words = ["--urdf", str(place / "hoap3.urdf"), *FEET, "--protocol", str(place / "tiny.toml"), "--seed", "1"]
    with without_pictures(figures=True):
        return place, run(["dance", *words, "--out", str(place / "out")])


def test_planted_feet_stay_and_slopes_are_exact() -> None:
    chain, rng = Chain(HOAP), np.random.default_rng(0)
    feet = stance(HOAP, "right_forward", right=0.1)
    x = np.zeros((1, chain.size))
    x[0, :3] = [0.05, 0.01, 0.26]
    x[0, 3:6] = [0.1, -0.05, 0.1]
    x[0, 18:] = rng.uniform(HOAP.limits.lower, HOAP.limits.upper)[12:]
    v, a = rng.normal(size=(2, 1, chain.size))
    state = close_legs(chain, feet, x, v, a)
    legs = [c for side in feet.planted for c in chain.leg_columns[side]]
    free = [c for c in range(chain.size) if c not in legs]
    closure, step, no_time = Closure(state), 1e-6, np.zeros(len(legs), dtype=int)
    picks = np.eye(chain.size)[legs]
    slopes = [closure.followed(picks, no_time), *(closure.turned(picks, kind, no_time) for kind in ("v", "ax"))]
    for c in (0, 2, 3, 5, 20):
        shifted = []
        for sign in (1, -1):
            moved = x.copy()
            moved[0, c] += sign * step
            shifted.append(close_legs(chain, feet, moved, v, a))
        for k, name in enumerate(("x", "v", "a")):
            difference = (getattr(shifted[0], name) - getattr(shifted[1], name))[0] / (2 * step)
            np.testing.assert_allclose(
                slopes[k][:, c], difference[legs], rtol=0, atol=2e-5 * max(1.0, float(np.abs(difference).max()))
            )
    rest = Closure(close_legs(chain, feet, x, np.zeros_like(v), np.zeros_like(a)))
    np.testing.assert_allclose(rest.followed(picks, no_time), slopes[0], atol=1e-12)
    assert not rest.turned(picks, "ax", no_time).any()
    assert len(free) == 15
    links = [chain.carriers[HOAP.feet[side].segment] for side in ("right", "left")]
    np.testing.assert_allclose(state.velocity[0, links], 0.0, atol=1e-9)
    np.testing.assert_allclose(state.acceleration[0, links], 0.0, atol=1e-8)


def test_a_plan_takes_the_size_and_the_speed_of_the_robot() -> None:
    plan = robot_plan(HOAP, read_plan("full"))
    assert plan.move == pytest.approx(5.0)  # Bonnet 2016, Fig. 11, at 1 rad/s
    assert plan.forward == pytest.approx(0.1)  # III.D
    assert leg_length(HOAP) == pytest.approx(0.25)
    assert person_sized(HOAP).length * leg_length(HOAP) == pytest.approx(0.9)
    gripper = replace(HOAP, limits=replace(HOAP.limits, velocity=np.array([0.1, *np.full(20, 1.0)])))
    assert robot_plan(gripper, read_plan("full")).move == pytest.approx(5.0)  # one slow joint is kept by its own limit
    quick = replace(HOAP, limits=replace(HOAP.limits, velocity=np.full(21, 6.0)))
    assert robot_plan(quick, read_plan("full")).move == 2.0
    with pytest.raises(BiodanceError, match="stool"):
        robot_plan(HOAP, read_plan("chair"))
    toy = replace(HOAP, sip=replace(HOAP.sip, phi=0.4 * HOAP.sip.phi))
    with pytest.raises(BiodanceError, match=r"3\.18 kg"):
        robot_plan(toy, read_plan("full"))


@pytest.mark.parametrize("seconds", [0.5, 20.0])
def test_what_is_legal_are_the_seconds_of_the_protocol_and_not_those_of_a_larger_model(seconds: float) -> None:
    """A joint of 1 rad/s takes 2.5 times as long, a model 3.6 times as large 1.9 times that: 95 s for 20."""
    plan = robot_plan(HOAP, replace(read_plan("full"), move=seconds, hold=60.0))
    large = person_sized_plan(plan, person_sized(HOAP))
    assert plan.move == pytest.approx(2.5 * seconds)
    assert large.move == pytest.approx(2.5 * np.sqrt(3.6) * seconds)
    with pytest.raises(BiodanceError, match="move = "):
        replace(plan, move=2.5 * 20.1)


def test_a_slow_move_is_judged_at_fewer_instants_and_tells_as_much() -> None:
    chain, rng = Chain(HOAP), np.random.default_rng(1)
    ends = np.tile([0.05, 0.0, 0.25, *np.zeros(24)], (2, 1))
    ends[:, 18:] = rng.uniform(0.3, 0.7, (2, 9)) * (HOAP.limits.upper - HOAP.limits.lower)[12:] + HOAP.limits.lower[12:]
    slow = Task(chain, excitation_blocks(HOAP), stance(HOAP, "parallel"), ends, 9.5, family())
    assert len(slow.grid(10.0)) == len(replace(slow, duration=4.0).grid(10.0)) == 39
    assert len(replace(slow, duration=2.8).grid(10.0)) == 27
    move, _ = evaluate_move(slow, slow.straight())
    time = np.linspace(0.0, 9.5, 2001)[1:-1]
    fine = slow.problem(slow.straight(), [], time, reserve=0.0, objective=no_objective).state(np.empty(0))
    np.testing.assert_allclose(
        move.gram, dynamic_grams(fine, list(range(12))) * 9.5 / 2000, rtol=0, atol=1e-4 * np.abs(move.gram).max()
    )


def test_feet_stand_apart_as_the_hips_do() -> None:
    feet = stance(HOAP, "parallel")
    np.testing.assert_allclose(feet.ankle[:, 1], [-0.039, 0.039], atol=1e-9)
    assert feet.soles[1, :, 1].min() - feet.soles[0, :, 1].max() == pytest.approx(0.016, abs=1e-6)


def test_feet_stand_no_wider_than_weight_can_be_shifted() -> None:
    person = human(Subject(65.0, 1.75, "F", 33.0))
    assert apart(person, 0.6) == _WIDTH * stature_of(person)
    joints = [
        replace(j, translation=j.translation * [1, 1, 4]) if j.name in ("right_hip_yaw", "left_hip_yaw") else j
        for j in HOAP.joints
    ]
    wide = replace(HOAP, joints=tuple(joints))
    assert hip_width(wide) == pytest.approx(4 * 0.078)
    assert apart(wide, 1.0) == pytest.approx(4 * 0.078)
    both = stance(wide, "parallel", share=0.6)
    over = both.centre[1] - 0.6 * (both.support[:, 1].max() - both.centre[1])  # the right edge of what may be used
    alone = both.on(0)
    inner = alone.centre[1] + 0.6 * (alone.support[:, 1].max() - alone.centre[1])
    assert inner - over == pytest.approx(0.1 * np.ptp(alone.support[:, 1]), rel=1e-6)
    assert both.soles[1, :, 1].min() > both.soles[0, :, 1].max()


def test_what_must_not_touch_follows_from_the_tree(tmp_path: Path) -> None:
    person = human(Subject(65.0, 1.75, "F", 33.0))
    assert pairs_of(person).limbs == capsule_pairs(person)
    (tmp_path / "robot.urdf").write_text(biped())
    body = standing_frames(read_urdf(tmp_path / "robot.urdf", feet=("r_sole", "l_sole")))
    limbs, boxes = ({frozenset((body.segments[i], body.segments[j])) for i, j in pairs} for pairs in pairs_of(body)[:2])
    assert {
        frozenset(pair)
        for pair in (("r_tibia", "l_tibia"), ("r_pad", "l_tibia"), ("r_ulna", "l_ulna"), ("r_ulna", "l_femur"))
    } <= limbs
    assert frozenset(("r_femur", "r_tibia")) not in limbs
    assert {frozenset(pair) for pair in (("r_ulna", "chest"), ("l_ulna", "base"))} <= boxes
    assert frozenset(("r_clavicle", "chest")) not in boxes
    assert pairs_of(body).unchecked == pairs_of(person).unchecked == ()
    wide = np.array(body.boxes)
    wide[body.segment_index("l_ulna")] *= 6.0
    coarse = pairs_of(replace(body, boxes=wide)).unchecked
    assert any("l_ulna" in pair for pair in coarse)
    assert all("l_ulna" in pair for pair in coarse)


def test_a_robot_dances_from_its_file(made: tuple[Path, int]) -> None:
    place, code = made
    found = json.loads((place / "out" / "results.json").read_text())
    assert (code, found["feasible"], found["notes"]) == (0, True, [])
    assert (found["postures"], found["criterion"]["static_bound"]) == (2, pytest.approx(7.942, abs=0.001))
    assert all(margin["worst"] >= 0 for margin in found["margins"])
    assert all(0 < row["mass_kg"] <= row["mass_table_kg"] for row in found["expected_sd"])
    drawn = {"postures.png", "criterion.png", "zmp.png", "expectation.png"}
    names = {path.name for path in (place / "out").iterdir()} - {
        "postures_3d.png"
    }  # only where the machine can draw it
    assert names == {"results.json", "dance.npz", "dance.csv", "cues.md", "margins.md", *drawn}


def test_the_dance_keeps_the_limits_of_the_file(made: tuple[Path, int]) -> None:
    place, _ = made
    dance, body = Dance.load(place / "out" / "dance.npz"), robot_dancer(place / "hoap3.urdf", "right_foot,left_foot")
    _, plan, _ = fit_to_person(body, robot_plan(body, read_plan(place / "tiny.toml")), HEALTHY)
    assert not broken(verify(body, dance, plan.limits))
    assert np.all(dance.move >= 5.0)
    weak = replace(body, limits=replace(body.limits, torque_upper=0.01 * body.limits.torque_upper))
    assert {margin.limit for margin in broken(verify(weak, dance, plan.limits))} == {"joint_torque"}


def test_the_table_of_angles_is_the_dance(made: tuple[Path, int]) -> None:
    place, _ = made
    dance = Dance.load(place / "out" / "dance.npz")
    lines = (place / "out" / "dance.csv").read_text().splitlines()
    table, motion = np.array([[float(word) for word in line.split(",")] for line in lines[1:]]), dance.motion(100.0)
    assert lines[0].split(",")[8:] == [f"{joint.name}_rad" for joint in dance.body.joints]
    np.testing.assert_allclose(table, np.column_stack([motion.time, motion.q]), atol=1e-8)
    sheet = (place / "out" / "cues.md").read_text()
    assert "| with both feet side by side |" in sheet
    assert "on the left leg alone" in sheet


def test_parameters_come_back_from_the_wrench_of_the_dance(made: tuple[Path, int]) -> None:
    place, _ = made
    dance, rng = Dance.load(place / "out" / "dance.npz"), np.random.default_rng(4)
    body, motion = dance.body, dance.motion(ROBOT_RATE)
    truth = body.sip.phi * rng.uniform(0.8, 1.2, len(body.segments)).repeat(10)
    exact = regressor(body, motion) @ truth
    np.testing.assert_allclose(exact, predict_wrench(body, motion, truth).value, atol=1e-12)
    noisy = exact + ROBOT_ERROR * rng.normal(size=exact.shape)
    base = structural_base(body)
    noise = Noise(np.diag(ROBOT_ERROR**2)[None], np.zeros(3))
    estimate = estimate_base(information(body, motion, Wrench(motion.time, noisy), noise), base)
    known = np.isfinite(estimate.sd)
    assert known.sum() > 80
    z = (estimate.value - base.regroup @ truth)[known] / estimate.sd[known]
    assert np.abs(z).max() < 4.5
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3
    clean = estimate_base(information(body, motion, Wrench(motion.time, exact), noise), base)
    assert np.abs((clean.value - base.regroup @ truth) / clean.sd)[known].max() < 1e-4


def test_a_leg_that_does_not_carry_alone_is_refused_by_its_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_model(hoap3(), tmp_path / "hoap3.urdf", format="urdf")
    (tmp_path / "weak.toml").write_text("[strength]\nright_hip = 0.003\nright_knee = 0.003\nright_ankle = 0.003\n")
    (tmp_path / "one.toml").write_text('name = "one"\nhold_s = 1\n[postures]\nsingle_right = 1\n')
    words = ["--urdf", str(tmp_path / "hoap3.urdf"), *FEET, "--protocol", str(tmp_path / "one.toml"), "--json"]
    words += ["--limits", str(tmp_path / "weak.toml")]
    assert run(["dance", *words, "--out", str(tmp_path / "out")]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["feasible"] is False
    assert "on the right leg alone" in found["reason"]
    assert "joint torque of right" in found["reason"]
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["results.json"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "Say who dances"),
        (["--sex", "F"], "Say who dances"),
        (["--urdf", "robot.urdf"], "Say who dances"),
        (["--urdf", "robot.urdf", "--feet", "a,b", "--sex", "F"], "Say who dances"),
        (["--urdf", "robot.urdf", "--feet", "a,b"], "robot.urdf: cannot be read"),
        (["--urdf", "robot.urdf", "--feet", "a"], "separated by a comma"),
    ],
)
def test_wrong_words_are_one_sentence(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["dance", *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
    assert not (tmp_path / "out").exists()

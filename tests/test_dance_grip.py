"""Holding a frame: exact slopes, postures that reach the grip, and other code that sees when a hand lets go."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.dance import Dance
from biodance.dance.limits import family
from biodance.dance.limits.grip import Grip
from biodance.dance.performers import PlannedDance
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import fit_to_person, read_person
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.stance import feet_in_move, holding, stance
from biodance.dance.problem.state import State
from biodance.dance.search.course import DesignContext
from biodance.dance.search.postures import ATTEMPTS, KEPT, initial_guess, posture_at, solve
from biodance.dance.search.word_course import WordSearch
from biodance.dance.verify import verify
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.records import Array, Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
NO_HANDS = np.full((2, 3), np.nan)
FRAME = holding(stance(BODY, "parallel"), BODY, ("right",))


@cache
def held() -> Array:
    rng = np.random.default_rng(0)
    for _ in range(4 * ATTEMPTS):
        found = solve(CHAIN, FRAME, initial_guess(CHAIN, FRAME, rng), no_objective, family(), iterations=60)
        if found.violation <= KEPT:
            return found.x
    raise AssertionError("no posture reaches the grip")


def test_slopes_are_exact_and_a_free_hand_does_not_count() -> None:
    rng = np.random.default_rng(1)
    x = np.zeros((2, CHAIN.size))
    x[:, ROOT:] = rng.uniform(BODY.limits.lower, BODY.limits.upper, (2, 23))
    both = holding(FRAME, BODY, ("right", "left"))

    def value(x: Array) -> Array:
        return Grip().margins(State(CHAIN, both, x, *np.zeros((2, *x.shape)))).value

    turn, step = rng.normal(size=x.shape), 1e-6
    found = Grip().margins(State(CHAIN, both, x, *np.zeros((2, *x.shape))))
    difference = (value(x + step * turn) - value(x - step * turn)) / (2 * step)
    np.testing.assert_allclose(np.einsum("tkn,tn->tk", found.slopes[0], turn), difference, rtol=1e-6)
    assert found.value.shape == (2, 2)
    assert Grip().margins(State(CHAIN, stance(BODY, "parallel"), x, *np.zeros((2, *x.shape)))).value.shape == (2, 0)


def test_a_posture_holds_the_frame_judged_by_other_code() -> None:
    x = held()
    pose = poses(BODY, CHAIN.motion(np.zeros(1), x[None], *np.zeros((2, 1, CHAIN.size))).q)
    segment, local = palm(BODY, "right")
    assert np.linalg.norm(pose.points([segment], local[None])[0, 0] - FRAME.hands[0]) < Grip().loose
    assert np.isnan(FRAME.hands[1]).all()


def test_verification_sees_a_hand_that_lets_go() -> None:
    x = np.array([held(), held()])
    away = posture_at(
        CHAIN, FRAME, np.where(np.arange(CHAIN.size) == ROOT + BODY.joint_index("right_shoulder_flexion"), 1.5, x[1])
    ).x
    for rows, kept in ((x, True), (np.array([x[0], away]), False)):
        dance = Dance(
            "t",
            BODY,
            rows,
            (FRAME, FRAME),
            np.ones(2),
            rows[None, [0, 1]],
            np.array([2.0]),
            (feet_in_move(FRAME, FRAME),),
            0,
        )
        margin = next(m for m in verify(BODY, dance, family()) if m.limit == "grip")
        assert (margin.worst >= 0) == kept
        assert margin.what == "right_hand"


def test_a_persons_file_puts_the_hand_on_the_frame_in_every_stance(tmp_path: Path) -> None:
    path = tmp_path / "person.toml"
    path.write_text('hold_frame = ["right"]\nstand_alone_on = ["left"]\n')
    plan = Plan("p", (("parallel", 2), ("single_right", 2), ("single_left", 1)))
    body, plan, _ = fit_to_person(BODY, plan, read_person(path))
    feet = support_sequence(body, plan)
    assert all(np.isfinite(one.hands[0]).all() and np.isnan(one.hands[1]).all() for one in feet)
    assert not any(np.isfinite(one.hands).any() for one in support_sequence(body, replace(plan, holds=())))
    _, seated, notes = fit_to_person(BODY, read_plan("chair"), read_person(path))
    assert seated.holds == ()
    assert any("On the stool no hand holds a frame" in note for note in notes)
    path.write_text('hold_frame = ["both"]\n')
    with pytest.raises(BiodanceError, match="'both' is not a hand"):
        read_person(path)


def test_every_known_posture_holds_the_frame_and_nobody_is_told_to_move_that_arm() -> None:
    plan = replace(read_plan("patient"), blocks=(("parallel", 4),), holds=("right",))
    search = WordSearch(DesignContext.alone(BODY, plan, 0))
    (stance, *_) = support_sequence(BODY, plan)
    table = search.table(stance)
    assert [word.key for word in table.words["right_arm"]] == ["hold"]
    upright = np.flatnonzero(table.index[:, table.parts.index("legs")] == 0)
    held = State(CHAIN, stance, table.x[upright], *np.zeros((2, len(upright), CHAIN.size)))
    assert (Grip().margins(held).value > 0).all()
    first, *others = search.postures((stance,) * 4)
    assert first.said[0] == "hold the frame with the right hand"
    assert not any("right arm" in said or "right elbow" in said for step in others for said in step.said)
    free = WordSearch(DesignContext.alone(BODY, replace(plan, holds=()), 0)).postures(
        (replace(stance, hands=NO_HANDS),)
    )
    assert not any("frame" in said for said in free[0].said)


def test_a_hand_on_the_frame_errs_with_the_trunk_only() -> None:
    dance = Dance("t", BODY, held()[None], (FRAME,), np.ones(1), np.empty((0, 2, CHAIN.size)), np.empty(0), (), 0)
    copies = PlannedDance(dance).held_by(np.zeros(1)).q[:, -len(BODY.joints) :]
    right, left = (np.ptp(copies[:, [c - ROOT for c in arm]], axis=0) for arm in CHAIN.arm_columns)
    np.testing.assert_allclose(right, 0.0, atol=1e-12)
    assert (left > 0.1).all()

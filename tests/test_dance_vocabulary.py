"""Wider words for lively people: only where a protocol asks for them, never far over on one leg, and chosen also for
what they tell of the joint centres.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_dances import BODY, small_dance

from biodance.dance.expectation import CENTRES, rows_of_centres
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.stance import Stance
from biodance.dance.search.known_postures import PostureTable, Vocabulary, read_vocabulary, words_for
from biodance.dance.verify import longest_alone
from biodance.motion.kinematics import poses
from biodance.records import SIDES

CHAIN = Chain(BODY)
PLAN = Plan("x", (("single_right", 3),), hold=1.0, instructions=4.0, simplicity=1.0, wide=1.3, lively=True)
STANCE = next(stance for stance in support_sequence(BODY, PLAN) if len(stance.planted) == 1)


def _words(plan: Plan) -> Vocabulary:
    return words_for(BODY, plan, STANCE, read_vocabulary(), np.random.default_rng(0))


def test_wider_words_are_asked_of_lively_people_only() -> None:
    assert [name for name in ("easy", "patient", "chair", "short") if read_plan(name).lively] == []
    some, more = _words(replace(PLAN, lively=False)), _words(PLAN)
    added = {word.key for part in more for word in more[part]} - {word.key for part in some for word in some[part]}
    assert added == {"hip_bow", "bow_right", "bow_left", "whole_right", "whole_left", "high", "away"}


def test_on_one_leg_the_trunk_stays_within_45_degrees() -> None:
    words = {part: group[:1] if part.endswith("_arm") else group for part, group in _words(PLAN).items()}
    found = PostureTable.of(CHAIN, STANCE, words)
    q = CHAIN.motion(np.arange(len(found.x), dtype=float), found.x, *np.zeros((2, *found.x.shape))).q
    up = np.asarray(poses(BODY, q).rotation)[:, BODY.segments.index("trunk_head")][:, 2, 1]
    assert len(up) == len(found.index) > 50
    assert np.degrees(np.arccos(up.min())) < 45.5


def test_a_turned_joint_tells_of_its_centre_across_the_axis_only() -> None:
    x = np.zeros((2, CHAIN.size))
    x[1, ROOT + BODY.joint_index("right_hip_flexion")] = 0.5 * np.pi
    rows = np.concatenate([rows_of_centres(CHAIN, one, CENTRES + 4) for one in x])
    assert not rows[:, :4].any()

    def told(centre: tuple[float, float, float]) -> float:
        """Return what both postures together say of a centre that is off by as much in pelvis and thigh."""
        off = np.zeros(CENTRES + 4)
        off[4:7] = off[7:10] = centre
        return float(np.linalg.norm(rows @ off))

    along, across = told((0.0, 0.0, 1.0)), told((0.0, 1.0, 0.0))
    assert along < 1e-9  # off along the axis of flexion: no posture of the two shows it
    assert across > 0.5


# ---- Deep postures only on request

_ON_BOTH, _ON_ONE, _CLOSED = 70.0, 45.0, 0.5
"""degrees: bounds of a posture that is not deep, and what closing the legs may add."""


def _deepest(plan: Plan, stance: Stance) -> tuple[float, float]:
    """Return how far the trunk leans at most, and a knee that bears bends, degrees, over all words on these feet."""
    words = words_for(BODY, plan, stance, read_vocabulary(), np.random.default_rng(0))
    found = PostureTable.of(CHAIN, stance, {p: g[:1] if p.endswith("_arm") else g for p, g in words.items()})
    q = CHAIN.motion(np.arange(len(found.x), dtype=float), found.x, *np.zeros((2, *found.x.shape))).q
    up = np.asarray(poses(BODY, q).rotation)[:, BODY.segments.index("trunk_head")][:, 2, 1]
    knees = [ROOT + BODY.joint_index(f"{SIDES[side]}_knee_flexion") for side in stance.planted]
    return float(np.degrees(np.arccos(up.min()))), float(np.degrees(found.x[:, knees].max(initial=0.0)))


@pytest.mark.parametrize("name", ["easy", "patient", "chair", "short"])
@pytest.mark.parametrize("lively", [False, True])
def test_deep_postures_come_on_request_only(name, lively) -> None:
    plan = replace(read_plan(name), lively=lively)
    for stance in dict.fromkeys(one for one in support_sequence(BODY, plan) if one.over is None):
        bound = (_ON_ONE if len(stance.planted) == 1 else _ON_BOTH) + _CLOSED
        assert max(_deepest(plan, stance)) < bound, stance.name


def test_whoever_asks_for_deep_postures_gets_them() -> None:
    plan = replace(read_plan("short"), deep=True)
    deepest = [_deepest(plan, one) for one in support_sequence(BODY, plan) if one.over is None]
    assert max(map(max, deepest)) > _ON_BOTH


def test_how_long_a_foot_is_up_is_counted_until_it_is_down_again() -> None:
    dance = small_dance()
    assert longest_alone(dance) == 0.0
    both, up = dance.stances[0], replace(dance.stances[0], planted=(0,))
    other = replace(up, planted=(1,))

    def longest(*stances: Stance, under: tuple[Stance, Stance]) -> float:
        """Return it for 1 s, a move of 2 s, 1 s, another move of 2 s and 1 s on these feet."""
        found = {what: np.repeat(getattr(dance, what), (1, 2), axis=0) for what in ("postures", "hold")}
        found |= {what: np.repeat(getattr(dance, what), 2, axis=0) for what in ("via", "move")}
        return longest_alone(replace(dance, **found, stances=stances, under=under))

    assert longest(both, up, both, under=(up, up)) == 5.0
    assert longest(up, both, other, under=(both, other)) == 3.0
    assert longest(up, up, other, under=(up, other)) == 4.0

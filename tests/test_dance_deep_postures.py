"""Deep postures only on request: no trunk far over and no bearing knee far bent, on no feet, with no words."""

from dataclasses import replace

import numpy as np
import pytest
from small_dances import BODY, small_dance

from biodance.dance.metrics import longest_alone
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.stance import Stance
from biodance.dance.search.known_postures import PostureTable, read_vocabulary, words_for
from biodance.motion.kinematics import poses
from biodance.records import SIDES

CHAIN = Chain(BODY)
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

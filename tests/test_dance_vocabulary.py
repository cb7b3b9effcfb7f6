"""Wider words for lively people: only where a protocol asks for them, never far over on one leg, and chosen also for
what they tell of the joint centres.
"""

from dataclasses import replace

import numpy as np
from small_dances import BODY

from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.search.information import CENTRES, rows_of_centres
from biodance.dance.search.known_postures import PostureTable, Vocabulary, read_vocabulary, words_for
from biodance.motion.kinematics import poses

CHAIN = Chain(BODY)
PLAN = Plan("x", "", (("single_right", 3),), hold=1.0, instructions=4.0, simplicity=1.0, wide=1.3, lively=True)
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

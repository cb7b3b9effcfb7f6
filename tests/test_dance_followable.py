"""A dance that people follow: few instructions, one or two parts at a time, room for imprecise people, pictures."""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from small_dances import BODY, small_dance

from biodance.dance.cues import MIRROR_CALL, dance_instructions
from biodance.dance.followable.catalogue import Catalogue
from biodance.dance.followable.vocabulary import read_vocabulary, words_for
from biodance.dance.followable.walk import Walk, walked_dance
from biodance.dance.imprecision import Imprecision, mass_centre
from biodance.dance.limits.self_collision import solid_distances, surface_distances
from biodance.dance.performers import perform_with, rehearse_imprecisely
from biodance.dance.postures.ordering import support_sequence
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.transitions.context import Checkpoint, DesignContext
from biodance.dance.verify import broken, verify
from biodance.motion.kinematics import poses
from biodance.report.figures.mannequin import mannequin_svg

PLAN = Plan("x", "", (("parallel", 5),), hold=1.0, instructions=3.0, simplicity=1.0, wide=1.3, gentle=True)
CHAIN = Chain(BODY)


@pytest.fixture(scope="module")
def walked():
    with ThreadPoolExecutor(1) as pool:
        work = DesignContext(
            CHAIN, excitation_blocks(BODY), PLAN, 0, Checkpoint(None, BODY, PLAN, 0), pool, lambda *_: None
        )
        steps, moves = Walk(work).take(support_sequence(BODY, PLAN))
        return steps, walked_dance(work, steps, moves)


def test_a_walk_asks_little_at_once_and_keeps_all_limits(walked) -> None:
    steps, dance = walked
    for before, after in pairwise(steps):
        changed = [part for part, word in after.words.items() if word.key != before.words[part].key]
        assert after.mirror or 1 <= len(changed) <= 2
    said = dance_instructions(dance)
    assert max(map(len, said)) <= 3
    assert all((p in dance.mirrored) == (what == MIRROR_CALL) for p, what in enumerate(said))
    assert not broken(verify(BODY, dance, PLAN.limits))
    assert len({step.s for step in steps}) == len(steps)


def test_a_catalogue_stands_balanced_on_its_feet() -> None:
    (stance, *_) = support_sequence(BODY, PLAN)
    words = words_for(BODY, PLAN, stance, read_vocabulary(), np.random.default_rng(0))
    found = Catalogue.of(
        CHAIN, stance, {part: group if part == "trunk" else group[:2] for part, group in words.items()}
    )
    middle = mass_centre(CHAIN, found.x)[:, :2] - stance.centre
    np.testing.assert_allclose(middle[:, 1], 0.0, atol=2e-3)
    assert np.ptp(middle[:, 0]) < 4e-3
    knees = found.x[:, 6 + BODY.joint_index("right_knee_flexion")]
    assert np.degrees(knees).min() == pytest.approx(14.0, abs=0.5)
    twice = found.mirrored[found.mirrored]
    np.testing.assert_array_equal(twice, np.arange(len(found.x)))


def test_an_exact_performer_does_the_dance_itself() -> None:
    exact = Imprecision(tracking=0.0, timing=0.0, sway=0.0, pace=1.0)
    found = rehearse_imprecisely(small_dance(), PLAN.limits, who=(0,), how=exact)
    motion = small_dance().motion(5.0)
    gap, _ = solid_distances(BODY, poses(BODY, motion.q))
    assert found["self_collision"].worst == pytest.approx(gap.min(), abs=2e-3)
    bad = rehearse_imprecisely(small_dance(), PLAN.limits, who=range(3))
    assert all(bad[name].worst < found[name].worst for name in ("self_collision", "balance"))


def test_performers_are_the_same_in_groups() -> None:
    with ThreadPoolExecutor(2) as pool:
        together = perform_with(pool, small_dance(), PLAN.limits, who=range(4))
    assert together == rehearse_imprecisely(small_dance(), PLAN.limits, who=range(4))


def test_closed_form_distances_are_those_of_coal() -> None:
    rng = np.random.default_rng(3)
    x = np.zeros((6, CHAIN.size))
    x[:, 6:] = rng.uniform(BODY.limits.lower, BODY.limits.upper, (6, CHAIN.size - 6))
    pose = poses(BODY, CHAIN.motion(np.arange(6.0), x, *np.zeros((2, *x.shape))).q)
    own, names = surface_distances(BODY, pose, near=np.inf)
    coal, pairs = solid_distances(BODY, pose)
    assert list(names) == pairs
    close = (coal > 0) & (coal < 0.05)
    assert close.any()
    np.testing.assert_allclose(own[close], coal[close], atol=1e-3)


def test_only_the_papers_dance_is_free() -> None:
    most = {name: read_plan(name).instructions for name in ("easy", "patient", "chair", "short", "one_segment", "full")}
    assert most.pop("full") == np.inf
    assert max(most.values()) <= 4
    assert all(read_plan(name).whom for name in most)


def test_a_picture_has_both_views_and_a_title() -> None:
    drawn = mannequin_svg(BODY, small_dance().motion(1.0).q[-1], "left arm raised")
    assert drawn.count("<polygon") == 2 * 13
    assert 'aria-label="left arm raised"' in drawn
    assert "from the front" in drawn

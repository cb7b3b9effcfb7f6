"""A dance that people follow: few instructions, one or two parts at a time, room for imprecise people, pictures."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_dances import BODY, small_dance

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.dance import design, performers
from biodance.dance.cues import MIRROR_CALL, dance_instructions
from biodance.dance.limits import Margin, _vector
from biodance.dance.limits.self_collision import solid_distances, surface_distances
from biodance.dance.performers import PerformersResult, PlannedDance, try_performers
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.person import PersonLimits, fit_to_person, limit_body
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.problem.stance import Stance, holding, seat, stance
from biodance.dance.search.course import Checkpoint, DanceStep, DesignContext
from biodance.dance.search.known_postures import PostureTable, read_vocabulary, words_for, words_left_out
from biodance.dance.search.move import ENOUGH, straight_move
from biodance.dance.search.word_course import NoNextPosture, WordSearch
from biodance.dance.verify import broken, verify
from biodance.motion.kinematics import poses
from biodance.pipeline.still import props
from biodance.records import Subject
from biodance.report.dance import mannequin_svg

PLAN = Plan("x", (("parallel", 5),), hold=1.0, instructions=3.0, simplicity=1.0, wide=1.3, gentle=True)
CHAIN = Chain(BODY)


@pytest.fixture(scope="module")
def searched():
    with ThreadPoolExecutor(1) as pool:
        work = DesignContext(
            CHAIN, excitation_blocks(BODY), PLAN, 0, Checkpoint(None, BODY, PLAN, 0), pool, lambda *_: None
        )
        search = WordSearch(work)
        return search, search.course(support_sequence(BODY, PLAN))


def test_a_dance_asks_little_at_once_and_keeps_all_limits(searched) -> None:
    search, course = searched
    dance, steps = course.dance(search.work), course.steps
    for before, after in pairwise(steps):
        was, now = (one.table.words_of(one.s) for one in (before, after))
        changed = [part for part, word in now.items() if word.key != was[part].key]
        assert after.mirror or 1 <= len(changed) <= 2
    said = dance_instructions(dance)
    assert max(map(len, said)) <= 3
    assert all((p in dance.mirrored) == (what == MIRROR_CALL) for p, what in enumerate(said))
    assert not broken(verify(BODY, dance, PLAN.limits))
    assert len({step.s for step in steps}) == len(steps)


def at_rest(body: Body, plan: Plan, feet: Stance) -> PostureTable:
    """Return the one posture on these feet in which nothing is asked of any part."""
    words = words_for(body, plan, feet, read_vocabulary(), np.random.default_rng(0))
    return PostureTable.of(Chain(body), feet, {part: group[:1] for part, group in words.items()})


def test_imprecise_people_stand_on_either_leg_alike() -> None:
    plan = replace(PLAN, blocks=(("single_right", 1), ("single_left", 1)), wide=1.35, gentle=False)
    feet = [one for one in support_sequence(BODY, plan) if len(one.planted) == 1]
    right, left = (at_rest(BODY, plan, one).keeps(0, plan.limits)[0] for one in feet)
    assert 3.2 < right < 6
    assert right == pytest.approx(left, rel=0.05)


def test_even_small_people_lift_either_foot_within_15_mm_of_support() -> None:
    plan, small = read_plan("easy"), Subject(45.0, 1.50, "F", 25.0)
    body = replace(human(small), limits=joint_limits(small, within=plan.ranges))
    search = WordSearch(DesignContext.alone(body, plan, 0))
    lifts = [pair for pair in pairwise(support_sequence(body, plan)) if len(pair[0].planted) > len(pair[1].planted)]
    assert [after.planted for _, after in lifts] == [(0,), (1,)]
    for pair in lifts:
        task = search.task(*(DanceStep(at_rest(body, plan, feet), 0) for feet in pair))
        move = straight_move(task, pair)
        assert not move.limit
        assert move.room > ENOUGH


def test_where_a_performer_has_too_little_room_another_posture_is_danced(searched, monkeypatch) -> None:
    (search, course), steps = searched, searched[1].steps

    def performed(dance, _limits, *, who=range(200), only=(), workers):
        bad = bool((dance.postures == steps[2].x).all(axis=1).any()) and (not only or 2 in only)
        room = Margin("self_collision_of_performers", -0.01 if bad else 0.01, 0.0, "m", "arm - head")
        return PerformersResult(len(who), (room,), ((2, "self_collision"),) if bad else (), (7,) if bad else ())

    monkeypatch.setattr(design, "try_performers", performed)
    repaired, found = design.repaired_course(search, course, search.work.workers)
    dance = repaired.dance(search.work)
    assert found.safe
    assert not dance.notes
    changed = np.flatnonzero((dance.postures != np.array([step.x for step in steps])).any(axis=1))
    np.testing.assert_array_equal(changed, [2])
    assert max(map(len, dance_instructions(dance))) <= 3
    assert not broken(verify(BODY, dance, PLAN.limits))


def test_whoever_must_shift_weight_next_can_undo_what_was_called(searched, monkeypatch) -> None:
    search, _ = searched
    both, over, *_ = support_sequence(BODY, replace(PLAN, blocks=(("parallel", 1), ("single_right", 1))))
    stand, shift = (search.table(feet) for feet in (both, over))
    work = replace(search.work, plan=replace(PLAN, instructions=2.0))
    reach, all_ = WordSearch(work), range(len(stand.index))
    monkeypatch.setattr(WordSearch, "can", lambda *_: True)
    left = [next(n for n in (1, 2, 3) if reach.leads(stand, s, shift, n)) for s in all_]
    words = [stand.words_of(s) for s in all_]
    assert {n for n, word in zip(left, words, strict=True) if word["trunk"].rest and word["legs"].rest} == {1}
    assert {n for n, word in zip(left, words, strict=True) if not word["trunk"].rest and not word["legs"].rest} == {2}
    monkeypatch.setattr(WordSearch, "can", lambda *_: False)
    barred = WordSearch(work)
    assert not any(barred.leads(stand, s, shift, n) for s in all_ for n in (1, 3))


def test_feet_that_cannot_be_reached_are_named() -> None:
    blocks = (("parallel", 1), ("single_right", 1), ("single_left", 1))
    stances = support_sequence(BODY, replace(PLAN, blocks=blocks))
    on = [(one.name, one.over) for one in stances]
    lift, down = on.index(("single_right", None)), on.index(("single_right", None)) + 1
    named = [NoNextPosture("", stances, k).missing(blocks) for k in (lift - 1, lift, down, down + 1, down + 2)]
    assert named == [(name, 0) for name in 3 * ["single_right"] + 2 * ["single_left"]]


def test_whoever_sits_bends_the_hip_whatever_the_file_says_and_this_is_said() -> None:
    plan = replace(PLAN, blocks=(("seated", 1),))
    share, told = PersonLimits(range_shares=(("left", 0.6),)), ("left_hip_flexion", -0.1, np.radians(70.0))
    for person in (share, replace(share, ranges=(told,))):
        body, fitted, notes = fit_to_person(BODY, plan, person)
        (seated,) = support_sequence(body, fitted)
        words = words_for(body, fitted, seated, read_vocabulary(), np.random.default_rng(0))
        assert np.degrees(dict(words["left_hanging"][0].angles)["hip_flexion"]) == pytest.approx(91.0)
        assert any("left hip flexion reaches" in note and "to 93 degrees" in note for note in notes)
        assert not any("right" in note for note in notes)
    right_angle = PersonLimits(ranges=(("left_hip_flexion", -np.inf, np.radians(90.0)),))
    body, _, notes = fit_to_person(BODY, plan, right_angle)
    assert notes == ()
    assert body.limits.upper[BODY.joint_index("left_hip_flexion")] == pytest.approx(np.radians(90.0))


def test_what_a_stiff_arm_cannot_do_is_said() -> None:
    (stance, *_), words = support_sequence(BODY, PLAN), read_vocabulary()
    assert words_left_out(BODY, PLAN, (stance,), words) == ()
    stiff = replace(BODY, limits=limit_body(BODY, PersonLimits(range_shares=(("left_shoulder", 0.3),))))
    (said,) = words_left_out(stiff, PLAN, (stance,), words)
    assert said.startswith("Left out for the left arm: the left arm out to the side (a T)")
    assert "left shoulder adduction" in said


def test_an_arm_that_only_goes_forward_hangs_all_the_same() -> None:
    """A word that does not name a joint has it straight: at 0 degrees, which is a stop of such a shoulder."""
    stiff = limit_body(BODY, PersonLimits(ranges=(("left_shoulder_flexion", 0.0, np.radians(70.0)),)))
    body, (stance, *_) = replace(BODY, limits=stiff), support_sequence(BODY, PLAN)
    words = words_for(body, PLAN, stance, read_vocabulary(), np.random.default_rng(0))
    assert [
        np.degrees(dict(words[f"{side}_arm"][0].angles).get("shoulder_flexion", 0.0)) for side in ("right", "left")
    ] == [
        0.0,
        pytest.approx(1.5),
    ]
    rest = {part: group[:1] for part, group in words.items()}
    room, limit = PostureTable.of(Chain(body), stance, rest).keeps(0, PLAN.limits)
    assert room > 3.2, limit


def test_all_postures_of_the_words_stand_balanced_on_its_feet() -> None:
    (stance, *_) = support_sequence(BODY, PLAN)
    words = words_for(BODY, PLAN, stance, read_vocabulary(), np.random.default_rng(0))
    found = PostureTable.of(
        CHAIN, stance, {part: group if part == "trunk" else group[:2] for part, group in words.items()}
    )
    middle = CHAIN.mass_centre(found.x)[:, :2] - stance.centre
    np.testing.assert_allclose(middle[:, 1], 0.0, atol=2e-3)
    assert np.ptp(middle[:, 0]) < 4e-3
    knees = found.x[:, 6 + BODY.joint_index("right_knee_flexion")]
    assert np.degrees(knees).min() == pytest.approx(14.0, abs=0.5)
    twice = found.mirrored[found.mirrored]
    np.testing.assert_array_equal(twice, np.arange(len(found.x)))


def test_an_exact_performer_does_the_dance_itself(monkeypatch) -> None:
    with monkeypatch.context() as exact:
        for name, value in {"_TRACKING": 0.0, "_TIMING": 0.0, "_SWAYS": 0.0, "_PACE": 1.0}.items():
            exact.setattr(performers, name, value)
        found = try_performers(small_dance(), PLAN.limits, who=(0,))
    motion = small_dance().motion(5.0)
    gap, _ = solid_distances(BODY, poses(BODY, motion.q))
    least = next(one for one in PLAN.limits if one.name == "self_collision").for_imprecise().least
    left, less = worst_of(found), worst_of(try_performers(small_dance(), PLAN.limits, who=range(3)))
    assert left["self_collision_of_performers"] == pytest.approx(gap.min() - least, abs=2e-3)
    assert all(less[f"{name}_of_performers"] < left[f"{name}_of_performers"] for name in ("self_collision", "balance"))


def worst_of(found: PerformersResult) -> dict[str, float]:
    return {margin.limit: margin.worst for margin in found.margins}


def test_performers_are_the_same_in_groups() -> None:
    with ThreadPoolExecutor(2) as pool:
        together = try_performers(small_dance(), PLAN.limits, who=range(4), workers=pool)
    assert together == try_performers(small_dance(), PLAN.limits, who=range(4))


def test_performers_looked_at_together_are_those_looked_at_alone() -> None:
    dance = small_dance()
    alone = [try_performers(dance, PLAN.limits, who=(k,), only=(1, 2)) for k in range(3)]
    together = try_performers(dance, PLAN.limits, who=range(3), only=(1, 2))
    assert set(together.bad) == {bad for one in alone for bad in one.bad}
    assert together.failed == tuple(k for one in alone for k in one.failed)
    for limit, worst in worst_of(together).items():
        assert worst == pytest.approx(min(worst_of(one)[limit] for one in alone), abs=1e-12)


def test_a_part_of_the_plan_is_that_of_the_whole_plan() -> None:
    dance = small_dance()
    long = replace(dance, hold=dance.hold + 6.0)
    when = long.phases[2].start + np.linspace(1.5, 2.5, 7)  # the move is felt there, what was before it is not
    part, whole = PlannedDance(long, (when[0], when[-1])), PlannedDance(long)
    assert part.spline.x.size < whole.spline.x.size
    np.testing.assert_allclose(part.spline(when), whole.spline(when), rtol=0, atol=1e-12)
    state = long.state(long.phases[2], when)
    np.testing.assert_allclose(whole.spline(when)[:, : CHAIN.size], state.x, rtol=0, atol=1e-3)


def test_small_turns_have_the_vectors_of_scipy() -> None:
    turns = np.random.default_rng(5).normal(scale=0.5, size=(50, 4, 3))
    turns[0] = 0.0
    found = _vector(Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(50, 4, 3, 3))
    np.testing.assert_allclose(found, turns, rtol=0, atol=1e-14)


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


@pytest.mark.parametrize(("where", "lines"), [("stool", 1), ("frame", 2), ("free", 0)])
def test_a_picture_shows_the_stool_and_the_grips_that_are_held(where: str, lines: int) -> None:
    free = stance(BODY, "parallel")
    feet = {"stool": seat(BODY, height=0.55), "frame": holding(free, BODY, ("right", "left")), "free": free}[where]
    views = [props(feet, eye) for eye in ((1.0, 0.0), (0.0, -1.0))]
    assert [len(one) for one in views] == [lines, lines]
    if where == "stool":
        np.testing.assert_allclose(views[0][0], [[-0.2, 0], [-0.2, 0.55], [0.2, 0.55], [0.2, 0]], atol=1e-9)
        np.testing.assert_allclose(np.ptp(views[1][0], axis=0), [0.4, 0.55])
    if where == "frame":
        assert views[0][0][0, 0] == pytest.approx(-views[0][1][0, 0]), "a grip on either side"
        assert all(line[1, 1] == pytest.approx(0.53 * 1.75, abs=0.02) for view in views for line in view)
    drawn = mannequin_svg(BODY, small_dance().motion(1.0).q[-1], "posture", stance=feet)
    assert drawn.count("<polyline") == 2 * lines


def test_a_picture_has_both_views_and_a_title() -> None:
    drawn = mannequin_svg(BODY, small_dance().motion(1.0).q[-1], "left arm raised")
    assert drawn.count("<polygon") == 2 * 13
    assert 'aria-label="left arm raised"' in drawn
    assert "from the front" in drawn

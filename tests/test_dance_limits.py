"""One contract for every limit of a dance: its margins are what its check finds, its slopes are differences, and what a
protocol says of it reaches both sides. Numbers that a person works out by hand are in test_dance_limits.py.
"""

from dataclasses import fields, replace

import numpy as np
import pytest
from limit_cases import BODY, CHAIN, checked, feet, movements

from biodance.body.body import Body
from biodance.dance.limits import FAR, CheckedMotion, ImpreciseCopy, Limit, family, self_collision
from biodance.dance.limits.self_collision import _ENOUGH, deepest, outside, solid_distances
from biodance.dance.problem.excitation import dynamic_grams, dynamic_slopes, excitation_blocks, static_grams
from biodance.dance.problem.nlp import NonlinearProgramme, free_coordinates
from biodance.dance.problem.stance import Stance, holding, seat, stance
from biodance.dance.problem.state import State, close_legs
from biodance.dance.search.postures import Exciting, initial_guess
from biodance.errors import BiodanceError
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses

BLOCKS = excitation_blocks(BODY)
STEP = 1e-6
MOVEMENTS = 198
NEVER, DEEP = 0.05, -0.02
"""m: coal gives bounds of distances above the first, and another measure of overlap (the way out, not the depth) below
the second.
"""
FAMILY = {limit.name: limit for limit in family()}
each_limit = pytest.mark.parametrize("limit", FAMILY.values(), ids=FAMILY.keys())


# ---- the contract


def compared(limit: Limit, state: State, motion: CheckedMotion) -> tuple[np.ndarray, np.ndarray]:
    """Return what is left in each sample by the margins and by the check, as far as both are exact."""
    margins, check = limit.margins(state).value, limit.check(motion).value
    assert (margins.size == 0) == (check.size == 0)
    left, found = (value.min(axis=1) if value.size else np.full(len(state.x), np.inf) for value in (margins, check))
    if limit.name == "self_collision" and margins.size:
        np.testing.assert_array_equal(left < DEEP, found < DEEP)
        left, found = (np.clip(value, DEEP, NEVER - limit.gap) for value in (left, found))
    return left, found


@each_limit
def test_margins_are_what_the_check_finds_on_movements_that_keep_the_limit_and_that_break_it(limit: Limit) -> None:
    pairs = [compared(limit, *movement) for movement in movements(MOVEMENTS)]
    left, found = (np.concatenate(one) for one in zip(*pairs, strict=True))
    np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
    told = np.isfinite(left)
    broken = (left[told] < 0).mean()
    assert told.sum() >= 60
    assert 0.01 < broken < 0.99


NUMBERS = [(limit, one.name) for limit in FAMILY.values() for one in fields(limit) if not one.metadata["imprecise"]]
ASKED = [(limit, one.name) for limit in FAMILY.values() for one in fields(limit) if one.metadata["imprecise"]]


@pytest.mark.parametrize(("limit", "name"), NUMBERS, ids=[f"{limit.name}.{name}" for limit, name in NUMBERS])
def test_another_number_reaches_the_margins_and_the_check(limit: Limit, name: str) -> None:
    usual, legal = getattr(limit, name), {one.name: one.metadata for one in fields(limit)}[name]
    other = replace(limit, **{name: legal["high"] if usual < legal["high"] else (usual + legal["low"]) / 2})
    changed = 0
    for movement in movements(27, seed=1):
        left, found = compared(other, *movement)
        np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
        changed += np.sum(left != compared(limit, *movement)[0])
    assert changed >= 6


@pytest.mark.parametrize(("limit", "name"), ASKED, ids=[f"{limit.name}.{name}" for limit, name in ASKED])
def test_what_imprecise_people_must_keep_is_a_number_of_the_limit(limit: Limit, name: str) -> None:
    asked = replace(limit, **{name: 0.031}).for_imprecise()
    assert asked is not None
    assert asked.least == 0.031


@pytest.mark.parametrize("where", feet(), ids=lambda one: f"{one.name}-{one.over}-{np.isfinite(one.hands).sum()}")
@each_limit
def test_slopes_equal_differences(limit: Limit, where: Stance) -> None:
    built, y, _ = problem(where, (limit,), nothing)
    point = built.evaluate(y)
    near = np.flatnonzero(point.margins < FAR)
    slopes = point.jacobian(near)
    assert slopes.shape == (len(near), len(y))
    expected = differences(built.evaluate, y, lambda p: p.margins)[near]
    np.testing.assert_allclose(slopes, expected.reshape(slopes.shape), atol=3e-6 * (1 + np.abs(slopes).max(initial=0)))


@each_limit
def test_every_limit_says_what_it_is(limit: Limit) -> None:
    module = __import__(type(limit).__module__, fromlist=["LIMIT"])
    assert module.__doc__
    assert module.__name__.rsplit(".", 1)[1] == limit.name
    assert limit.unit
    assert limit.scale > 0
    assert all({"low", "high", "unit"} <= set(one.metadata) for one in fields(limit))


# ---- slopes of criteria and of the closure, with the same small problems


def problem(where, limits, objective, *, frames=5, still=False):
    rng = np.random.default_rng(len(where.planted) + sum(where.planted[:1]))
    base = np.zeros((3, frames, CHAIN.size))
    base[0] = initial_guess(CHAIN, where, rng)
    base[0, :, 2] -= 0.15
    base[0, :, 3:6] *= 0.3
    basis = rng.normal(0, 1, (3, frames, 1 if still else 2))
    if still:
        basis[:] = np.array([1.0, 0.0, 0.0])[:, None, None]
    built = NonlinearProgramme(
        CHAIN, where, base, basis, free_coordinates(CHAIN, where), limits, objective, np.zeros((frames, len(limits)))
    )
    return built, rng.normal(0, 0.04, basis.shape[2] * len(built.free)), rng


def differences(evaluate, y, what):
    return np.array(
        [(what(evaluate(y + STEP * e)) - what(evaluate(y - STEP * e))) / (2 * STEP) for e in np.eye(len(y))]
    ).T


def nothing(state):
    return 0.0, np.zeros((3, *state.x.shape))


def standing_on(planted):
    return stance(BODY, "parallel").on(*planted)


@pytest.mark.parametrize("planted", [(0, 1), (1,)])
def test_slopes_of_the_dynamic_criterion(planted):
    segments = list(range(12))
    weight = np.random.default_rng(0).normal(size=(12, 6, 6))
    weight = weight + np.swapaxes(weight, 1, 2)

    def objective(state):
        return float(np.sum(weight * dynamic_grams(state, segments))), dynamic_slopes(state, segments, weight)

    built, y, _ = problem(standing_on(planted), (), objective)
    expected = differences(built.evaluate, y, lambda p: p.value)
    got = built.evaluate(y).gradient
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_slopes_of_the_static_criterion():
    up = np.random.default_rng(1).normal(size=(9, 12, 3))
    others = static_grams(up / np.linalg.norm(up, axis=2, keepdims=True))
    built, y, _ = problem(standing_on((0, 1)), (), Exciting(BLOCKS, others, 1.0, 8), frames=1, still=True)
    expected = differences(built.evaluate, y, lambda p: p.value)
    got = built.evaluate(y).gradient
    np.testing.assert_allclose(got, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("planted", [(0, 1), (0,), (1,)])
def test_planted_feet_stand_still_and_forces_agree_with_the_regressor(planted):
    built, y, _ = problem(standing_on(planted), (), nothing)
    state = built.state(y)
    for side in planted:
        ankle = CHAIN.leg_columns[side][-1]
        assert np.abs(state.velocity[:, ankle]).max() < 1e-9
        assert np.abs(state.acceleration[:, ankle]).max() < 1e-8
    motion = CHAIN.motion(np.arange(len(state.x)) * 0.01, state.x, state.v, state.a)
    np.testing.assert_allclose(predict_wrench(BODY, motion).value, state.wrench, atol=1e-8)


# ---- Distances between solids


def test_two_codes_find_the_same_distances():
    rng, feet = np.random.default_rng(0), stance(BODY, "parallel").on(0)
    x = np.array([initial_guess(CHAIN, feet, rng) for _ in range(60)])
    state = close_legs(CHAIN, feet, x, *np.zeros((2, *x.shape)))
    expected = self_collision.SelfCollision().margins(state).value
    motion = CHAIN.motion(np.arange(60.0), state.x, state.v, state.a)
    found, names = solid_distances(BODY, poses(BODY, motion.q))
    assert len(set(names)) == found.shape[1] == expected.shape[1]
    apart = (found < _ENOUGH) & (expected > 0)
    assert apart.sum() > 50
    np.testing.assert_allclose(found[apart], expected[apart], atol=2e-6)
    assert ((found < 0) == (expected < 0)).all()
    far = found >= _ENOUGH
    assert (found[far] <= expected[far] + 1e-9).all()


def test_an_arm_that_hangs_may_lie_against_trunk_and_legs():
    feet = stance(BODY, "parallel").on(0)
    x = np.zeros((1, CHAIN.size))
    x[0, 2] = 1.0
    for hanging in ((), (1,)):
        here = replace(feet, hanging=hanging)
        state = close_legs(CHAIN, here, x, *np.zeros((2, *x.shape)))
        motion = CheckedMotion(BODY, CHAIN.motion(np.zeros(1), state.x, state.v, state.a), here)
        copied = ImpreciseCopy(BODY, np.zeros(1), motion.motion.q, (here,), np.zeros(1, dtype=np.intp), still=True)
        limit = self_collision.SelfCollision()
        found = limit.check(motion)
        judged = {
            "margins": limit.margins(state).value[0],
            "check": found.value[0],
            "copies": limit.for_imprecise().left(copied).value[0],
        }
        for value in judged.values():
            close = {pair for pair, left in zip(found.of, value, strict=True) if left < 0.02}
            # both straight arms hang along the trunk: only the one of which nothing is asked may
            assert any("right_forearm_hand" in pair for pair in close)
            assert any("left_forearm_hand" in pair for pair in close) == (not hanging)


@pytest.mark.parametrize("place", [[0.3, 0.0, 0.0], [0.3, 0.4, 0.5], [0.05, 0.02, 0.01]])
def test_the_signed_distance_from_a_box(place):
    half = np.array([0.1, 0.2, 0.3])
    value, slope = outside(np.array(place), half)
    step = 1e-6 * np.eye(3)
    differences = [(outside(place + s, half)[0] - outside(place - s, half)[0]) / 2e-6 for s in step]
    np.testing.assert_allclose(slope, differences, atol=1e-6)
    assert (value < 0) == bool(np.all(np.array(place) < half))


def test_the_nearest_place_on_a_line_is_found():
    rng = np.random.default_rng(1)
    ends, half = rng.normal(0, 0.4, (50, 3, 2, 3)), rng.uniform(0.1, 0.3, (3, 3))
    share = deepest(ends, half)
    tight = np.linspace(0, 1, 2001)[:, None, None]
    along = ends[None, ..., 0, :] + tight[..., None] * (ends[..., 1, :] - ends[..., 0, :])
    best = outside(along, half)[0].min(axis=0)
    found = outside(ends[..., 0, :] + share[..., None] * (ends[..., 1, :] - ends[..., 0, :]), half)[0]
    assert (found <= best + 1e-7).all()


# ---- One number for every limit of a dance that a person works out by hand, for a woman of 65 kg and 1.75 m


def upright(**angles: float) -> np.ndarray:
    """Return coordinates (1, n) of a person who stands upright, ankles over the lab origin, soles on the ground, but
    for ``angles`` rad.
    """
    x = np.zeros((1, CHAIN.size))
    x[0, 2] = 0.371686 + 0.442392 + 0.067375  # thigh, shank, ankle
    for name, value in angles.items():
        x[0, 6 + BODY.joint_index(name)] = value
    return x


def both(
    limit: Limit,
    x: np.ndarray,
    where: Stance,
    *,
    v: np.ndarray | None = None,
    a: np.ndarray | None = None,
    body: Body = BODY,
):
    """Return the least margin and the least of the check, of one sample that is taken as it is."""
    state = State(CHAIN, where, x, *(np.zeros_like(x) if part is None else part for part in (v, a)))
    motion = CHAIN.motion(np.zeros(1), state.x, state.v, state.a)
    return limit.margins(state).value.min(), limit.check(CheckedMotion(body, motion, where)).value.min()


@pytest.mark.parametrize(("degrees", "left"), [(20.0, 86.7), (26.565, 0.0), (30.0, -49.3)])
def test_friction_a_box_on_an_incline_slips_where_the_tangent_is_the_coefficient(degrees: float, left: float) -> None:
    forward = np.zeros((1, CHAIN.size))
    forward[0, 0] = 9.80665 * np.tan(np.radians(degrees))  # on the level, pushed as much as gravity pulls on an incline
    assert both(FAMILY["friction"], upright(), feet()[0], a=forward) == pytest.approx((left, left), abs=0.05)


@pytest.mark.parametrize("pelvis", [-0.10, 0.0, 0.06, 0.12, 0.16])
def test_balance_a_rod_balances_up_to_the_share_of_half_the_base(pelvis: float) -> None:
    x = upright()
    x[0, 0], x[0, 2] = pelvis, x[0, 2] - 0.1
    state = close_legs(CHAIN, feet()[0], x, *np.zeros((2, *x.shape)))
    place = poses(BODY, CHAIN.motion(np.zeros(1), state.x, state.v, state.a).q)
    parts = BODY.sip.phi.reshape(-1, 10)
    middle = (
        sum(part[0] * place.position[0, i] + place.rotation[0, i] @ part[1:4] for i, part in enumerate(parts)) / 65.0
    )
    heel, toe = -0.07182, 0.19418
    expected = 0.6 * (toe - heel) / 2 - abs(middle[0] - (heel + toe) / 2)
    assert both(FAMILY["balance"], state.x, feet()[0]) == pytest.approx((expected, expected), abs=1e-6)


def test_the_check_forgives_rounding_only() -> None:
    assert all(0 <= limit.rounding <= 1e-8 for limit in FAMILY.values())


def test_balance_of_the_weight_over_one_foot_is_that_of_this_foot() -> None:
    over = feet()[5]  # the left one
    x = close_legs(CHAIN, over, upright() - 0.1 * np.eye(CHAIN.size)[2], *np.zeros((2, 1, CHAIN.size))).x
    inside, outside = both(FAMILY["balance"], x, feet()[0])[0], both(FAMILY["balance"], x, over)
    assert inside > 0.02
    sole = over.ankle[1, 1] - 0.6 * 0.050008  # its inner edge, drawn together, of sides that slant by 4 degrees
    assert outside == pytest.approx((-sole, -sole), abs=0.006)


@pytest.mark.parametrize(("low", "high"), [(-1e4, 2.5), (1.5, 1e4)])
def test_joint_torque_a_forearm_held_out_weighs_m_g_l_on_the_elbow(low: float, high: float) -> None:
    """Muscles that bend by 2.5 N·m at most have so much left; those that had to bend by 1.5 at least, the rest."""
    x = upright(left_elbow_flexion=np.pi / 2)
    elbow, weight = BODY.joint_index("left_elbow_flexion"), 0.227481 * 9.80665
    here, strong = np.arange(23) == elbow, np.full(23, 1e4)
    torques = {"torque_lower": np.where(here, low, -strong), "torque_upper": np.where(here, high, strong)}
    weak = replace(BODY, limits=replace(BODY.limits, **torques))
    state = State(type(CHAIN)(weak), seat(weak), x, *np.zeros((2, *x.shape)))
    left = min(weight - low, high - weight)
    assert FAMILY["joint_torque"].margins(state).value.min() == pytest.approx(left, abs=1e-4)
    assert FAMILY["joint_torque"].check(checked(state)).value.min() == pytest.approx(left, abs=1e-4)


def test_the_foot_under_the_weight_carries_it_while_a_dance_is_planned() -> None:
    """A person who leans 3 cm to the left of two feet that stand symmetrically loads them by 1/2 -+ 3 cm / distance
    (a little less: the legs stay behind).
    """
    x = upright()
    x[0, :3] += [feet()[0].centre[0], 0.03, -0.1]
    state = close_legs(CHAIN, feet()[0], x, *np.zeros((2, *x.shape)))
    right, left = state.feet[0][0, :, 2]
    apart = float(np.diff(feet()[0].sole_centres[:, 1])[0])
    assert right + left == pytest.approx(65.0 * 9.80665)
    assert left / right == pytest.approx((apart / 2 + 0.03) / (apart / 2 - 0.03), rel=0.15)


def test_joint_range_and_speed_are_what_is_left_to_the_stops() -> None:
    knee = BODY.joint_index("right_knee_flexion")
    stop, fast = BODY.limits.upper[knee], BODY.limits.velocity[knee]
    others = {f"{side}_knee_flexion": 0.5 for side in ("right", "left")} | {
        f"{side}_elbow_flexion": 0.5 for side in ("right", "left")
    }
    x = upright(**others)
    roomy = both(FAMILY["joint_range"], x, feet()[0])[0]
    assert roomy > 0.05
    x[0, 6 + knee] = stop - 0.03
    assert both(FAMILY["joint_range"], x, feet()[0]) == pytest.approx((0.03, 0.03))
    keeping = replace(FAMILY["joint_range"], keep=1.0)
    assert both(keeping, x, feet()[0]) == pytest.approx((0.03 - np.pi / 180,) * 2)
    x[0, 6 + knee] = BODY.limits.lower[knee] + 0.02
    assert both(FAMILY["joint_range"], x, feet()[0]) == pytest.approx((0.02, 0.02))
    v = np.zeros_like(x)
    v[0, 6 + knee] = -(fast + 0.25)
    assert both(FAMILY["joint_speed"], x, feet()[0], v=v) == pytest.approx((-0.25, -0.25))


def test_ground_clearance_is_the_height_of_the_lowest_corner() -> None:
    x = upright()
    x[0, 2] += 0.03
    assert both(FAMILY["ground_clearance"], x, feet()[3]) == pytest.approx((0.03, 0.03), abs=1e-6)
    higher = replace(FAMILY["ground_clearance"], height=0.02)
    assert both(higher, x, feet()[3]) == pytest.approx((0.01, 0.01), abs=1e-6)
    x[0, 6 + BODY.joint_index("right_ankle_dorsiflexion")] = -0.2  # the toes go down
    lower = 0.03 + 0.067375 - 0.067375 * np.cos(0.2) - 0.19418 * np.sin(0.2)
    assert both(FAMILY["ground_clearance"], x, feet()[3]) == pytest.approx((lower, lower), abs=1e-6)


def test_floor_is_what_is_left_under_a_hand_that_reaches_down() -> None:
    """An arm that hangs ends at the shoulder's height less the arm's length; lowered with the pelvis by 64.5 cm, its
    fingertips are 1.7 cm above the floor, and 4 cm are asked.
    """
    x = upright()
    hand = BODY.segment_index("right_forearm_hand")
    pose = poses(BODY, CHAIN.motion(np.zeros(1), x, *np.zeros((2, *x.shape))).q)
    fingertips = float(pose.position[0, hand, 2] + BODY.boxes[hand][0][1])
    assert fingertips == pytest.approx(0.662, abs=5e-4)
    assert min(both(FAMILY["floor"], x, feet()[8])) == pytest.approx(
        0.419 - 0.04, abs=2e-3
    )  # under the knees, where shanks begin
    x[0, 2] -= fingertips - 0.017
    x[0, 6 + BODY.joint_index("right_hip_flexion")] = x[0, 6 + BODY.joint_index("left_hip_flexion")] = np.pi / 2
    x[0, 6 + BODY.joint_index("right_knee_flexion")] = x[0, 6 + BODY.joint_index("left_knee_flexion")] = 0.0
    assert both(FAMILY["floor"], x, feet()[8]) == pytest.approx((-0.023, -0.023), abs=1e-6)
    assert both(replace(FAMILY["floor"], gap=0.0), x, feet()[8]) == pytest.approx((0.017, 0.017), abs=1e-6)


def test_floor_asks_of_what_is_near_it_upright_for_half_of_that_at_most() -> None:
    """Hands so long that 3 cm are left under them are asked for 1.5 cm, as the low shells of robots would be."""
    low = BODY.boxes.copy()
    low[BODY.segment_index("right_forearm_hand"), 0, 1] -= 0.632
    shell = replace(BODY, boxes=low)
    state = State(type(CHAIN)(shell), feet()[8], upright(), *np.zeros((2, 1, CHAIN.size)))
    assert FAMILY["floor"].margins(state).value.min() == pytest.approx(0.015, abs=5e-4)
    assert FAMILY["floor"].check(checked(state)).value.min() == pytest.approx(0.015, abs=5e-4)


@pytest.mark.parametrize("knee", [12.0, 40.0, 80.0])
def test_foot_placement_is_what_the_cosine_rule_leaves(knee: float) -> None:
    thigh, shank = 0.371686, 0.442392

    def length(degrees: float) -> float:
        return float(np.sqrt(thigh**2 + shank**2 + 2 * thigh * shank * np.cos(np.radians(degrees))))

    x = upright()
    x[0, 2] = 0.067375 + length(knee)
    one = stance(BODY, "parallel").on(1)
    x[0, 1] = one.ankle[1, 1] - 0.081375  # the left hip over the left ankle
    state = close_legs(CHAIN, one, x, *np.zeros((2, *x.shape)))
    expected = length(9.0) - length(knee)
    assert both(FAMILY["foot_placement"], state.x, one) == pytest.approx((expected, expected), abs=1e-6)


def test_foot_placement_a_foot_that_is_not_where_it_stands_is_seen_by_the_check() -> None:
    x = close_legs(CHAIN, feet()[0], upright() - 0.1 * np.eye(CHAIN.size)[2], *np.zeros((2, 1, CHAIN.size))).x
    assert both(FAMILY["foot_placement"], x, feet()[0])[1] > 0
    x[0, 0] += 0.01
    assert both(FAMILY["foot_placement"], x, feet()[0])[1] == pytest.approx(-0.01, abs=2e-6)


def test_grip_is_how_much_further_the_palm_may_be() -> None:
    x = upright()
    held = holding(stance(BODY, "parallel"), BODY, ("right",))
    motion = CHAIN.motion(np.zeros(1), x, *np.zeros((2, *x.shape)))
    fingertips = BODY.boxes[BODY.segment_index("right_forearm_hand")][0][1]
    palm = poses(BODY, motion.q).points(
        [BODY.segment_index("right_forearm_hand")], np.array([[0.0, 0.85 * fingertips, 0.0]])
    )[0, 0]
    hands = np.array([palm + 0.03 * np.eye(3)[1], np.full(3, np.nan)])
    assert both(FAMILY["grip"], x, replace(held, hands=hands)) == pytest.approx((0.01, 0.01), abs=1e-9)


def test_seat_is_how_much_further_a_knee_may_hang() -> None:
    where, down = seat(BODY), 0.02
    flexion = np.arccos(down / 0.371686)  # of the hip: the knee is 2 cm below it
    x = upright(right_hip_flexion=np.pi / 2, left_hip_flexion=flexion)
    x[0, 2] = where.seat
    assert both(FAMILY["seat"], x, where) == pytest.approx((0.01, 0.01), abs=1e-6)


def test_self_collision_of_two_shanks_side_by_side_is_the_width_of_the_hips_less_two_radii() -> None:
    x = upright(**{f"{side}_shoulder_adduction": -1.5 for side in ("right", "left")})
    turned = upright(**{f"{side}_shoulder_adduction": -1.5 for side in ("right", "left")}, left_hip_adduction=-0.5)
    apart = 2 * 0.081375 - 0.063 - 0.063
    state = State(CHAIN, feet()[0], x, *np.zeros((2, *x.shape)))
    found = FAMILY["self_collision"].check(checked(state))
    shanks = found.of.index("right_shank - left_shank")
    assert found.value[0, shanks] == pytest.approx(apart, abs=1e-9)
    assert FAMILY["self_collision"].margins(state).value[0, shanks] == pytest.approx(apart, abs=1e-9)
    spaced = replace(FAMILY["self_collision"], gap=0.01)
    assert spaced.check(checked(state)).value[0, shanks] == pytest.approx(apart - 0.01, abs=1e-9)
    assert spaced.margins(state).value[0, shanks] == pytest.approx(apart - 0.01, abs=1e-9)
    assert min(both(FAMILY["self_collision"], turned, feet()[0])) > max(both(FAMILY["self_collision"], x, feet()[0]))


@pytest.mark.parametrize(
    ("name", "number", "value"), [("friction", "mu", 15.0), ("friction", "mu", 0.0), ("balance", "share", 1.01)]
)
def test_a_number_beyond_what_is_legal_is_refused(name: str, number: str, value: float) -> None:
    with pytest.raises(BiodanceError, match=rf"limits\.{name}\.{number} = {value:g}; legal are"):
        replace(FAMILY[name], **{number: value})

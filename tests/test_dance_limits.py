"""One contract for every limit of a dance: its margins are what its check finds, its slopes are differences, its number is the one that a
person works out by hand, and what a protocol says of it reaches both sides.
"""

from dataclasses import fields, replace

import numpy as np
import pytest
from limit_cases import BODY, CHAIN, checked, feet, movements

from biodance.body.body import Body
from biodance.dance.excitation import blocks, dynamic_grams, dynamic_slopes, static_grams
from biodance.dance.limits import FAR, CheckedMotion, Limit, family
from biodance.dance.postures import Exciting, free_coordinates, start
from biodance.dance.programme import Programme, closed
from biodance.dance.stance import Stance, holding, seat, stance
from biodance.dance.state import State
from biodance.motion.kinematics import poses
from biodance.motion.regressor import predict_wrench

BLOCKS = blocks(BODY)
STEP = 1e-6
MOVEMENTS = 198
NEVER, DEEP = 0.05, -0.02
"""m: coal gives bounds of distances above the first, and another measure of overlap (the way out, not the depth) below the second."""
FAMILY = {limit.name: limit for limit in family()}
each_limit = pytest.mark.parametrize("limit", FAMILY.values(), ids=FAMILY.keys())


# ---- the contract


def compared(limit: Limit, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return what is left in each sample by the margins and by the check, as far as both are exact."""
    margins, check = limit.margins(state).value, limit.check(checked(state)).value
    assert (margins.size == 0) == (check.size == 0)
    left, found = (value.min(axis=1) if value.size else np.full(len(state.x), np.inf) for value in (margins, check))
    if limit.name == "self_collision" and margins.size:
        np.testing.assert_array_equal(left < DEEP, found < DEEP)
        left, found = (np.clip(value, DEEP, NEVER - limit.gap) for value in (left, found))
    return left, found


@each_limit
def test_margins_are_what_the_check_finds_on_movements_that_keep_the_limit_and_that_break_it(limit: Limit) -> None:
    pairs = [compared(limit, state) for state in movements(MOVEMENTS)]
    left, found = (np.concatenate(one) for one in zip(*pairs, strict=True))
    np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
    told = np.isfinite(left)
    broken = (left[told] < 0).mean()
    assert told.sum() >= 60
    assert 0.01 < broken < 0.99


NUMBERS = [(limit, one.name) for limit in FAMILY.values() for one in fields(limit)]


@pytest.mark.parametrize(("limit", "name"), NUMBERS, ids=[f"{limit.name}.{name}" for limit, name in NUMBERS])
def test_another_number_reaches_the_margins_and_the_check(limit: Limit, name: str) -> None:
    usual, legal = getattr(limit, name), {one.name: one.metadata for one in fields(limit)}[name]
    other = replace(limit, **{name: legal["high"] if usual < legal["high"] else (usual + legal["low"]) / 2})
    changed = 0
    for state in movements(27, seed=1):
        left, found = compared(other, state)
        np.testing.assert_allclose(found, left, rtol=1e-6, atol=1e-6)
        changed += np.sum(left != compared(limit, state)[0])
    assert changed >= 6


@pytest.mark.parametrize("where", feet(), ids=lambda one: f"{one.name}-{one.over}-{np.isfinite(one.hands).sum()}")
@each_limit
def test_slopes_equal_differences(limit: Limit, where: Stance) -> None:
    built, y, _ = programme(where, (limit,), nothing)
    point = built.judge(y)
    near = np.flatnonzero(point.margins < FAR)
    _, slopes = point.slopes(near)
    assert slopes.shape == (len(near), len(y))
    expected = differences(built.judge, y, lambda p: p.margins)[near]
    np.testing.assert_allclose(slopes, expected.reshape(slopes.shape), atol=3e-6 * (1 + np.abs(slopes).max(initial=0)))


@each_limit
def test_every_limit_says_what_it_is(limit: Limit) -> None:
    module = __import__(type(limit).__module__, fromlist=["LIMIT"])
    assert module.__doc__
    assert module.__name__.rsplit(".", 1)[1] == limit.name
    assert limit.unit
    assert limit.scale > 0
    assert all({"low", "high", "unit"} <= set(one.metadata) for one in fields(limit))


# ---- one number by hand for each: a woman of 65 kg and 1.75 m


def upright(**angles: float) -> np.ndarray:
    """Return coordinates (1, n) of a person who stands upright, ankles over the lab origin, soles on the ground, but for ``angles`` rad."""
    x = np.zeros((1, CHAIN.size))
    x[0, 2] = 0.371686 + 0.442392 + 0.067375  # thigh, shank, ankle
    for name, value in angles.items():
        x[0, 6 + BODY.joint_index(name)] = value
    return x


def both(limit: Limit, x: np.ndarray, where: Stance, *, v: np.ndarray | None = None, a: np.ndarray | None = None, body: Body = BODY):
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
    state = closed(CHAIN, feet()[0], x, *np.zeros((2, *x.shape)))
    place = poses(BODY, CHAIN.motion(np.zeros(1), state.x, state.v, state.a).q)
    parts = BODY.sip.phi.reshape(-1, 10)
    middle = sum(part[0] * place.position[0, i] + place.rotation[0, i] @ part[1:4] for i, part in enumerate(parts)) / 65.0
    heel, toe = -0.07182, 0.19418
    expected = 0.6 * (toe - heel) / 2 - abs(middle[0] - (heel + toe) / 2)
    assert both(FAMILY["balance"], state.x, feet()[0]) == pytest.approx((expected, expected), abs=1e-6)


def test_balance_of_the_weight_over_one_foot_is_that_of_this_foot() -> None:
    over = feet()[5]  # the left one
    x = closed(CHAIN, over, upright() - 0.1 * np.eye(CHAIN.size)[2], *np.zeros((2, 1, CHAIN.size))).x
    inside, outside = both(FAMILY["balance"], x, feet()[0])[0], both(FAMILY["balance"], x, over)
    assert inside > 0.02
    sole = over.ankle[1, 1] - 0.6 * 0.050008  # its inner edge, drawn together, of sides that slant by 4 degrees
    assert outside == pytest.approx((-sole, -sole), abs=0.006)


def test_joint_torque_a_forearm_held_out_weighs_m_g_l_on_the_elbow() -> None:
    x = upright(left_elbow_flexion=np.pi / 2)
    elbow, weight = BODY.joint_index("left_elbow_flexion"), 0.227481 * 9.80665
    weak = replace(
        BODY, limits=replace(BODY.limits, torque_upper=np.where(np.arange(23) == elbow, 2.5, 1e4), torque_lower=np.full(23, -1e4))
    )
    state = State(type(CHAIN)(weak), seat(weak), x, *np.zeros((2, *x.shape)))
    left = 2.5 - weight
    assert FAMILY["joint_torque"].margins(state).value.min() == pytest.approx(left, abs=1e-4)
    assert FAMILY["joint_torque"].check(checked(state)).value.min() == pytest.approx(left, abs=1e-4)


def test_joint_range_and_speed_are_what_is_left_to_the_stops() -> None:
    knee = BODY.joint_index("right_knee_flexion")
    stop, fast = BODY.limits.upper[knee], BODY.limits.velocity[knee]
    others = {f"{side}_knee_flexion": 0.5 for side in ("right", "left")} | {f"{side}_elbow_flexion": 0.5 for side in ("right", "left")}
    x = upright(**others)
    roomy = both(FAMILY["joint_range"], x, feet()[0])[0]
    assert roomy > 0.05
    x[0, 6 + knee] = stop - 0.03
    assert both(FAMILY["joint_range"], x, feet()[0]) == pytest.approx((0.03, 0.03))
    v = np.zeros_like(x)
    v[0, 6 + knee] = -(fast + 0.25)
    assert both(FAMILY["joint_speed"], x, feet()[0], v=v) == pytest.approx((-0.25, -0.25))


def test_ground_clearance_is_the_height_of_the_lowest_corner() -> None:
    x = upright()
    x[0, 2] += 0.03
    assert both(FAMILY["ground_clearance"], x, feet()[3]) == pytest.approx((0.03, 0.03), abs=1e-6)
    x[0, 6 + BODY.joint_index("right_ankle_dorsiflexion")] = -0.2  # the toes go down
    lower = 0.03 + 0.067375 - 0.067375 * np.cos(0.2) - 0.19418 * np.sin(0.2)
    assert both(FAMILY["ground_clearance"], x, feet()[3]) == pytest.approx((lower, lower), abs=1e-6)


@pytest.mark.parametrize("knee", [12.0, 40.0, 80.0])
def test_foot_placement_is_what_the_cosine_rule_leaves(knee: float) -> None:
    thigh, shank = 0.371686, 0.442392

    def length(degrees: float) -> float:
        return float(np.sqrt(thigh**2 + shank**2 + 2 * thigh * shank * np.cos(np.radians(degrees))))

    x = upright()
    x[0, 2] = 0.067375 + length(knee)
    one = stance(BODY, "parallel").on(1)
    x[0, 1] = one.ankle[1, 1] - 0.081375  # the left hip over the left ankle
    state = closed(CHAIN, one, x, *np.zeros((2, *x.shape)))
    expected = length(9.0) - length(knee)
    assert both(FAMILY["foot_placement"], state.x, one) == pytest.approx((expected, expected), abs=1e-6)


def test_foot_placement_a_foot_that_is_not_where_it_stands_is_seen_by_the_check() -> None:
    x = closed(CHAIN, feet()[0], upright() - 0.1 * np.eye(CHAIN.size)[2], *np.zeros((2, 1, CHAIN.size))).x
    assert both(FAMILY["foot_placement"], x, feet()[0])[1] > 0
    x[0, 0] += 0.01
    assert both(FAMILY["foot_placement"], x, feet()[0])[1] == pytest.approx(-0.01, abs=2e-6)


def test_grip_is_how_much_further_the_palm_may_be() -> None:
    x = upright()
    held = holding(stance(BODY, "parallel"), BODY, ("right",))
    motion = CHAIN.motion(np.zeros(1), x, *np.zeros((2, *x.shape)))
    fingertips = BODY.boxes[BODY.segment_index("right_forearm_hand")][0][1]
    palm = poses(BODY, motion.q).points([BODY.segment_index("right_forearm_hand")], np.array([[0.0, 0.85 * fingertips, 0.0]]))[0, 0]
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
    assert min(both(FAMILY["self_collision"], turned, feet()[0])) > max(both(FAMILY["self_collision"], x, feet()[0]))


# ---- slopes of criteria and of the closure, with the same small problems


def programme(where, limits, objective, *, frames=5, still=False):
    rng = np.random.default_rng(len(where.planted) + sum(where.planted[:1]))
    base = np.zeros((3, frames, CHAIN.size))
    base[0] = start(CHAIN, where, rng)
    base[0, :, 2] -= 0.15
    base[0, :, 3:6] *= 0.3
    basis = rng.normal(0, 1, (3, frames, 1 if still else 2))
    if still:
        basis[:] = np.array([1.0, 0.0, 0.0])[:, None, None]
    built = Programme(CHAIN, where, base, basis, free_coordinates(CHAIN, where), limits, objective, np.zeros((frames, len(limits))))
    return built, rng.normal(0, 0.04, basis.shape[2] * len(built.free)), rng


def differences(judge, y, what):
    return np.array([(what(judge(y + STEP * e)) - what(judge(y - STEP * e))) / (2 * STEP) for e in np.eye(len(y))]).T


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

    built, y, _ = programme(standing_on(planted), (), objective)
    expected = differences(built.judge, y, lambda p: p.value)
    got, _ = built.judge(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_slopes_of_the_static_criterion():
    up = np.random.default_rng(1).normal(size=(9, 12, 3))
    others = static_grams(up / np.linalg.norm(up, axis=2, keepdims=True))
    built, y, _ = programme(standing_on((0, 1)), (), Exciting(BLOCKS, others, 1.0, 8), frames=1, still=True)
    expected = differences(built.judge, y, lambda p: p.value)
    got, _ = built.judge(y).slopes(np.arange(0))
    np.testing.assert_allclose(got, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("planted", [(0, 1), (0,), (1,)])
def test_planted_feet_stand_still_and_forces_agree_with_the_regressor(planted):
    built, y, _ = programme(standing_on(planted), (), nothing)
    state = built.state(y)
    for side in planted:
        ankle = CHAIN.leg_columns[side][-1]
        assert np.abs(state.velocity[:, ankle]).max() < 1e-9
        assert np.abs(state.acceleration[:, ankle]).max() < 1e-8
    motion = CHAIN.motion(np.arange(len(state.x)) * 0.01, state.x, state.v, state.a)
    np.testing.assert_allclose(predict_wrench(BODY, motion).value, state.wrench, atol=1e-8)

"""One number for every limit of a dance that a person works out by hand, for a woman of 65 kg and 1.75 m: by margins
and by check.
"""

from dataclasses import replace

import numpy as np
import pytest
from limit_cases import BODY, CHAIN, checked, feet

from biodance.body.body import Body
from biodance.dance.limits import CheckedMotion, Limit, family
from biodance.dance.problem.stance import Stance, holding, seat, stance
from biodance.dance.problem.state import State, close_legs
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses

FAMILY = {limit.name: limit for limit in family()}


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

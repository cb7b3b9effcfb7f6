"""The trunk's matter at the table's cut or along with the joint: chosen by evidence; what is known together is said."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from joint_cases import displaced, hidden, scaling

from biodance.body.body import Body, body_text, parse_body
from biodance.body.parts import JointError, rigid_inertia
from biodance.identification.knowledge import known_together
from biodance.identification.loads import (
    matter_follows_joint,
    more_probable_table,
    possible_tables,
    with_matter_placed,
    with_sides,
)
from biodance.identification.posterior import Information
from biodance.motion.ik.joint_unknowns import JointUnknowns, own_centre
from biodance.records import Sip
from biodance.uncertainty.caution import from_true_centres, misplaced, widened_prior

TRUNK = 7


@cache
def low_joint() -> Body:
    """Return a person whose trunk turns 6 cm below the table's cut."""
    return displaced(hidden()).body()[0]


def moments(body: Body, true: Sip, seed: int = 0) -> Information:
    """Return data that show the trunk's ten parameters of ``true`` with a relative noise of 1 %."""
    rows = np.zeros((10, 121))
    sd = 0.01 * np.maximum(np.abs(true.phi[10 * TRUNK : 10 * TRUNK + 10]), 0.01)
    rows[:, 10 * TRUNK : 10 * TRUNK + 10] = np.diag(1 / sd)
    noise = np.random.default_rng(seed).normal(size=10)
    rows[:, -1] = rows[:, :-1] @ true.phi + noise
    square = np.linalg.qr(np.vstack([rows, np.zeros((121, 121))]), mode="r")
    return Information(square, 10)


def test_matter_along_with_the_joint_keeps_its_mass_and_its_place_over_the_joint() -> None:
    body = low_joint()
    assert body.at_joint is not None
    np.testing.assert_allclose(body.at_joint.mass, body.sip.mass)
    lower = (body.sip.com - body.at_joint.com)[TRUNK]
    assert lower[1] == pytest.approx(0.06, abs=0.01)
    limbs = [i for i in range(12) if i not in (0, TRUNK)]
    np.testing.assert_allclose(body.at_joint.com[limbs], body.sip.com[limbs], atol=1e-12)
    assert 0 < body.at_joint.com[0, 1] < body.sip.com[0, 1]  # the pelvis ends lower
    for at, times, slant in ((0, 0.5, 0.05), (10 * TRUNK, 1.1, 0.0)):  # ... and the trunk begins there
        high, low = (rigid_inertia(sip.phi[at : at + 10]).inertia for sip in (body.sip, body.at_joint))
        (depth, tall, width), now = (0.5 * np.trace(one) - np.diag(one) for one in (high, low))
        assert now[2] == pytest.approx(width, rel=1e-9)  # as wide as it was
        assert now[0] == pytest.approx(depth, rel=slant + 1e-9)  # and deep, but for the slant of the pelvis
        assert now[1] / tall == pytest.approx(times, rel=0.3)
        assert bool(now[1] > tall) is bool(at)
    assert (body.com_boxes[:, 0] <= np.minimum(body.sip.com, body.at_joint.com)).all()


def most_probable(data: Information, table: Sip, body: Body) -> tuple[Sip, bool, tuple[str, ...]]:
    """Return what `more_probable_table` says of all that the table may be."""
    return more_probable_table(data, possible_tables(table, body), body)


@pytest.mark.parametrize("along", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_the_more_probable_place_is_kept(along: bool, seed: int) -> None:
    body = low_joint()
    true = body.at_joint if along else body.sip
    found, _, words = most_probable(moments(body, true, seed), widened_prior(body.sip), body)
    assert matter_follows_joint(found, body) == along
    assert ("along with the joint" in words[0]) == along


def test_the_height_of_pelvis_and_trunk_is_known_to_the_way_between_cut_and_joint() -> None:
    body, table = low_joint(), widened_prior(low_joint().sip, low_joint().joint_errors)
    found, apart, _ = most_probable(moments(body, body.sip), table, body)
    assert not apart  # data that show no side leave the table as it is
    way = float(np.linalg.norm((body.at_joint.com - body.sip.com)[TRUNK]))
    more = np.diag(found.covariance - table.covariance).reshape(12, 10)
    for i in (0, TRUNK):
        assert more[i, 2] == pytest.approx((body.sip.mass[i] * way) ** 2)  # the first moment along the spine
        np.testing.assert_allclose(more[i, [0, 1, 3]], 0.0, atol=1e-9)  # mass and the other axes are not less known
        assert (more[i, [4, 9]] > 0).all()  # about the axes across the spine
    assert np.abs(np.delete(more, [0, TRUNK], axis=0)).max() < 1e-9
    assert most_probable(moments(body, body.sip), table, replace(body, at_joint=None)) == (table, False, ())


def test_a_prior_of_another_mass_is_placed_at_that_mass_and_back_again() -> None:
    body = low_joint()
    placed, _, _ = most_probable(moments(body, body.sip), widened_prior(body.sip), body)
    heavy = Sip(body.segments, 1.1 * placed.phi, 1.21 * np.asarray(placed.covariance))
    there = with_matter_placed(heavy, body, along=True)
    np.testing.assert_allclose(there.com, body.at_joint.com, atol=1e-12)
    assert there.mass.sum() == pytest.approx(heavy.mass.sum())
    back = with_matter_placed(there, body, along=False)
    np.testing.assert_allclose(back.phi, heavy.phi)
    np.testing.assert_allclose(back.covariance, heavy.covariance)
    assert with_matter_placed(heavy, replace(body, at_joint=None), along=True) is heavy


def legs_of(body: Body, heavier: float) -> Information:
    """Return data that show the masses of both thighs, the right one ``heavier`` kg than the table's, to 50 g."""
    rows = np.zeros((3, 121))
    rows[0, 10], rows[1, 40], rows[2, :-1:10] = 20.0, 20.0, 20.0
    true = np.array(body.sip.phi)
    true[[10, 40]] += heavier, -heavier
    rows[:, -1] = rows[:, :-1] @ true
    return Information(np.linalg.qr(np.vstack([rows, np.zeros((121, 121))]), mode="r"), 3)


def test_sides_are_alike_until_the_data_show_them_apart() -> None:
    body = replace(low_joint(), at_joint=None)
    table = widened_prior(body.sip)
    for heavier, apart in ((0.05, False), (2.0, True)):
        found, sides, words = most_probable(legs_of(body, heavier), table, body)
        assert sides == apart == bool(words)
    total, one = np.tile(np.eye(10)[0], 12), np.eye(120)[10]
    both, differ = one + np.eye(120)[40], one - np.eye(120)[40]
    for way, times in ((both, 1.0), (differ, 5.0), (total, 1.0)):  # two people's difference: 1 / (1 - 0.8)
        assert way @ found.covariance @ way == pytest.approx(times * (way @ table.covariance @ way), rel=1e-6)
    np.testing.assert_allclose(with_sides(found, apart=False).covariance, table.covariance, atol=1e-9)
    told = replace(table, measured=body.segments)
    np.testing.assert_array_equal(with_sides(told, apart=True).covariance, told.covariance)


def test_what_is_known_about_true_centres() -> None:
    placed = tuple(JointError(joint, 0.001, 0.0) for joint in ("trunk", "right_hip", "left_knee", "left_elbow"))
    body = replace(low_joint(), joint_errors=placed)
    table = widened_prior(body.sip, body.joint_errors)
    off = misplaced(table, body.joint_errors)
    nothing = from_true_centres(table, table, body.joint_errors).covariance
    np.testing.assert_allclose(nothing, table.covariance - off, atol=1e-7)  # what the table is off
    all_told = from_true_centres(replace(table, covariance=np.zeros((120, 120))), table, body.joint_errors)
    np.testing.assert_allclose(all_told.covariance, off)  # what the joints are off
    bending = (JointError("trunk", 0.03, 0.0), *placed[1:])  # a trunk that the placing leaves 3 cm off
    np.testing.assert_allclose(from_true_centres(table, table, bending).covariance, nothing, atol=1e-7)
    there = from_true_centres(replace(table, covariance=np.zeros((120, 120))), table, bending).covariance
    first = there[10 * TRUNK + 1, 10 * TRUNK + 1]
    assert first == pytest.approx((0.03 * body.sip.mass[TRUNK]) ** 2)
    draw = np.random.default_rng(5).normal(size=(120, 120))
    posterior = np.linalg.inv(np.linalg.inv(table.covariance) + draw[:, :40] @ draw[:, :40].T)
    known = from_true_centres(replace(table, covariance=posterior), table, body.joint_errors).covariance
    scale = np.sqrt(np.diag(table.covariance))
    assert np.linalg.eigvalsh(known / np.outer(scale, scale)).min() > -1e-9
    assert from_true_centres(table, table, ()).covariance[11, 11] > table.covariance[11, 11]


def test_a_body_file_keeps_both_places() -> None:
    body = low_joint()
    again = parse_body(body_text(body, "test"), "here")[0]
    np.testing.assert_array_equal(again.at_joint.phi, body.at_joint.phi)


def test_pelvis_and_thighs_are_known_together_where_one_gains_what_the_others_lose() -> None:
    body = low_joint()
    covariance = np.zeros((120, 120))
    trade = np.zeros(120)
    trade[[0, 10, 40]] = 2.0, -1.0, -1.0
    covariance += np.outer(trade, trade)
    covariance[0, 0] += 0.01
    (pair,) = known_together(Sip(body.segments, body.sip.phi, covariance))
    assert pair.segments == ("pelvis", "right_thigh", "left_thigh")
    assert pair.sd == pytest.approx(0.1)
    assert pair.first_sd == pytest.approx(np.sqrt(4.01))
    assert "together, not apart" in str(pair)
    assert known_together(Sip(body.segments, body.sip.phi, np.eye(120))) == ()


def test_pelvis_and_trunk_that_trade_more_than_pelvis_and_thighs_are_said_first() -> None:
    body, covariance = low_joint(), np.eye(120)
    covariance[0, 10] = covariance[10, 0] = -0.3
    covariance[0, 70] = covariance[70, 0] = -0.8
    trunk, thighs = known_together(Sip(body.segments, body.sip.phi, covariance))
    assert trunk.segments == ("pelvis", "trunk_head")
    assert trunk.sd == pytest.approx(np.sqrt(0.4))
    assert trunk.mass == pytest.approx(body.sip.mass[0] + body.sip.mass[TRUNK])
    assert thighs.segments == ("pelvis", "right_thigh", "left_thigh")


def test_one_leg_longer_than_the_other_is_held_against_the_joints() -> None:
    unknowns, theta = JointUnknowns(scaling().centres), np.zeros(37)
    theta[own_centre("right_knee")] = [0.0, 0.0, -0.0047]  # thigh longer, shank shorter
    residual, slope = unknowns.prior(theta)
    np.testing.assert_allclose(residual[-2:] - unknowns.prior(np.zeros(37))[0][-2:], [1.0, -1.0], atol=0.05)
    step = 1e-6 * np.random.default_rng(1).normal(size=37)
    np.testing.assert_allclose(unknowns.prior(theta + step)[0] - residual, slope @ step, atol=1e-7)

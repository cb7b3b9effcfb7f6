"""Joint torques and their bands: against pinocchio, and by Monte Carlo against known truth."""

from dataclasses import replace

import numpy as np
import pytest
from identify_trials import noisy_fit, person, smooth_motion

from biodance.errors import UnknownName
from biodance.identification.identification import identify_body
from biodance.identification.knowledge import QUANTITIES, segment_quantities
from biodance.identification.torques import ground_torques, impacts, torque_bands, torque_regressor
from biodance.motion.dynamics import joint_torques
from biodance.records import Sip, Wrench


def test_torques_are_pinocchios() -> None:
    for seed in range(4):
        body, truth, rng = person(seed, segments=5)
        motion = smooth_motion(body, rng, frames=40)
        ground = {name: Wrench(motion.time, rng.normal(0, 50, (40, 6))) for name in ("s2", "s4")}
        true_body = replace(body, sip=Sip(body.segments, truth, body.sip.covariance))
        expected = joint_torques(true_body, motion, ground).torque
        got = torque_regressor(body, motion) @ truth - ground_torques(body, motion, ground)
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_wrench_on_a_foreign_segment_is_refused() -> None:
    body, _, rng = person(0)
    motion = smooth_motion(body, rng, frames=5)
    with pytest.raises(UnknownName):
        ground_torques(body, motion, {"tail": Wrench(motion.time, np.zeros((5, 6)))})


def test_bands_hold_the_true_torques() -> None:
    inside, ratio = [], []
    for seed in range(12):
        body, truth, rng = person(50 + seed)
        found = identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=900), truth, rng),))
        motion = smooth_motion(body, rng, frames=60)
        bands = torque_bands(found, motion, {}, trial="t", use=np.ones(60, dtype=bool))
        true = torque_regressor(body, motion) @ truth
        inside.append(np.abs(true - bands.torque) <= bands.half_width)
        ratio.append(np.abs(bands.torque - true).mean() / np.abs(bands.table - true).mean())
        assert bands.joints == tuple(joint.name for joint in body.joints)
    assert 0.9 < np.mean(np.concatenate([x.ravel() for x in inside])) <= 1.0
    assert np.mean(ratio) < 0.8


def test_the_band_is_the_spread_of_the_belief() -> None:
    body, truth, rng = person(70)
    found = identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=600), truth, rng),))
    motion = smooth_motion(body, rng, frames=20)
    bands = torque_bands(found, motion, {}, trial="t", use=np.ones(20, dtype=bool))
    drawn = found.posterior.factor @ rng.normal(size=(found.posterior.factor.shape[1], 4000))
    spread = (torque_regressor(body, motion) @ drawn).std(axis=2)
    np.testing.assert_allclose(bands.sd, spread, rtol=0.1)


def test_an_impact_is_what_one_standard_deviation_does_to_the_moment() -> None:
    body, truth, rng = person(50)
    names = {1: "right_hip_flexion", 2: "right_knee_flexion"}
    joints = [replace(one, name=names.get(i, one.name)) for i, one in enumerate(body.joints)]
    body = replace(body, joints=tuple(joints))
    found = identify_body(body, (noisy_fit(body, smooth_motion(body, rng, frames=900), truth, rng),))
    motion, use = smooth_motion(body, rng, frames=60), np.arange(60) > 9
    rows = impacts(found, motion, use)
    assert rows == tuple(sorted(rows, key=lambda row: -max(row.knee, row.hip)))
    # parameters drawn from the posterior: the moment's regression on the quantity, times the quantity's spread
    drawn = rng.multivariate_normal(np.zeros(len(truth)), found.posterior.covariance, 40000)
    for row in (rows[0], rows[7]):
        cut = slice(*(10 * body.segment_index(row.segment) + np.array([0, 10])))
        slope = segment_quantities(found.sip.phi[cut])[1][QUANTITIES.index(row.quantity)]
        quantity = drawn[:, cut] @ slope
        for size, joint in ((row.knee, names[2]), (row.hip, names[1])):
            Y = torque_regressor(body, motion)[use][:, body.joint_index(joint)]
            along = (drawn @ Y.T).T @ quantity / len(drawn) / quantity.std()
            assert np.sqrt(np.mean(along**2)) == pytest.approx(size, rel=0.05)
        known = next(k for k in found.known if (k.segment, k.quantity) == (row.segment, row.quantity))
        assert row.pull == pytest.approx((known.value - known.table) / known.table_sd)
        assert row.left == pytest.approx(known.sd / known.table_sd)
    assert impacts(found, motion, np.zeros(60, dtype=bool)) == ()

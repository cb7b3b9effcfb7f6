"""No result hangs on rounding: markers that differ by a millionth of a micrometre, or stand in another order, give the
same angles and the same parameters.

Arms held out sideways are the hard case: two sets of shoulder angles are then one posture, and both lie within the
limits.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from marker_trials import RATE, markers_of
from scipy.interpolate import CubicSpline

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.skeleton import with_tracking_limits
from biodance.identification.identification import identify_body
from biodance.identification.statistics import Fit
from biodance.motion.dynamics import predict_wrench
from biodance.motion.ik.compiled.ball_step import continue_angles
from biodance.motion.ik.compiled.newton import chain_of
from biodance.motion.ik.inverse_kinematics import Minimum, better, solve_ik
from biodance.motion.kinematics import poses
from biodance.motion.track import track
from biodance.records import Array, Markers, Motion, Sip, Source, Subject, Trial, Wrench

FRAMES = 1600
SMALLEST = 1e-12
"""m by which the markers are moved: far below what any camera sees, far above the last digit."""


@cache
def woman() -> Body:
    """Return a person in the ranges of tracking."""
    return with_tracking_limits(human(Subject(62.0, 1.70, "F", 30.0)))


def arms_out(*, seed: int = 0) -> Array:
    """Return q (FRAMES, nq): slow movement, the arms about straight out sideways and turning."""
    body, rng, time = woman(), np.random.default_rng(seed), np.arange(FRAMES) / RATE
    knots = np.arange(0.0, time[-1] + 2.0, 1.0)
    middle, reach = np.zeros(len(body.joints)), np.full(len(body.joints), 0.25)
    for side in ("left", "right"):
        for angle, centre, way in (("flexion", 90.0, 100.0), ("adduction", -75.0, 30.0), ("rotation", 60.0, 50.0)):
            j = body.joint_index(f"{side}_shoulder_{angle}")
            middle[j], reach[j] = np.radians(centre), np.radians(way)
    angles = np.clip(
        middle + reach * rng.uniform(-1, 1, (knots.size, middle.size)), body.limits.lower, body.limits.upper
    )
    q = np.tile(body.neutral, (FRAMES, 1))
    q[:, 7:] = np.clip(CubicSpline(knots, angles)(time), body.limits.lower, body.limits.upper)
    return q


def recorded(*, seed: int = 0) -> Markers:
    """Return the markers of that movement as cameras see them."""
    rng = np.random.default_rng(100 + seed)
    return markers_of(woman(), arms_out(seed=seed), noise=rng.normal(0, 0.002, (FRAMES, len(woman().markers.names), 3)))


def moved(markers: Markers, seed: int) -> Markers:
    """Return the markers in another order, each moved by next to nothing."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(markers.names))
    xyz = markers.xyz[:, order] + SMALLEST * rng.normal(size=markers.xyz.shape)
    return Markers(tuple(markers.names[k] for k in order), markers.time, xyz)


def tracked(markers: Markers) -> Motion:
    """Return the motion of the person under ``markers``."""
    return track(woman(), Trial("dance", "fit", markers, (), Source(Path("/lab/dance.c3d"), "00" * 32, "C3D", RATE)))


def identified(motion: Motion, wrench: Wrench) -> Sip:
    """Return the parameters of the person in ``motion``."""
    return identify_body(woman(), (Fit("dance", motion, wrench, np.ones(FRAMES, dtype=bool)),)).sip


@pytest.mark.parametrize("dance", range(3))
def test_angles_and_parameters_do_not_hang_on_last_digits(dance):
    markers = recorded(seed=dance)
    motion = tracked(markers)
    noise = np.random.default_rng(dance).normal(size=(FRAMES, 6)) * [1, 1, 2, 0.5, 0.5, 0.3]
    heavier = predict_wrench(woman(), motion, 1.05 * woman().sip.phi).value
    wrench = Wrench(motion.time, heavier + noise)
    plain = identified(motion, wrench)
    sd = np.sqrt(np.diag(plain.covariance))
    for seed in range(2):
        other = tracked(moved(markers, seed))
        np.testing.assert_allclose(other.q, motion.q, rtol=0, atol=1e-7)
        change = np.abs(identified(other, wrench).phi - plain.phi)
        assert change.max() > 0  # the numbers did take another way
        assert (change < 1e-6 * sd).all()


def other_sets(q: Array) -> tuple[Array, Array]:
    """Return q (T, nq) with the other set of angles of both shoulders, and (T, 2) where it is within the limits."""
    body, out, inside = woman(), np.array(q), []
    for side in ("left", "right"):
        j = body.joint_index(f"{side}_shoulder_flexion")
        turned = np.pi + [1, -1, 1] * q[:, 7 + j : 10 + j]
        lower, upper = body.limits.lower[j : j + 3], body.limits.upper[j : j + 3]
        out[:, 7 + j : 10 + j] = turned - 2 * np.pi * np.round((turned - 0.5 * (lower + upper)) / (2 * np.pi))
        inside.append(((lower <= out[:, 7 + j : 10 + j]) & (out[:, 7 + j : 10 + j] <= upper)).all(axis=1))
    return out, np.array(inside).T


def test_of_two_equal_sets_of_angles_the_one_that_goes_on_from_the_frame_before_is_taken():
    body, rng = woman(), np.random.default_rng(3)
    q = arms_out()
    other, inside = other_sets(q)
    assert 200 < inside.sum() < 0.8 * inside.size
    chain = chain_of(body, list(body.markers.segment), body.markers.position)
    plain, mixed = np.array(q), np.array(q)
    flipped = inside & (rng.random(inside.shape) < 0.5)
    for k, side in enumerate(("left", "right")):
        at = 7 + body.joint_index(f"{side}_shoulder_flexion") + np.arange(3)
        mixed[np.ix_(flipped[:, k], at)] = other[np.ix_(flipped[:, k], at)]
    mixed_before = np.array(mixed)
    for one in (plain, mixed):
        continue_angles(chain, one)
    np.testing.assert_allclose(mixed, plain, rtol=0, atol=1e-12)
    np.testing.assert_allclose(poses(body, plain).rotation, poses(body, q).rotation, atol=1e-12)
    assert (plain[:, 7:] >= body.limits.lower).all()
    assert (plain[:, 7:] <= body.limits.upper).all()
    assert goes_on(plain).all()
    assert not goes_on(mixed_before).all()


def goes_on(q: Array) -> Array:
    """Return (T, 2) whether the angles of each shoulder are nearer to those of the frame before (the first to zero)
    than the other set, where this is within the limits.
    """
    other, inside = other_sets(q)
    found = ~inside
    for k, side in enumerate(("left", "right")):
        at = 7 + woman().joint_index(f"{side}_shoulder_flexion") + np.arange(3)
        before = np.concatenate([np.zeros((1, 3)), q[:-1, at]])
        found[:, k] |= np.abs(q[:, at] - before).sum(axis=1) <= np.abs(other[:, at] - before).sum(axis=1) + 1e-6
    return found


@pytest.mark.parametrize("dance", range(3))
def test_tracked_angles_go_on_from_frame_to_frame(dance):
    assert goes_on(solve_ik(woman(), recorded(seed=dance)).q).all()


def test_of_minima_that_differ_by_rounding_the_first_is_taken():
    cost = np.array([1e-3, 1e-3])
    one, other = (Minimum(np.full((2, 1), value), cost, cost) for value in (1.0, 2.0))
    lower = np.array([1e-3 - 1e-15, 1e-3 - 1e-6])
    assert better(one, other._replace(cost=lower)).q.ravel().tolist() == [1.0, 2.0]

"""Elementary errors: forward equal to the transpose, and to what tracking and the rates of momentum make of a small
error by other code."""

from dataclasses import replace
from functools import cache, reduce
from operator import mul

import numpy as np
import pytest
from diagnosed_sessions import body, motion
from identify_trials import person, smooth_motion
from scipy.fft import dct
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from biodance.body.body import Body
from biodance.body.changes import recentre_joint
from biodance.body.parts import GRAVITY, rigid_inertia
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import chains, chart_of, neighbours, poses
from biodance.records import Array, Motion
from biodance.uncertainty.response import ErrorSource, Response, derivatives
from biodance.uncertainty.sources import (
    Centre,
    Flesh,
    Sag,
    Slide,
    Tilt,
    forward,
    joint_of,
    of_clusters,
    of_markers,
    transpose,
)

SMALL = 1e-4
FRAMES = 150


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("family", [lambda one: (*of_clusters(one), Centre(one)), of_markers])
def test_forward_and_transpose_are_one_map(seed: int, family) -> None:
    one, _, rng = person(seed)
    moving, weight = smooth_motion(one, rng, frames=61), rng.normal(size=(61, 6, 5))  # no multiple of four
    errors = forward(family(one), moving)
    back = transpose(family(one), Response.of(one, moving), weight)
    there = np.einsum("tck,tcp->kp", errors.wrench, weight)
    x = rng.normal(size=len(errors.groups))
    np.testing.assert_allclose(back, there, rtol=1e-9, atol=1e-9 * np.abs(there).max())
    assert np.sum((errors.wrench @ x)[..., None] * weight) == pytest.approx(np.sum(x @ back), rel=1e-9)
    assert len(errors.groups) == len(errors.joints) == len(back)


@cache
def moving() -> Motion:
    whole = motion(3)
    return Motion(whole.time[:FRAMES], whole.q[:FRAMES], whole.v[:FRAMES], whole.a[:FRAMES])


def needed(com: Array, turn: Array) -> Array:
    """Return the wrench (T, 6) of matter whose segments' centres of mass are at ``com`` (T, N, 3), turned by ``turn``
    (T, N, 3, 3).
    """
    lumps, time = [rigid_inertia(phi) for phi in body().sip.phi.reshape(-1, 10)], moving().time
    mass, own = np.array([lump.mass for lump in lumps]), np.array([lump.inertia for lump in lumps])

    def rate(values: Array) -> Array:
        return make_interp_spline(time, values, k=5).derivative(1)(time)

    whirl = rate(turn) @ np.swapaxes(turn, -1, -2)
    spin = np.stack([whirl[..., 2, 1], whirl[..., 0, 2], whirl[..., 1, 0]], axis=-1)
    momentum = mass[:, None] * rate(com)
    angular = np.cross(com, momentum) + ((turn @ own @ np.swapaxes(turn, -1, -2)) @ spin[..., None])[..., 0]
    force = rate(momentum.sum(axis=1)) - mass.sum() * GRAVITY
    return np.concatenate(
        [force, rate(angular.sum(axis=1)) - np.cross(com, mass[:, None] * GRAVITY).sum(axis=1)], axis=1
    )


def stepped(q: Array, k: int, size: float | Array) -> Array:
    """Return positions (T, nq) a step along coordinate ``k`` (root place, root turn in the lab, angles)."""
    out = q.copy()
    if 3 <= k < 6:
        spin = Rotation.from_rotvec(np.multiply.outer(size * np.ones(len(q)), np.eye(3)[k - 3]))
        out[:, 3:7] = (spin * Rotation.from_quat(q[:, 3:7])).as_quat()
    else:
        out[:, k if k < 3 else k + 1] += size
    return out


def tracked(target: Array, moved: Array) -> Array:
    """Return the positions at which model markers, displaced by ``moved``, are nearest to ``target`` (T, M, 3):
    Gauss-Newton.
    """
    one, q = body(), np.array(moving().q)
    worn, weight = list(one.markers.segment), np.sqrt(np.repeat(one.markers.weight, 3))

    def left(at: Array) -> Array:
        return ((poses(one, at).points(worn, one.markers.position) + moved - target).reshape(len(at), -1)) * weight

    for _ in range(2):
        now = left(q)
        slope = np.stack([(left(stepped(q, k, 1e-6)) - now) / 1e-6 for k in range(one.nv)], axis=2)
        step = -np.stack([np.linalg.lstsq(a, b, rcond=1e-8)[0] for a, b in zip(slope, now, strict=True)])
        for k in range(one.nv):
            q = stepped(q, k, step[:, k])
    return q


def brute(moved: Array, places: Array, turns: Array) -> tuple[Array, Array]:
    """Return wrench (T, 6) and mean residual (M, 3) of a model that errs by ``moved`` (T, M, 3), ``places``,
    ``turns`` (T, N, 3).
    """
    one, worn = body(), list(body().markers.segment)
    true = poses(one, moving().q)
    target = true.points(worn, one.markers.position)
    q = tracked(target, SMALL * moved)
    every, found = list(range(len(one.segments))), poses(one, q)
    turned = Rotation.from_rotvec(SMALL * turns.reshape(-1, 3)).as_matrix().reshape(*turns.shape, 3) @ found.rotation
    after = needed(found.points(every, one.sip.com) + SMALL * places, turned)
    before = needed(true.points(every, one.sip.com), true.rotation)
    residual = found.points(worn, one.markers.position) + SMALL * moved - target
    local = np.swapaxes(true.rotation[:, worn], -1, -2) @ residual[..., None]
    return (after - before) / SMALL, local[..., 0].mean(axis=0) / SMALL


def turned(one: Body, q: Array, axis: int) -> Array:
    """Return (T,) how far an ``axis`` of a joint is turned, from the product of the turns about all axes of the joint:
    2 sin(theta / 2) of theta about u, along the axis; of a hinge theta.
    """
    chain = next(chain for chain in chains(one) if axis in chain)
    if len(chain) == 1:
        return np.asarray(q[:, 7 + axis])
    whole = reduce(mul, (Rotation.from_rotvec(q[:, 7 + j, None] * one.joints[j].axis) for j in chain))
    return np.asarray(2 * whole.as_quat(canonical=True)[:, :3] @ one.joints[axis].axis)


def test_a_raised_arm_turns_without_a_jump() -> None:
    one = body()
    chain = next(chain for chain in chains(one) if joint_of(one, chain) == "left_shoulder")
    axes = np.array([one.joints[j].axis for j in chain])
    # The arm is led past the posture in which the middle axis stands at a right angle, and turned there.
    share = np.linspace(0.0, 1.0, 201)[:, None]
    path = Rotation.from_rotvec(share * 1.9 * axes[1] + 0.3 * share * (1 - share) * axes[0])
    q = np.tile(one.neutral, (len(share), 1))
    chart = chart_of(one)
    smooth = chart.smooth(q.T)
    group = int(np.flatnonzero(chart.ball[0] == chain[0])[0])
    # In the joint's own right-handed triad.
    smooth.ball[:3, group] = np.linalg.det(axes) * axes @ path.as_quat().T[:3]
    smooth.ball[3, group] = path.as_quat().T[3]
    near = np.zeros((len(one.joints), len(share)))
    q = chart.posture(smooth, near).T
    cardan = q[:, [7 + j for j in chain]]
    assert np.abs(np.diff(cardan, axis=0)).max() > 1.0
    turns = chart.turns(q.T)[list(chain)].T
    half = path.magnitude()[:, None] / 2
    np.testing.assert_allclose(
        turns, 2 * np.sin(half) * (path.as_rotvec() @ axes.T) / np.maximum(2 * half, 1e-9), atol=1e-9
    )
    assert np.abs(np.diff(turns, axis=0)).max() < 0.02


def test_a_ball_joint_is_turned_by_less_than_half_a_turn() -> None:
    one = body()
    q = np.tile(one.neutral, (50, 1))
    axis = one.joint_index("right_shoulder_flexion")
    # Cardan angles a whole turn on are the same posture; the quaternion of their half angles is the negative one.
    q[:, 7 + axis] = 0.4 + 2 * np.pi + 0.1 * np.sin(np.arange(50) / 5)
    turns = chart_of(one).turns(q.T)[axis]
    np.testing.assert_allclose(turns, 2 * np.sin((q[:, 7 + axis] - 2 * np.pi) / 2), atol=1e-12)


def disturbed(kind: str) -> tuple[ErrorSource, int, Array, Array, Array]:
    """Return a source, the index of one of its errors, and what that error displaces at unchanged coordinates, by
    construction.
    """
    one = body()
    true, worn = poses(one, moving().q), np.array(one.markers.segment)
    marker, com = (
        true.points(list(worn), one.markers.position),
        true.points(list(range(len(one.segments))), one.sip.com),
    )
    moved, places, turns = np.zeros_like(marker), np.zeros_like(com), np.zeros_like(com)
    if kind in ("slide", "alone"):
        s = one.segment_index("right_thigh")
        source = (of_clusters if kind == "slide" else of_markers)(one)[0]
        first, beside = source.groups.index("slide thigh"), np.flatnonzero(neighbours(one)[:, s])
        on = np.flatnonzero(worn == s)[: None if kind == "slide" else 1]
        moved[:, on] = -(turned(one, moving().q, beside[1])[:, None] * true.rotation[:, s, :, 0])[:, None]
        return source, first + 1, moved, places, turns
    if kind == "sag":
        source, s = Sag(one), one.segment_index("left_shank")
        on = worn == s
        time, middle = moving().time, marker[:, on].mean(axis=1)
        moved[:, on] = (make_interp_spline(time, middle, k=5).derivative(2)(time) - GRAVITY)[:, None]
        return source, sorted(set(worn)).index(s), moved, places, turns
    if kind == "flesh":
        source, s = Flesh(one), one.segment_index("right_shank")
        beside = np.flatnonzero(neighbours(one)[:, s])
        places[:, s] = turned(one, moving().q, beside[0])[:, None] * true.rotation[:, s, :, 0]
        return source, source.groups.index("flesh shank"), moved, places, turns
    if kind == "tilt":
        source = Tilt(one)
        k = source.joints.index("right_knee")
        joint = one.joint_index("right_knee_flexion")
        axis = one.joints[joint].axis
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        spin = moving().q[:, 7 + joint, None] * (true.joint_rotation[:, joint] @ (across / np.linalg.norm(across)))
        origin = true.joint_position[:, joint]
        for s in map(one.segment_index, ("right_shank", "right_foot")):
            turns[:, s], places[:, s] = spin, np.cross(spin, com[:, s] - origin)
            moved[:, worn == s] = np.cross(spin[:, None], marker[:, worn == s] - origin[:, None])
        return source, k, moved, places, turns
    source, name = Centre(one), kind
    chain = next(chain for chain in chains(one) if joint_of(one, chain) == name)
    away = recentre_joint(one, chain[0], SMALL * np.eye(3)[1])
    there = poses(away, moving().q)
    moved = (there.points(list(worn), away.markers.position) - marker) / SMALL
    places = (there.points(list(range(len(one.segments))), away.sip.com) - com) / SMALL
    return source, source.joints.index(name) + 1, moved, places, turns


def slow(wrench: Array) -> Array:
    """Return the coefficients below 1.5 Hz: accelerations of the movement have kinks, whose second derivatives no two
    formulas share.
    """
    return dct(wrench, norm="ortho", axis=0)[: int(1.5 * 2 * len(wrench) / moving().rate)]


@pytest.mark.parametrize("kind", ["slide", "alone", "sag", "flesh", "tilt", "trunk", "right_hip", "left_elbow"])
def test_a_small_error_does_what_tracking_and_momentum_make_of_it(kind: str) -> None:
    source, k, *displaced = disturbed(kind)
    found = forward((source,), moving())
    wrench, left = brute(*displaced)
    got, wanted = (slow(value) if kind == "sag" else value[8:-8] for value in (found.wrench[..., k], wrench))
    np.testing.assert_allclose(got, wanted, atol=(0.02 if kind == "sag" else 0.01) * np.abs(wanted).max())
    np.testing.assert_allclose(found.markers[..., k], left, atol=0.01 * max(np.abs(left).max(), 1e-3))


def test_squares_are_those_of_the_residuals() -> None:
    one, _, rng = person(5)
    trial = Response.of(one, smooth_motion(one, rng, frames=40))
    hat = np.eye(trial.J.shape[1]) + trial.J @ trial.follow
    segment, angle = one.markers.segment[1], np.flatnonzero(neighbours(one)[:, one.markers.segment[1]])[0]
    source = of_markers(one)[0]
    rank = sum(s == segment for s in one.markers.segment[:1])
    column = sum(
        pattern.shape[2] * int(neighbours(one)[:, s].sum()) for s, pattern in enumerate(source.patterns[:segment])
    )
    column += 3 * rank * int(neighbours(one)[:, segment].sum())
    moved = np.zeros((40, len(one.markers.names), 3))
    moved[:, 1] = trial.pose.rotation[:, segment, :, 0] * trial.joints[:, angle, None]
    left = (hat @ moved.reshape(40, -1, 1)).reshape(40, -1, 3)
    assert source.squares(trial)[column] == pytest.approx(np.mean(np.sum(left**2, axis=2)), rel=1e-9)
    for other in (Flesh(one), Centre(one), Tilt(one), Sag(one)):
        assert other.squares(trial).shape == (len(other.groups),)
    assert not Flesh(one).squares(trial).any()


def test_derivatives_of_a_wave() -> None:
    time = np.arange(300) / 25.0
    second, first = derivatives(300)
    wave = np.sin(2 * np.pi * 4.0 * time)[:, None]
    slope, bend = np.zeros((2, 300, 1))
    first.add(25.0, wave, slope)
    second.add(25.0**2, wave, bend)
    inside, w = slice(10, -10), 8 * np.pi
    np.testing.assert_allclose(slope[inside, 0], w * np.cos(w * time)[inside], atol=0.01 * w)
    np.testing.assert_allclose(bend[inside], -(w**2) * wave[inside], atol=0.02 * w**2)


def test_a_derivative_is_the_transpose_of_its_transpose() -> None:
    here, there = np.random.default_rng(0).normal(size=(2, 300, 2))
    for one in derivatives(300):
        forth, back = np.zeros((2, 300, 2))
        one.add(3.0, here, forth)
        one.add_transposed(3.0, there, back)
        assert np.sum(forth * there) == pytest.approx(np.sum(here * back), rel=1e-12)


def test_the_brute_wrench_is_the_predicted_one() -> None:
    true = poses(body(), moving().q)
    found = needed(true.points(list(range(12)), body().sip.com), true.rotation)
    expected = predict_wrench(body(), moving()).value
    np.testing.assert_allclose(found[8:-8], expected[8:-8], atol=0.01 * np.abs(expected).max())


def test_a_slide_needs_markers() -> None:
    one = replace(
        body(), markers=replace(body().markers, names=(), segment=(), position=np.zeros((0, 3)), weight=np.zeros(0))
    )
    assert not Slide(one, tuple(np.empty((0, 3, 0)) for _ in one.segments)).groups

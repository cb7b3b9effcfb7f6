"""What wrong kinematics can do to the predicted wrench: one column for every elementary error of skin, flesh, joint centres and hinges.

The errors of `identify/twins.py`, one at a time instead of drawn together: the markers of a segment slide as a whole (three translations,
three rotations) in proportion to the angle of a joint beside it; its flesh likewise; a joint centre lies elsewhere; a hinge is tilted. Each
passes through the inverse kinematics to first order. As nuisances with learned sizes they let coherent soft tissue explain what it can.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.body.body import Body
from biodance.identify.twins import Twins, central_inertia, disturbance, neighbours
from biodance.motion.kinematics import Poses, cross, poses, segment_motion
from biodance.motion.marker_jacobian import chains, jacobian, skew
from biodance.records import Array, Motion

REACH = 0.1
"""m: lever that makes a turn of a marker cluster comparable with its translation."""
RATE = 25.0
"""Hz at which elementary errors are computed: 1 % of what 50 Hz gives, below the upper edge of the bands."""


@dataclass(frozen=True, eq=False)
class Errors:
    """What K elementary errors do in one trial.

    ``groups`` (K) names such as ``slide thigh`` (m/rad), ``sag thigh`` (s²), ``flesh thigh`` (m/rad), ``centre hip`` (m), ``tilt knee``
    (rad); ``wrench`` (T, 6, K) added to the wrench that the motion needs beyond the predicted one, about the lab origin; ``markers``
    (M, 3, K) m, mean residual of every marker, model less measured, segment axes.
    """

    groups: tuple[str, ...]
    wrench: Array
    markers: Array


def kinematic_errors(body: Body, motion: Motion) -> Errors:
    """Return the elementary errors of ``body`` during ``motion`` in unit size; computed at about `RATE` and interpolated."""
    wanted, motion = motion.time, _slower(motion)
    pose = poses(body, motion.q)
    angles = motion.q[:, body.nq - len(body.joints) :]
    response = _Response.of(body, motion, pose)
    parts = [
        _slides(body, pose, angles, response),
        _sags(body, motion, pose, response),
        _flesh(body, pose, angles, response),
        _joints(body, motion, pose, response),
    ]
    wrench = differentiated(np.concatenate([part[1] for part in parts], axis=3), motion.time, wanted)
    return Errors(tuple(n for part in parts for n in part[0]), wrench, np.concatenate([part[2] for part in parts], axis=2))


Part = tuple[list[str], Array, Array]
"""Names (K), functionals (T, 3, 6, K) whose second, first and zeroth derivative add up to the wrench, marker residuals (M, 3, K)."""


@dataclass(frozen=True, eq=False)
class _Response:
    """How a trial answers: ``place``, ``turn`` (T, N, 3, 6, 3) functionals of a segment's CoM moved and turned; ``tangent``
    (T, 3, 6, nv) of the coordinates; ``gain`` (T, nv, 3M) coordinates per marker displacement; ``J`` (T, 3M, nv) markers per coordinate.
    """

    place: Array
    turn: Array
    tangent: Array
    gain: Array
    J: Array

    @classmethod
    def of(cls, body: Body, motion: Motion, pose: Poses) -> "_Response":
        everything, segment = list(range(len(body.segments))), list(body.markers.segment)
        frames, shape = motion.time.size, (motion.time.size, len(everything), 3, body.nv)
        J, _ = jacobian(body, pose, segment, pose.points(segment, body.markers.position))
        moved, turned = (part.reshape(shape) for part in jacobian(body, pose, everything, pose.points(everything, body.sip.com)))
        place, turn = functionals(body, motion)
        tangent = np.zeros((frames, 18, body.nv))
        for s in everything:
            tangent += place[:, s].reshape(frames, 18, 3) @ moved[:, s] + turn[:, s].reshape(frames, 18, 3) @ turned[:, s]
        weighted = np.swapaxes(np.repeat(body.markers.weight, 3)[:, None] * J, 1, 2)
        normal = weighted @ J
        ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / body.nv * np.eye(body.nv)
        return cls(place, turn, tangent.reshape(frames, 3, 6, body.nv), -np.linalg.solve(normal + ridge, weighted), J)


def functionals(body: Body, motion: Motion) -> tuple[Array, Array]:
    """Return (T, N, 3, 6, 3) twice: what a displacement u (m, lab) of a segment's CoM and a turn r (rad, lab) of the segment do.

    The wrench changes by d2/dt2 (F2 u) + d/dt (F1 u) + F0 u, listed in this order; from the rate of momentum and angular momentum.
    """
    move = segment_motion(body, motion)
    frames, count = motion.time.size, len(body.segments)
    mass = body.sip.mass[:, None, None]
    com = (move.rotation @ body.sip.com[..., None])[..., 0] + move.position
    inertia = move.rotation @ central_inertia(body) @ np.swapaxes(move.rotation, -1, -2)
    spin = (inertia @ move.angular_velocity[..., None])[..., 0]
    whirl = skew(move.angular_velocity)
    place, turn = np.zeros((2, frames, count, 3, 6, 3))
    place[:, :, 0, :3] = mass * np.eye(3)
    place[:, :, 0, 3:] = mass * skew(com)
    place[:, :, 1, 3:] = -2 * mass * skew(np.gradient(com, 1.0 / motion.rate, axis=0))
    place[:, :, 2, 3:] = mass * skew(body.gravity)
    turn[:, :, 0, 3:] = inertia
    turn[:, :, 1, 3:] = -skew(spin) - (whirl @ inertia - inertia @ whirl)
    return place, turn


def differentiated(functional: Array, time: Array, wanted: Array) -> Array:
    """Return (T, 6, K) at ``wanted`` (T,) s: second derivative of the first, first of the second, and the third of ``functional``
    (F, 3, 6, K) at ``time`` (F,) s; held beyond its last frame.
    """
    spline = make_interp_spline(time, np.eye(time.size), k=min(5, time.size - 1))
    inside = np.minimum(wanted, time[-1])
    second, first, plain = np.moveaxis(functional, 1, 0).reshape(3, time.size, -1)
    parts = (spline.derivative(2)(inside) @ second, spline.derivative(1)(inside) @ first, spline(inside) @ plain)
    return np.asarray(sum(parts)).reshape(wanted.size, 6, -1)


def _slower(motion: Motion) -> Motion:
    """Return the motion at about `RATE`."""
    step = max(1, int(motion.rate / RATE + 1e-6))
    return Motion(motion.time[::step], motion.q[::step], motion.v[::step], motion.a[::step])


def _slides(body: Body, pose: Poses, angles: Array, response: _Response) -> Part:
    """Return the errors of skin over bone: every rigid pattern of a segment's markers times every angle beside it."""
    segment, beside = np.array(body.markers.segment), neighbours(body)
    names: list[str] = []
    values, left = [], []
    for s, name in enumerate(body.segments):
        on, near = np.flatnonzero(segment == s), np.flatnonzero(beside[:, s])
        if not on.size:
            continue
        patterns = _patterns(body.markers.position[on])
        local = np.stack(patterns, axis=2)
        moved = -np.einsum("tij,mjp->tmip", pose.rotation[:, s], local).reshape(len(angles), 3 * on.size, -1)
        rows = (3 * on[:, None] + np.arange(3)).ravel()
        tangent = response.gain[:, :, rows] @ moved
        functional = (response.tangent.reshape(len(angles), 18, -1) @ tangent)[..., None] * angles[:, None, None, near]
        values.append(functional.reshape(len(angles), 3, 6, -1))
        residual = response.J @ tangent
        residual[:, rows] += moved
        left.append(_mean_local(body, pose, residual, angles[:, near]))
        names += [f"slide {kind_of(name)}"] * (len(patterns) * near.size)
    return names, np.concatenate(values, axis=3), np.concatenate(left, axis=2)


def _sags(body: Body, motion: Motion, pose: Poses, response: _Response) -> Part:
    """Return the errors of markers on flesh that yields to its own weight and acceleration, segment by segment (s²: m per m/s²)."""
    segment, move, frames = np.array(body.markers.segment), segment_motion(body, motion), motion.time.size
    names: list[str] = []
    values, left = [], []
    for s, name in enumerate(body.segments):
        on = np.flatnonzero(segment == s)
        if not on.size:
            continue
        arm = move.rotation[:, s] @ body.markers.position[on].mean(axis=0)
        w = move.angular_velocity[:, s]
        acceleration = move.acceleration[:, s] + cross(move.angular_acceleration[:, s], arm) + cross(w, cross(w, arm))
        moved = np.tile(acceleration - body.gravity, (1, on.size))[:, :, None]
        rows = (3 * on[:, None] + np.arange(3)).ravel()
        tangent = response.gain[:, :, rows] @ moved
        values.append((response.tangent.reshape(frames, 18, -1) @ tangent).reshape(frames, 3, 6, 1))
        residual = response.J @ tangent
        residual[:, rows] += moved
        left.append(_mean_local(body, pose, residual, np.ones((frames, 1))))
        names.append(f"sag {kind_of(name)}")
    return names, np.concatenate(values, axis=3), np.concatenate(left, axis=2)


def _mean_local(body: Body, pose: Poses, residual: Array, weight: Array) -> Array:
    """Return (M, 3, P * n): mean over time of residuals (T, 3M, P) in segment axes, times ``weight`` (T, n)."""
    frames, segment = len(residual), list(body.markers.segment)
    local = np.swapaxes(pose.rotation[:, segment], -1, -2) @ residual.reshape(frames, len(segment), 3, -1)
    return np.asarray(local.reshape(frames, -1).T @ weight / frames).reshape(len(segment), 3, -1)


def _flesh(body: Body, pose: Poses, angles: Array, response: _Response) -> Part:
    """Return the errors of matter that moves against its segment in proportion to an angle beside it."""
    names: list[str] = []
    values = []
    beside = neighbours(body)
    for s, name in enumerate(body.segments):
        near = np.flatnonzero(beside[:, s])
        unit = response.place[:, s].reshape(len(angles), 18, 3) @ pose.rotation[:, s]
        values.append((unit[..., None] * angles[:, None, None, near]).reshape(len(angles), 3, 6, -1))
        names += [f"flesh {kind_of(name)}"] * (3 * near.size)
    return names, np.concatenate(values, axis=3), np.zeros((len(body.markers.names), 3, len(names)))


def _joints(body: Body, motion: Motion, pose: Poses, response: _Response) -> Part:
    """Return the errors of joint centres that lie elsewhere, and of hinges that are tilted."""
    frames, n, segments = motion.time.size, len(body.joints), len(body.segments)
    firsts = chains(body)
    centres = [(chain[0], axis) for chain in firsts for axis in np.eye(3)]
    tilts = [(chain[0], axis) for chain in firsts if len(chain) == 1 for axis in _across(body.joints[chain[0]].axis)]
    names = [f"centre {joint_kind(body.joints[j].name)}" for j, _ in centres]
    names += [f"tilt {joint_kind(body.joints[j].name)}" for j, _ in tilts]
    count, markers = len(names), len(body.markers.names)
    still = np.zeros((n, markers, 3, count)), np.zeros((n, segments, 3, count))
    centre, tilt = np.zeros((2, n, 3, count))
    for k, (j, axis) in enumerate([*centres, *tilts]):
        (centre if k < len(centres) else tilt)[j, :, k] = axis
    wrong = disturbance(body, motion, pose, Twins(*still, centre, tilt))
    moved = wrong.markers.reshape(frames, 3 * markers, count)
    tangent = response.gain @ moved
    value = response.tangent.reshape(frames, 18, -1) @ tangent
    for s in range(segments):
        value += response.place[:, s].reshape(frames, 18, 3) @ wrong.places[:, s]
        value += response.turn[:, s].reshape(frames, 18, 3) @ wrong.turns[:, s]
    left = _mean_local(body, pose, moved + response.J @ tangent, np.ones((frames, 1)))
    return names, value.reshape(frames, 3, 6, count), left


def _patterns(places: Array) -> list[Array]:
    """Return the rigid displacements (M, 3) of markers at ``places`` (M, 3): three translations, and turns that are not null."""
    middle = places - places.mean(axis=0)
    turns = [np.cross(axis, middle) / REACH for axis in np.eye(3)]
    return [np.tile(axis, (len(places), 1)) for axis in np.eye(3)] + [turn for turn in turns if np.abs(turn).max() > 1e-6]


def _across(axis: Array) -> list[Array]:
    """Return two unit vectors square to ``axis``."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return [first, np.cross(axis, first)]


def kind_of(segment: str) -> str:
    """Return a segment's name without its side."""
    return segment.removeprefix("right_").removeprefix("left_")


def joint_kind(name: str) -> str:
    """Return the anatomical joint, without side and axis, that a coordinate belongs to."""
    return kind_of(name.rsplit("_", 1)[0])

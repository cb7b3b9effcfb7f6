"""Positions, velocities and accelerations of a body from the noisy postures of its frames, consistent on the manifold
of postures.

The ends of a trial are continued with their acceleration mirrored (`_continued_at_the_ends`): point reflection, as of
forces, makes the acceleration at the ends zero, which costs a walker half the body weight in the last frames.

The smooth coordinates of ``chart`` (root position, quaternions of the root and of every ball joint, other angles) pass
the same low-pass as the forces, the quaternions are made unit again, and a quintic spline through the samples gives the
derivatives in closed form; nothing is differenced. With u a unit quaternion, P = u^-1 u' is half the angular velocity
in the turned frame, and half its derivative is the vector part of u^-1 u'' - P² (docs/derivations.md, "Smoothing").
"""

import numpy as np
from scipy.interpolate import make_interp_spline

from biodance.body.body import Body
from biodance.errors import TrialRefused
from biodance.lab.filters import LowPass, low_pass
from biodance.lab.markers.time_axis import LONGEST_STEP
from biodance.motion.ik.chart import Balls, Chart, Smooth, chart_of, continued
from biodance.records import Array, Motion
from biodance.records.arrays import rate_of
from biodance.spatial import cross, quaternion_conjugate, quaternion_matrix, quaternion_product

_DEGREE = 5
"""Degree of the spline: continuous acceleration and jerk."""

_PERIODS = 3
"""Periods of the cut-off by which the ends are continued."""

LEAST_COSINE = 1e-3
"""Smallest |cos| of a ball joint's second angle that rates are divided by: bounded near the singularity."""


_BLOCK = 2048
"""Frames whose angles are taken from the smooth coordinates together: little memory, whatever the length."""


def smooth(body: Body, time: Array, q: Array, *, settings: LowPass | None = None) -> Motion:
    """Return the smoothed motion of ``body`` from the postures ``q`` (T, nq) at the times ``time`` (T,) s, evenly
    spaced.

    ``settings`` None: the default low-pass. A single frame, and each of frames that lie too far apart to tell a
    movement between them (`LONGEST_STEP`), is a posture at rest: v and a are zero. Joint angles may leave their limits
    by what the filter rounds off; in the first and last half period of the cut-off v and a are less certain. Root v and
    a: linear, angular, in the root's own frame, a = dv/dt (Pinocchio's convention).

    Raises
    ------
    TrialRefused
        The frames are unevenly spaced, hold NaN, or are too few for the low-pass.
    """
    settings = settings or LowPass()
    _check(time, q, settings)
    names = tuple(joint.name for joint in body.joints)
    if len(time) == 1 or np.median(np.diff(time)) > LONGEST_STEP:
        rest = np.zeros((len(time), body.nv))
        return Motion(time, q, rest, rest, joint_names=names)
    chart = chart_of(body)
    rough = np.asarray(q).T
    even, first, second = _slow(chart, rough, rate_of(time), settings)
    posture, v, a = (np.empty((len(time), count)) for count in (body.nq, body.nv, body.nv))
    for start in range(0, len(time), _BLOCK):
        part = slice(start, start + _BLOCK)
        near, at = rough[len(rough) - chart.joint_count :, part], (one.at(part) for one in (even, first, second))
        posture[part], v[part], a[part] = _moving(chart, near, *at)
    for filled in (posture, v, a):
        filled.setflags(write=False)  # the record keeps them without a copy
    return Motion(time, posture, v, a, joint_names=names)


def _moving(chart: Chart, near: Array, at: Smooth, first: Smooth, second: Smooth) -> tuple[Array, Array, Array]:
    """Return posture (B, nq), v and a (B, nv) from the coordinates of ``chart`` and their two first derivatives;
    ``near`` (n, B) rad decides between equal sets of angles.
    """
    joints, n_root = chart.joints, chart.n_root
    posture = chart.posture(at, near)
    v, a = np.empty((2, n_root + chart.joint_count, near.shape[1]))
    v[n_root + chart.single], a[n_root + chart.single] = first.angle, second.angle
    angles = joints.angles_of(posture[len(posture) - chart.joint_count :])
    rates = _ball_rates(joints, angles, at.ball, first.ball, second.ball)
    for k in range(3):
        v[n_root + joints.first + k], a[n_root + joints.first + k] = rates[0][k], rates[1][k]
    if n_root:
        v[:6], a[:6] = _root_rates(at, first, second)
    return posture.T, v.T, a.T


def _slow(chart: Chart, rough: Array, rate: float, settings: LowPass) -> tuple[Smooth, Smooth, Smooth]:
    """Return low-passed postures ``rough`` (nq, T) in the coordinates of ``chart``, and their two first derivatives."""
    even, span = _continued_at_the_ends(chart.smooth(rough).stacked(), rate, settings)
    filtered = chart.split(low_pass(even.T, rate, settings).T)
    even = Smooth(filtered.place, continued(filtered.root), continued(filtered.ball), filtered.angle).stacked()
    del filtered  # what is derived needs the memory
    first, second = _derivatives(np.arange(even.shape[1]) / rate, even)
    return chart.split(even[:, span]), chart.split(first[:, span]), chart.split(second[:, span])


def _continued_at_the_ends(values: Array, rate: float, settings: LowPass) -> tuple[Array, slice]:
    """Return ``values`` (m, T) continued at both ends so that their second derivative is mirrored there, and where
    (T) they lie in it.

    Before the first sample x(-t) = x(t) - 2 v t, behind the last one alike; v, the slope at the end, is that of the
    cubic through one period of the cut-off, in which the low-pass leaves little more.
    """
    period = settings.shortest(rate)
    count = min(_PERIODS * period, values.shape[1] - 1)
    before, behind = (_beyond(side, period, count) for side in (values, values[:, ::-1]))
    return np.hstack([before[:, ::-1], values, behind]), slice(count, count + values.shape[1])


def _beyond(values: Array, period: int, count: int) -> Array:
    """Return ``count`` samples (m, count) that come before ``values`` (m, T), the nearest first."""
    slope = np.polynomial.polynomial.polyfit(np.arange(min(period, values.shape[1])), values[:, :period].T, 3)[1]
    return values[:, 1 : count + 1] - 2 * slope[:, None] * np.arange(1, count + 1)


def _derivatives(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the first and second derivatives (m, T) of the quintic spline through ``values`` (m, T), ends free."""
    free = np.zeros(len(values))
    ends = [(3, free), (4, free)]
    spline = make_interp_spline(time, values.T, k=_DEGREE, bc_type=(ends, ends))
    return spline(time, nu=1).T, spline(time, nu=2).T


def _check(time: Array, q: Array, settings: LowPass) -> None:
    """Refuse what cannot be smoothed."""
    bad = np.isnan(q).any(axis=1)
    if bad.any():
        raise TrialRefused(
            f"Frame {int(bad.argmax())} has no posture (NaN); smooth only frames that the inverse kinematics gave."
        )
    if len(time) < 2:
        return
    steps = np.diff(time)
    if np.median(steps) > LONGEST_STEP:
        return
    if np.ptp(steps) > 0.01 * steps.mean():
        frame = int(np.abs(steps - np.median(steps)).argmax())
        raise TrialRefused(
            f"The frames are not evenly spaced: {steps[frame]:g} s after frame {frame}, {np.median(steps):g} s usually."
        )
    need = max(settings.shortest(rate_of(time)), _DEGREE + 1)
    if len(time) < need:
        raise TrialRefused(
            f"{len(time)} frames at {rate_of(time):g} Hz are too few for velocities behind a low-pass at "
            f"{settings.cutoff:g} Hz: at least {need} are needed. Record longer, or use one frame as a static pose."
        )


def _root_rates(at: Smooth, first: Smooth, second: Smooth) -> tuple[Array, Array]:
    """Return v and a (6, T) of the root: linear, angular, in its own frame."""
    turn, back = quaternion_matrix(at.root.T), quaternion_conjugate(at.root.T)
    half = quaternion_product(back, first.root.T)
    omega = 2 * half[:, :3]
    alpha = 2 * quaternion_product(back, second.root.T)[:, :3] - 4 * half[:, 3:] * half[:, :3]
    linear = np.einsum("tji,jt->ti", turn, first.place)
    acceleration = np.einsum("tji,jt->ti", turn, second.place) - cross(omega, linear)
    return np.concatenate([linear, omega], axis=1).T, np.concatenate([acceleration, alpha], axis=1).T


def _ball_rates(joints: Balls, angles: Array, at: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Return the rates and accelerations (3, G, T) of the ball joints' angles from their quaternions (4, G, T) and the
    derivatives.

    In the frame after the first angle, with b the second one (all times the sign): w1 = t1' + sin(b) t3', w2 = t2', w3
    = cos(b) t3'.
    """
    sign = joints.sign
    at, first, second = (np.moveaxis(one, 0, -1) for one in (at, first, second))
    back = quaternion_conjugate(at)
    half, change = (np.moveaxis(quaternion_product(one, back), -1, 0) for one in (first, second))
    omega = 2 * half[:3]
    alpha = 2 * change[:3] - 4 * half[3] * half[:3]
    sine, cosine = np.sin(sign * angles[1]), np.cos(sign * angles[1])
    cosine = np.where(np.abs(cosine) < LEAST_COSINE, np.copysign(LEAST_COSINE, cosine), cosine)
    w, dw = _before_first(sign * angles[0], omega), _before_first(sign * angles[0], alpha)
    rate3 = w[2] / cosine
    rate1 = w[0] - sine * rate3
    dw = dw - rate1 * np.stack([np.zeros_like(rate1), -w[2], w[1]])
    second3 = (dw[2] + sine * w[1] * rate3) / cosine
    second1 = dw[0] - cosine * w[1] * rate3 - sine * second3
    return sign * np.stack([rate1, w[1], rate3]), sign * np.stack([second1, dw[1], second3])


def _before_first(angle: Array, vector: Array) -> Array:
    """Return vectors (3, G, T) written in the frame that is turned about the first axis by ``angle`` (G, T) rad."""
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.stack([vector[0], cosine * vector[1] + sine * vector[2], cosine * vector[2] - sine * vector[1]])

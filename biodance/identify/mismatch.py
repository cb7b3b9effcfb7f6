"""What disturbs a session beyond the noise: twins of the subject, plates within their tolerances, and unknown remainders; how large by
evidence.

The errors of K twins and K plates are projected on the regressor as scores W' S^-1 e; their mean outer products are covariances of
b = W' S^-1 y. The model is  b ~ N(H phi, noise H + kinematics² M_kinematics + M_plates),  and the two sizes are those under which the
session's own b is most probable given the table (evidence). What is left for the parameters is H (...)^-1 H in place of H.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.identify.information import Information
from biodance.identify.noise import Noise, blocks
from biodance.identify.statistics import Fit
from biodance.identify.twins import Twins, disturbance, draw_twins, jacobian, skew, wrench_change
from biodance.motion.kinematics import poses, segment_motion
from biodance.motion.regressor import regressor_of
from biodance.records import Array, Motion, Sip

TWINS = 128
"""Number of twins and of plates: a variance from so many is known within an eighth."""
CHUNK = 32
"""Twins carried at a time: constant memory."""
SHORTEST = 8
"""Frames: shorter runs have no accelerations worth the name."""
FULL_SCALE = np.array([1.0, 1.0, 4.0, 0.5, 0.4, 0.2])
"""Ratio of the channels' ranges in a force plate: cross-talk is stated as a share of them."""
PLATE = {"gain": 0.004, "cross-talk": 0.001, "turn": 0.004, "place": 0.002, "delay": 0.002}
"""Tolerances of an installed plate: relative, share of full scale, rad, m, s."""
OFFSET = np.array([0.5, 0.5, 1.0, 0.3, 0.3, 0.2])
"""N, N·m: what is left after zeroing."""
KINEMATICS = (1.0, 1.4, 2.0, 2.8)
NOISE = (1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0, 15.0, 22.0)
"""Sizes among which the evidence chooses: of the twins' errors (never smaller than the markers say), and variance factor of the noise."""


@dataclass(frozen=True, eq=False)
class Mismatch:
    """``kinematics``, ``plates`` (p, K): scores W' S^-1 e of the errors e of K twins and K plates over all trials."""

    kinematics: Array
    plates: Array


@dataclass(frozen=True)
class Sizes:
    """How large the disturbances are: ``kinematics`` (1 = as drawn, marker residuals matched), ``noise`` variance factor (1 = as
    learned).
    """

    kinematics: float
    noise: float


@dataclass(frozen=True, eq=False)
class Plates:
    """What K plates do to a wrench about their middle: ``mixing`` (K, 6, 6), ``offset`` (K, 6) N, N·m, ``delay`` (K,) s."""

    mixing: Array
    offset: Array
    delay: Array


def draw_plates(count: int, rng: np.random.Generator) -> Plates:
    """Draw ``count`` plates within their tolerances."""
    mixing = PLATE["cross-talk"] * rng.normal(size=(count, 6, 6)) * FULL_SCALE[:, None] / FULL_SCALE
    mixing[:, range(6), range(6)] = PLATE["gain"] * rng.normal(size=(count, 6))
    turn, shift = skew(PLATE["turn"] * rng.normal(size=(count, 3))), skew(PLATE["place"] * rng.normal(size=(count, 3)))
    mixing[:, :3, :3] += turn
    mixing[:, 3:, 3:] += turn
    mixing[:, 3:, :3] += shift
    return Plates(mixing, OFFSET * rng.normal(size=(count, 6)), PLATE["delay"] * rng.normal(size=count))


def mismatch(body: Body, fits: tuple[Fit, ...], noise: Noise, *, seed: int = 0) -> Mismatch:
    """Return the scores of twins and plates over all trials, the twins scaled so that their marker residuals are as large as the
    observed.
    """
    rng = np.random.default_rng(seed)
    twins, plates = draw_twins(body, TWINS, rng), draw_plates(TWINS, rng)
    found = np.zeros((2, 10 * len(body.segments), TWINS))
    predicted, observed = 0.0, 0.0
    for fit in fits:
        for pick in blocks(fit.use, fit.motion.rate, noise):
            if pick.size < SHORTEST:
                continue
            motion = Motion(fit.motion.time[pick], fit.motion.q[pick], fit.motion.v[pick], fit.motion.a[pick])
            W = regressor_of(segment_motion(body, motion))
            white = noise.at(fit.motion.rate).whiten(W).reshape(-1, W.shape[2])
            change, residual = _twin_errors(body, motion, twins)
            for index, error in enumerate((change, _plate_errors(W @ body.sip.phi, motion.rate, noise, plates))):
                found[index] += white.T @ noise.at(fit.motion.rate).whiten(error).reshape(-1, TWINS)
            if fit.motion.residual.shape[1] and np.isfinite(fit.motion.residual[pick]).any():
                predicted += residual * pick.size
                observed += float(np.nanmean(fit.motion.residual[pick] ** 2)) * pick.size
    scale = np.sqrt(observed / predicted) if predicted > 0 and observed > 0 else 1.0
    return Mismatch(scale * found[0], found[1])


def _twin_errors(body: Body, motion: Motion, twins: Twins) -> tuple[Array, float]:
    """Return the wrench errors (T, 6, K) about the lab origin, and the mean square distance of the markers that is left, m²."""
    pose = poses(body, motion.q)
    everything, segment = list(range(len(body.segments))), list(body.markers.segment)
    J, _ = jacobian(body, pose, segment, pose.points(segment, body.markers.position))
    place, turn = jacobian(body, pose, everything, pose.points(everything, body.sip.com))
    weighted = np.swapaxes(np.repeat(body.markers.weight, 3)[:, None] * J, 1, 2)
    normal = weighted @ J
    ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / body.nv * np.eye(body.nv)
    gain = -np.linalg.solve(normal + ridge, weighted)
    errors, left = [], 0.0
    for start in range(0, TWINS, CHUNK):
        few = Twins(*(x[..., start : start + CHUNK] for x in (twins.slide, twins.flesh, twins.centre, twins.tilt)))
        wrong = disturbance(body, motion, pose, few)
        moved = wrong.markers.reshape(motion.time.size, 3 * len(segment), -1)
        tangent = gain @ moved
        left += 3 * float(np.mean((moved + J @ tangent) ** 2)) * CHUNK / TWINS
        shape = wrong.places.shape
        errors.append(
            wrench_change(body, motion, wrong.places + (place @ tangent).reshape(shape), wrong.turns + (turn @ tangent).reshape(shape))
        )
    return np.concatenate(errors, axis=2), left


def _plate_errors(wrench: Array, rate: float, noise: Noise, plates: Plates) -> Array:
    """Return the errors (T, 6, K) about the lab origin of plates that measure ``wrench`` (T, 6)."""
    near = wrench @ noise.shift.T
    late = np.gradient(near, 1.0 / rate, axis=0)[..., None] * plates.delay
    return np.asarray(np.linalg.inv(noise.shift) @ (np.tensordot(near, plates.mixing, axes=(1, 2)).swapaxes(1, 2) + plates.offset.T - late))


def covariance(H: Array, found: Mismatch, sizes: Sizes) -> Array:
    """Return the covariance (p, p) of b = W' S^-1 y at given parameters."""
    M, P = (x @ x.T / x.shape[1] for x in (found.kinematics, found.plates))
    return np.asarray(sizes.noise * H + sizes.kinematics**2 * M + P)


def evident_sizes(data: Information, found: Mismatch, prior: Sip) -> Sizes:
    """Return the sizes of the disturbances under which the session's data are most probable, given the table."""
    H = data.triangle.T @ data.triangle
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    value, vector = np.linalg.eigh(H / np.outer(scale, scale))
    keep = value > 1e-9 * value.max()
    basis = (vector[:, keep] / np.sqrt(value[keep])).T / scale
    e = basis @ (data.triangle.T @ (data.target - data.triangle @ prior.phi))
    spread = basis @ H @ prior.covariance @ H @ basis.T
    parts = [basis @ covariance(H, found, Sizes(k, 0.0)) @ basis.T for k in KINEMATICS]
    best, chosen = -np.inf, Sizes(1.0, 1.0)
    for part, kinematics in zip(parts, KINEMATICS, strict=True):
        value, vector = np.linalg.eigh(spread + part)
        turned = (vector.T @ e) ** 2
        for noise in NOISE:
            likely = -0.5 * float(np.sum(np.log(value + noise) + turned / (value + noise)))
            if likely > best:
                best, chosen = likely, Sizes(kinematics, noise)
    return chosen


def temper(data: Information, found: Mismatch, sizes: Sizes) -> Information:
    """Return the information that is left for the parameters: H C^+ H, with C the covariance of b at given parameters."""
    R = data.triangle
    H = R.T @ R
    C = covariance(H, found, sizes)
    scale = np.sqrt(np.maximum(np.diag(C), 1e-300))
    value, vector = np.linalg.eigh(C / np.outer(scale, scale))
    keep = value > 1e-13 * value.max()
    half = (vector[:, keep] / np.sqrt(value[keep])).T / scale
    rows = np.linalg.qr(np.column_stack([half @ H, half @ (R.T @ data.target)]), mode="r")
    triangle = np.zeros_like(data.R)
    triangle[: len(rows)] = rows
    triangle[-1, -1] = np.hypot(triangle[-1, -1], data.R[-1, -1])
    return Information(triangle, data.frames)


def evidence_of_scale(data: Information, prior: Sip, scales: Array) -> Array:
    """Return the log evidence (n,) of whitened ``data`` when the prior's standard deviations are multiplied by each of ``scales`` (n,).

    The rule that chooses the prior's weight is maximum a posteriori: scale 1. This curve shows whether the data agree.
    """
    A = data.triangle @ prior.covariance @ data.triangle.T
    value, vector = np.linalg.eigh(0.5 * (A + A.T))
    turned = (vector.T @ (data.target - data.triangle @ prior.phi)) ** 2
    spread = 1.0 + np.outer(np.asarray(scales) ** 2, np.maximum(value, 0.0))
    return np.asarray(-0.5 * (np.log(spread) + turned / spread).sum(axis=1))

"""What disturbs a session beyond the noise: kinematics that are wrong coherently, plates within their tolerances; how large by evidence.

The errors of independent sources, each of one standard deviation, enter the equations b = W' S^-1 y as scores W' S^-1 e; with the scores as
columns of F the covariance is F F', exact over all sources (`kinematic_scores`). The model is
b ~ N(H phi, noise H + kinematics² F_kinematics F_kinematics' + F_plates F_plates'),  and the two sizes are those under which the session's
own b is most probable given the table (evidence), never smaller than drawn. What is left for the parameters is H (...)^-1 H in place of H.
"""

from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.identify.information import Information
from biodance.identify.kinematic_scores import KinematicScores, kinematic_scores
from biodance.identify.noise import Noise, blocks
from biodance.identify.statistics import Fit
from biodance.identify.twins import SLIDE, disturbance, draw_twins, joint_error, neighbours
from biodance.motion.kinematics import poses, segment_motion
from biodance.motion.marker_jacobian import chains, jacobian, skew
from biodance.motion.regressor import regressor_of
from biodance.records import Array, Motion, Sip

TWINS, EVERY = 32, 8
"""Twins and frames (one of so many) from which the size of the marker residuals is predicted."""
SHORTEST = 8
"""Frames: shorter runs have no accelerations worth the name."""
FULL_SCALE = np.array([1.0, 1.0, 4.0, 0.5, 0.4, 0.2])
"""Ratio of the channels' ranges in a force plate: cross-talk is stated as a share of them."""
PLATE = {"gain": 0.004, "cross-talk": 0.001, "turn": 0.004, "place": 0.002, "delay": 0.002}
"""Tolerances of an installed plate: relative, share of full scale, rad, m, s."""
OFFSET = np.array([0.5, 0.5, 1.0, 0.3, 0.3, 0.2])
"""N, N·m: what is left after zeroing."""
KINEMATICS = (1.0, 1.4, 2.0, 2.8)
NOISE = (1.7, 2.2, 3.0, 4.5, 7.0, 10.0, 15.0, 22.0)
"""Sizes among which the evidence chooses: of the kinematic errors (never smaller than drawn), and variance factor of the noise (never below
1.7: the parameters absorb part of what is noise)."""


@dataclass(frozen=True, eq=False)
class Mismatch:
    """``kinematics`` (p, n), ``plates`` (p, m): scores W' S^-1 e over all trials of n and m independent sources of errors e, each of one
    standard deviation.
    """

    kinematics: Array
    plates: Array


@dataclass(frozen=True)
class Sizes:
    """How large the disturbances are: ``kinematics`` (1 = as drawn), ``noise`` variance factor (1 = as learned)."""

    kinematics: float
    noise: float


@dataclass(frozen=True, eq=False)
class Plates:
    """What m plates do to a wrench about their middle: ``mixing`` (m, 6, 6), ``offset`` (m, 6) N, N·m, ``delay`` (m,) s."""

    mixing: Array
    offset: Array
    delay: Array


def plate_sources() -> Plates:
    """Return plates with one fault of one standard deviation each: 36 gains and cross-talks, 3 turns, 3 shifts, 6 offsets, a delay."""
    share = PLATE["cross-talk"] * FULL_SCALE[:, None] / FULL_SCALE
    np.fill_diagonal(share, PLATE["gain"])
    mixing, offset, delay = np.zeros((49, 6, 6)), np.zeros((49, 6)), np.zeros(49)
    rows, columns = np.divmod(np.arange(36), 6)
    mixing[np.arange(36), rows, columns] = share.ravel()
    turn, shift = skew(PLATE["turn"] * np.eye(3)), skew(PLATE["place"] * np.eye(3))
    mixing[36:39, :3, :3] = mixing[36:39, 3:, 3:] = turn
    mixing[39:42, 3:, :3] = shift
    offset[42:48] = np.diag(OFFSET)
    delay[48] = PLATE["delay"]
    return Plates(mixing, offset, delay)


def mismatch(body: Body, fits: tuple[Fit, ...], noise: Noise) -> Mismatch:
    """Return the scores of kinematics and plates over all trials.

    Skin and flesh slide as much as `twins` says, or more where the markers' residuals are larger than that predicts.
    """
    size = 10 * len(body.segments)
    sources, plates = plate_sources(), np.zeros((size, 49))
    scores: KinematicScores | None = None
    predicted, observed = 0.0, 0.0
    for fit in fits:
        white = noise.at(fit.motion.rate)
        for pick in blocks(fit.use, fit.motion.rate, noise):
            if pick.size < SHORTEST:
                continue
            motion = Motion(fit.motion.time[pick], fit.motion.q[pick], fit.motion.v[pick], fit.motion.a[pick])
            W = regressor_of(segment_motion(body, motion), gravity=body.gravity)
            weight = white.weighted(W)
            found = kinematic_scores(body, motion, weight)
            scores = found if scores is None else scores + found
            wrong = _plate_errors(W @ body.sip.phi, motion.rate, noise, sources)
            plates += np.tensordot(weight, wrong, axes=((0, 1), (0, 1)))
            if fit.motion.residual.shape[1] and np.isfinite(fit.motion.residual[pick]).any():
                predicted += _marker_squares(body, motion) * pick.size
                observed += float(np.nanmean(fit.motion.residual[pick] ** 2)) * pick.size
    if scores is None:
        return nothing(body)
    return Mismatch(_of_one_sd(body, scores, np.sqrt(max(1.0, observed / predicted)) if predicted > 0 else 1.0), plates)


def nothing(body: Body) -> Mismatch:
    """Return the scores of no frames."""
    size, joints = 10 * len(body.segments), len(body.joints)
    sources = 3 * joints * (len(body.markers.names) + len(body.segments) + 2)
    return Mismatch(np.zeros((size, sources)), np.zeros((size, 49)))


def _of_one_sd(body: Body, scores: KinematicScores, slack: float) -> Array:
    """Return the scores (p, n) of every source times its standard deviation; ``slack`` multiplies those of skin and flesh."""
    beside = neighbours(body)
    centre, tilt = np.zeros(len(body.joints)), np.zeros((len(body.joints), 3, 3))
    for chain in chains(body):
        joint = body.joints[chain[0]]
        error = joint_error(body, chain)
        centre[chain[0]] = error.centre
        if len(chain) == 1:
            tilt[chain[0]] = error.axis * (np.eye(3) - np.outer(joint.axis, joint.axis))
    parts = [
        slack * SLIDE * beside[:, list(body.markers.segment), None, None] * scores.slide,
        slack * SLIDE * beside[:, :, None, None] * scores.flesh,
        centre[:, None, None] * scores.centre,
        tilt @ scores.tilt,
    ]
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts]).T


def _marker_squares(body: Body, motion: Motion) -> float:
    """Return the mean square distance (m²) that twins leave between markers and model."""
    few = Motion(motion.time[::EVERY], motion.q[::EVERY], motion.v[::EVERY], motion.a[::EVERY])
    pose, segment = poses(body, few.q), list(body.markers.segment)
    J, _ = jacobian(body, pose, segment, pose.points(segment, body.markers.position))
    wrong = disturbance(body, few, pose, draw_twins(body, TWINS, np.random.default_rng(0)))
    moved = wrong.markers.reshape(few.time.size, 3 * len(segment), -1)
    weighted = np.swapaxes(np.repeat(body.markers.weight, 3)[:, None] * J, 1, 2)
    normal = weighted @ J
    ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / body.nv * np.eye(body.nv)
    return 3 * float(np.mean((moved - J @ np.linalg.solve(normal + ridge, weighted @ moved)) ** 2))


def _plate_errors(wrench: Array, rate: float, noise: Noise, plates: Plates) -> Array:
    """Return the errors (T, 6, m) about the lab origin of plates that measure ``wrench`` (T, 6)."""
    near = wrench @ noise.shift.T
    late = np.gradient(near, 1.0 / rate, axis=0)[..., None] * plates.delay
    return np.asarray(np.linalg.inv(noise.shift) @ (np.tensordot(near, plates.mixing, axes=(1, 2)).swapaxes(1, 2) + plates.offset.T - late))


def covariance(H: Array, found: Mismatch, sizes: Sizes) -> Array:
    """Return the covariance (p, p) of b = W' S^-1 y at given parameters."""
    M, P = (x @ x.T for x in (found.kinematics, found.plates))
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

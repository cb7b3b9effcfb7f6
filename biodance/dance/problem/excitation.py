"""What a movement is worth: the paper's criterion on segments (eq. 12) and the effort of the performer, with slopes by
the motion; and what standing in a posture and going there tells of the body: rows of the regressor, per standard
deviation of the error and of the table.

First moments count at rest, inertias in motion. Effort is how hard a posture is to take and to remember; three terms
over the joints, angles in units of half the joint's range:
- few joints at once: mean of sqrt(r² + e²) - e, r the angle from standing (a smooth absolute value: what need not move
  stays);
- symmetric pairs: mean of (right - left)² over the pairs of joints, the same movement on both sides being one thing to
  do;
- no discomfort: mean of c⁸, c the angle from standing over the way to the stop on that side.

With ``centres`` postures also tell of the centres of the ball joints, which identification finds from the movement. A
centre lies at c in the frame of the one segment and at d in that of the other: c = R d + their distance, with R the
rotation between them. Every posture is one such equation, and only postures that differ tell both apart.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from biodance.body.body import Body
from biodance.body.parts import TENSOR
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import rest_to_rest
from biodance.dance.problem.state import State
from biodance.identification.base_parameters import structural_base
from biodance.identification.posterior import prior_factor
from biodance.motion.dynamics import regressor
from biodance.motion.kinematics import poses
from biodance.records import Array, grouped
from biodance.spatial import cross, skew


def condition(gram: Array) -> tuple[Array, Array]:
    """Return cond = sqrt(largest / smallest eigenvalue) of Gram matrices (..., k, k), (...), and its gradient (..., k,
    k).
    """
    value, vector = _spectrum(gram)
    # d(lambda) = v' dG v, so the gradient is V diag(d cond / d lambda) V'.
    cond = np.sqrt(value[..., -1] / value[..., 0])
    by = np.zeros_like(value)
    by[..., -1] += 1 / value[..., -1]
    by[..., 0] -= 1 / value[..., 0]
    return cond, (vector * (0.5 * cond[..., None] * by)[..., None, :]) @ np.swapaxes(vector, -1, -2)


def smooth_condition(gram: Array, *, sharpness: int) -> tuple[Array, Array]:
    """Return a condition number without kinks and its gradient: power means of the eigenvalues instead of largest and
    smallest.

    sqrt(mean(value^p)^(1/p) * mean(value^-p)^(1/p)), p = ``sharpness``: at most cond, 1 exactly where cond is, cond for
    p -> infinity.
    """
    value, vector = _spectrum(gram)
    # Divided by the largest and the smallest, so that no power overflows.
    high, low = (value / value[..., -1:]) ** sharpness, (value[..., :1] / value) ** sharpness
    cond = np.sqrt(value[..., -1] / value[..., 0] * (high.mean(axis=-1) * low.mean(axis=-1)) ** (1 / sharpness))
    # cond / (2 lambda_i) (lambda_i^p / sum lambda^p - lambda_i^-p / sum lambda^-p).
    by = (
        0.5
        * cond[..., None]
        * (high / high.sum(axis=-1, keepdims=True) - low / low.sum(axis=-1, keepdims=True))
        / value
    )
    return cond, (vector * by[..., None, :]) @ np.swapaxes(vector, -1, -2)


def _spectrum(gram: Array) -> tuple[Array, Array]:
    value, vector = np.linalg.eigh(gram)
    # A singular matrix is bad, not infinitely bad.
    return np.maximum(value, 1e-12 * np.maximum(value[..., -1:], 1e-12)), vector


@dataclass(frozen=True, eq=False)
class Blocks:
    """What counts of each segment: ``first`` (of MX, MY, MZ) and ``second`` (of the six inertias) base columns,
    ``weight`` (N,) kg; and of the performer: ``simplicity``, what a hardness of 1 (`effort`) is worth
    in mean condition numbers.
    """

    first: tuple[list[int], ...]
    second: tuple[list[int], ...]
    weight: Array
    simplicity: float = 0.0


def excitation_blocks(body: Body) -> Blocks:
    """Return the base columns of every segment, weighted by its mass in the table (docs/derivations.md)."""
    columns = structural_base(body).columns
    first, second = (
        tuple(
            [c % 10 - low for c in columns if c // 10 == i and low <= c % 10 < high] for i in range(len(body.segments))
        )
        for low, high in ((1, 4), (4, 10))
    )
    return Blocks(first, second, np.array(body.sip.mass))


Measure = Callable[[Array], tuple[Array, Array]]
"""Says of Gram matrices (..., k, k) how badly conditioned they are (...), and the gradient (..., k, k)."""


def total(
    weight: Array, grams: Array, pick: tuple[list[int], ...], *, measure: Measure = condition
) -> tuple[float, Array]:
    """Return sum_i M_i cond(W_bi) over segments with weight and columns, and its gradient by grams (N, k, k)."""
    value, slope = 0.0, np.zeros_like(grams)
    alike = grouped((tuple(columns), i) for i, columns in enumerate(pick) if columns and weight[i] > 0)
    for picked, segments in alike.items():
        block = np.ix_(segments, picked, picked)
        # Several segments with the same columns as one batch (S, k, k).
        cond, part = measure(grams[block])
        value += float(weight[segments] @ cond)
        slope[block] = weight[segments][:, None, None] * part
    return value, slope


def criteria(blocks: Blocks, grams: Array) -> Array:
    """Return the criterion (K,) kg of K sets of Gram matrices (K, N, 3, 3)."""
    out = np.zeros(len(grams))
    whole = [i for i, pick in enumerate(blocks.first) if len(pick) == 3 and blocks.weight[i] > 0]
    if whole:
        least, most = extremes(grams[:, whole])
        # cond(W) is the root of that of W'W.
        out += np.sqrt(most / np.maximum(least, 1e-12)) @ blocks.weight[whole]
    for i, pick in enumerate(blocks.first):
        if 0 < len(pick) < 3 and blocks.weight[i] > 0:
            value = np.linalg.eigvalsh(grams[:, i][np.ix_(range(len(grams)), pick, pick)])
            out += blocks.weight[i] * np.sqrt(value[:, -1] / np.maximum(value[:, 0], 1e-12))
    return out


def extremes(A: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest eigenvalue of symmetric matrices (..., 3, 3) in closed form
    (doi:10.1145/355578.366316): an exchange asks for a million of them.
    """
    mean = (A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2]) / 3
    # B = A - mean 1 has the trace zero.
    a, b, c = (A[..., i, i] - mean for i in range(3))
    d, e, f = A[..., 0, 1], A[..., 1, 2], A[..., 0, 2]
    # p² = tr(B²) / 6 and det(B) / 2: the cubic equation is solved by the cosine of a triple angle.
    radius = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / 2
    angle = np.arccos(np.clip(half / np.maximum(radius**3, 1e-300), -1.0, 1.0)) / 3
    # mean + 2 p cos(angle + 2 pi k / 3): k = 0 is the largest, k = 1 the smallest.
    return mean + 2 * radius * np.cos(angle + 2 * np.pi / 3), mean + 2 * radius * np.cos(angle)


def uprights(state: State) -> Array:
    """Return (T, N, 3) the vertical in each segment's frame."""
    # Row z of lab_R_segment is R'e_z.
    return state.rotation[:, :, 2, :]


def static_grams(up: Array) -> Array:
    """Return (N, 3, 3) sum over postures of 1 - u u', the Gram matrices of the first moments over g²."""
    # [u]x'[u]x = 1 - u u'; a little of the identity keeps the smallest eigenvalue above zero.
    return len(up) * np.eye(3) - np.einsum("tni,tnj->nij", up, up) + 1e-6 * np.eye(3)


def upright_slopes(state: State, slope: Array) -> Array:
    """Return (T, n) derivative by x of sum <slope (T, N, 3), u>."""
    # du = -R'(w x e_z), so <s, du> = w (R s x e_z).
    lab = np.einsum("tnij,tnj->tni", state.rotation, slope)
    lever = np.stack([lab[..., 1], -lab[..., 0], 0 * lab[..., 0]], axis=-1)  # lab x z
    moved = state.chain.ancestors[list(state.chain.carriers)]
    # Sum over the segments that coordinate k moves.
    return np.einsum("tnc,tkc,nk->tk", lever, state.twists[:, :, 3:], moved)


_LINEAR = np.zeros((3, 3, 6))
"""[c]: the moment K (3, 6) by the six inertias of one segment of unit angular acceleration along c."""
for _k, (_i, _j) in enumerate(TENSOR):
    # Both off-diagonal elements of a symmetric tensor.
    _LINEAR[_j, _i, _k] = _LINEAR[_i, _j, _k] = 1.0
_SQUARE = np.einsum("bij,cjk->bcik", skew(np.eye(3)), _LINEAR)
"""(3, 3, 3, 6): sum_bc w_b w_c _SQUARE[b, c] = w x (I w)."""


def moments(w: Array, dw: Array) -> Array:
    """Return K (..., 3, 6) of angular velocity and acceleration (..., 3) in the segment's frame."""
    # K phi = I dw + w x (I w).
    return np.einsum("...c,cik->...ik", dw, _LINEAR) + np.einsum("...b,...c,bcik->...ik", w, w, _SQUARE)


def turning(state: State, segments: list[int]) -> tuple[Array, Array]:
    """Return angular velocity and acceleration (T, S, 3) of segments in their own frames."""
    links = [state.chain.carriers[i] for i in segments]
    turn = state.rotation[:, segments]
    # R's: into the segment's frame.
    w, dw = (np.einsum("tsij,tsi->tsj", turn, s[:, links, 3:]) for s in (state.velocity, state.acceleration))
    return w, dw


def dynamic_grams(state: State, segments: list[int]) -> Array:
    """Return (S, 6, 6) sum over samples of K'K."""
    K = moments(*turning(state, segments))
    return np.einsum("tsik,tsil->skl", K, K)


def dynamic_slopes(state: State, segments: list[int], slope: Array) -> Array:
    """Return (3, T, n) derivative by x, v, a of sum <slope (S, 6, 6), K'K>."""
    w, dw = turning(state, segments)
    # d<S, K'K> = <2 K S, dK>, S symmetric.
    Y = 2 * np.einsum("tsik,skl->tsil", moments(w, dw), slope)
    by_dw = np.einsum("tsik,cik->tsc", Y, _LINEAR)
    # Derivative of a quadratic form in w: both factors.
    by_w = np.einsum("tsik,tsb,bcik->tsc", Y, w, _SQUARE + np.swapaxes(_SQUARE, 0, 1))
    links = [state.chain.carriers[i] for i in segments]
    turn, moved = state.rotation[:, segments], state.chain.ancestors[links]
    # Back to the lab frame, where the axes are.
    by_dw, by_w = (np.einsum("tsij,tsj->tsi", turn, s) for s in (by_dw, by_w))
    axis, V, A = state.twists[..., 3:], state.velocity[..., 3:], state.acceleration[..., 3:]
    # Section 12 of the derivations, angular parts, in the segment's frame: J_i x (...) of that frame is taken off.
    swept = cross(V, axis)
    gap = V[:, links][:, :, None] - V[:, None]
    back = cross(swept[:, None], gap) - cross(axis, A)[:, None]
    ahead = swept[:, None] + cross(axis[:, None], gap)
    # in the segment's own frame: d(R'w) = R'(-w_i x w_i-link), d(R'dw) = R'(back)
    dx = np.einsum("tsc,tkc,sk->tk", by_w, swept, moved) + np.einsum("tsc,tskc,sk->tk", by_dw, back, moved)
    dv = np.einsum("tsc,tkc,sk->tk", by_w, axis, moved) + np.einsum("tsc,tskc,sk->tk", by_dw, ahead, moved)
    da = np.einsum("tsc,tkc,sk->tk", by_dw, axis, moved)
    return np.stack([dx, dv, da])


_SOFT = 0.05  # e: angles below a twentieth of half the range are not worth saving
SIDE, STOP = 0.25, 1.0
"""Worth of the second and the third term beside the first."""


def effort(state: State) -> tuple[float, Array]:
    """Return the mean over the samples, about 0 standing and 1 for a contortion, and its slopes (3, T, n) by x, v, a.

    Planted legs are not counted: they follow from the pelvis.
    """
    scale, slopes = _Scale.of(state.chain.body), np.zeros((3, *state.x.shape))
    planted = [c - ROOT for side in state.stance.planted for c in state.chain.leg_columns[side]]
    counts = np.ones(len(scale.half))
    counts[planted] = 0.0
    angle = state.x[:, ROOT:]
    away = (angle - scale.rest) / scale.half
    way = np.where(angle > scale.rest, scale.upward, scale.downward)
    near = (angle - scale.rest) / way
    # Smooth |away|.
    root = np.sqrt(away**2 + _SOFT**2)
    value = (root - _SOFT + STOP * near**8) @ counts
    # d root / d away = away / root.
    by = counts * (away / root / scale.half + 8 * STOP * near**7 / way)
    for right, left in scale.pairs:
        if counts[right] and counts[left]:
            gap = (angle[:, right] - angle[:, left]) / scale.half[right]
            # The mean is over joints: a pair counts for two.
            value = value + 2 * SIDE * gap**2
            by[:, right] += 4 * SIDE * gap / scale.half[right]
            by[:, left] -= 4 * SIDE * gap / scale.half[right]
    # Mean over the joints that count, and over the samples.
    share = 1.0 / (max(1.0, counts.sum()) * len(angle))
    slopes[0][:, ROOT:] = share * by
    return float(share * value.sum()), slopes


@dataclass(frozen=True, eq=False)
class _Scale:
    """Angles (n,) rad of every joint: ``rest`` standing, ``half`` of the range, ``upward``, ``downward`` from standing
    to the stops (at least 0.2); ``pairs`` of right and left joints.
    """

    rest: Array
    half: Array
    upward: Array
    downward: Array
    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, body: Body) -> "_Scale":
        low, high = body.limits.lower, body.limits.upper
        names, rest = [joint.name for joint in body.joints], np.clip(0.0, low, high)
        others = [name.replace("right_", "left_", 1) for name in names]
        pairs = [(j, names.index(other)) for j, other in enumerate(others) if other != names[j] and other in names]
        upward, downward = np.maximum(high - rest, 0.2), np.maximum(rest - low, 0.2)
        return cls(rest, np.maximum((high - low) / 2, 1e-3), upward, downward, tuple(pairs))


SAMPLE_ERROR = np.array([8.0, 8.0, 8.0, 4.0, 4.0, 4.0])
"""N, N·m: error of one independent sample of the wrench of a person (residual of the paper: 7.8 N, 4.3 N·m)."""
SAMPLE_RATE = 4.0
"""Hz: independent samples per second of moving."""
_BALLS = (
    *(("pelvis", "right_thigh"), ("pelvis", "left_thigh"), ("pelvis", "trunk_head")),
    *(("trunk_head", "right_upper_arm"), ("trunk_head", "left_upper_arm")),
)
_UNKNOWN, _SKIN = 0.015, 0.020
"""m: what is not known of a centre before the movement, and how far skin slides in one posture."""
CENTRES = 6 * len(_BALLS)
"""Unknown coordinates of all centres."""


class PostureInformation:
    """What postures of ``chain`` and moves of the plan's duration tell; ``factor`` (10 N, k): the table's covariance is
    ``factor factor'``; ``scale`` (10 N, k) the same per standard deviation of the table, weighted by the plan.

    Rows (m, k) are per standard deviation; a posterior (k, k) is the covariance of what they multiply, 1 beforehand.
    """

    def __init__(self, chain: Chain, plan: Plan, *, centres: bool = False) -> None:
        self.chain, self.centres, self.factor = chain, centres, prior_factor(chain.body.sip)
        before = np.sum(self.factor**2, axis=1)
        self.weight = np.repeat(plan.emphasis(chain.body.segments), 10) * (before > 0)
        # tr(scale C scale'): sum of the variances over those of the table, weighted.
        self.scale = self.factor * np.sqrt(self.weight / np.where(before > 0, before, 1.0))[:, None]
        if centres:
            self.factor = np.pad(self.factor, ((0, 0), (0, CENTRES)))
            self.scale = block_diag(self.scale, np.eye(CENTRES))
        way = rest_to_rest(plan.move, via=0, rate=SAMPLE_RATE)
        # Both ends are at rest: the postures, which count on their own.
        self._way = [part[1:-1] for part in (way.position, way.velocity, way.acceleration)]

    @property
    def beforehand(self) -> Array:
        """(k, k) the posterior before any posture."""
        return np.eye(self.factor.shape[1])

    def white(self, W: Array) -> Array:
        """Return regressors (G, 6 T, 10 N) per standard deviation of error and of the table, (G, 6 T, k)."""
        error = np.tile(SAMPLE_ERROR, W.shape[1] // 6)
        # F^-1 W S, with S the root of the table's covariance.
        flat = (W / error[:, None]).reshape(-1, W.shape[2]) @ self.factor  # one product: many small ones are slow
        return np.asarray(flat.reshape(*W.shape[:2], -1))

    def standing(self, x: Array) -> Array:
        """Return the regressor (S, 6, 10 N) of standing still in each posture (S, n)."""
        motion = self.chain.motion(np.arange(len(x), dtype=float), x, *np.zeros((2, *x.shape)))
        return np.asarray(regressor(self.chain.body, motion)).reshape(len(x), 6, -1)

    def of_ways(self, ends: Array) -> Array:
        """Return the rows (G, m, k) of going straight from one posture to another, ``ends`` (G, 2, n)."""
        # The splines are linear in the ends.
        x, v, a = ((part @ ends).reshape(-1, ends.shape[2]) for part in self._way)
        W = regressor(self.chain.body, self.chain.motion(np.arange(len(x)) / SAMPLE_RATE, x, v, a))
        return self.white(np.asarray(W).reshape(len(ends), -1, W.shape[-1]))

    def of_posture(self, x: Array, standing: Array) -> Array:
        """Return the rows (m, k) of a posture ``x`` (n,) whose regressor ``standing`` (6, 10 N) is known."""
        still = self.white(standing[None])[0]
        return np.concatenate([still, rows_of_centres(self.chain, x, still.shape[1])]) if self.centres else still

    def gains(self, posterior: Array, rows: Array) -> Array:
        """Return by how much each of ``rows`` (..., m, k) lowers the weighted variance that a posterior leaves."""
        # tr(scale Z'Z scale').
        return np.asarray(np.sum((learned(posterior, rows) @ self.scale.T) ** 2, axis=(-2, -1)))


def learned(posterior: Array, rows: Array) -> Array:
    """Return Z (..., m, k) with new covariance = ``posterior`` - Z'Z (k, k) after whitened ``rows`` (..., m, k)."""
    # Woodbury: P - P X'(1 + X P X')^-1 X P, with L L' = 1 + X P X' and Z = L^-1 X P.
    spread = rows @ posterior
    factor = np.linalg.cholesky(np.eye(rows.shape[-2]) + spread @ np.swapaxes(rows, -1, -2))
    return np.asarray(np.linalg.solve(factor, spread))


def update_posterior(posterior: Array, rows: Array) -> Array:
    """Return the posterior (k, k) after whitened ``rows`` (m, k)."""
    Z = learned(posterior, rows)
    return np.asarray(posterior - Z.T @ Z)


def rows_of_centres(chain: Chain, x: Array, columns: int) -> Array:
    """Return the whitened rows (3 J, columns) of a posture ``x`` (n,): per standard deviation of what slides and, in
    the last `CENTRES` columns, of what is not known of the J centres.
    """
    body, out = chain.body, np.zeros((3 * len(_BALLS), columns))
    turned = np.asarray(poses(body, chain.positions(x[None])).rotation)[0]
    for k, (near, far) in enumerate(_BALLS):
        first, second = (turned[body.segments.index(name)] for name in (near, far))
        here = columns - CENTRES + 6 * k
        # c - R d = what is to be known of the distance; R = R_near' R_far.
        out[3 * k : 3 * k + 3, here : here + 6] = np.hstack([np.eye(3), -first.T @ second])
    # Prior deviation over error.
    return out * _UNKNOWN / _SKIN

"""What a movement is worth: the paper's criterion on segments (eq. 12) and the effort of the performer, with slopes by
the motion.

First moments count at rest, inertias in motion. Effort is how hard a posture is to take and to remember; three terms
over the joints, angles in units of half the joint's range:
- few joints at once: mean of sqrt(r² + e²) - e, r the angle from standing (a smooth absolute value: what need not move
  stays);
- symmetric pairs: mean of (right - left)² over the pairs of joints, the same movement on both sides being one thing to
  do;
- no discomfort: mean of c⁸, c the angle from standing over the way to the stop on that side.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from biodance.body.body import Body
from biodance.body.parts import TENSOR
from biodance.dance.problem.chain import ROOT
from biodance.dance.problem.state import State
from biodance.identification.base_parameters import structural_base
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
    body, angle, slopes = state.chain.body, state.x[:, ROOT:], np.zeros((3, *state.x.shape))
    low, high, names = body.limits.lower, body.limits.upper, [joint.name for joint in body.joints]
    rest, half = np.clip(0.0, low, high), np.maximum((high - low) / 2, 1e-3)
    counts = np.ones(len(names))
    counts[[c - ROOT for side in state.stance.planted for c in state.chain.leg_columns[side]]] = 0.0
    away = (angle - rest) / half
    # The way to the stop on that side, at least 0.2 rad.
    way = np.where(angle > rest, np.maximum(high - rest, 0.2), np.maximum(rest - low, 0.2))
    near = (angle - rest) / way
    # Smooth |away|.
    root = np.sqrt(away**2 + _SOFT**2)
    value = (root - _SOFT + STOP * near**8) @ counts
    # d root / d away = away / root.
    by = counts * (away / root / half + 8 * STOP * near**7 / way)
    for right, name in enumerate(names):
        other = name.replace("right_", "left_", 1)
        left = names.index(other) if other in names else right
        if left != right and counts[right] and counts[left]:
            gap = (angle[:, right] - angle[:, left]) / half[right]
            # The mean is over joints: a pair counts for two.
            value = value + 2 * SIDE * gap**2
            by[:, right] += 4 * SIDE * gap / half[right]
            by[:, left] -= 4 * SIDE * gap / half[right]
    # Mean over the joints that count, and over the samples.
    share = 1.0 / (max(1.0, counts.sum()) * len(angle))
    slopes[0][:, ROOT:] = share * by
    return float(share * value.sum()), slopes

"""Limbs, trunk and pelvis do not touch each other (paper eq. 14, d > 0).

Capsule against capsule is the exact distance of two line segments; a capsule against a box is judged at points along its axis, and the
finished dance is checked exactly.
"""

import numpy as np

from biodance.dance.limits import Margins
from biodance.dance.shapes import box_pairs, capsule, capsule_pairs
from biodance.dance.state import State
from biodance.records import Array

NAME, UNIT, SCALE = "self_collision", "m", 0.05
ALONG = np.linspace(0.0, 1.0, 6)
"""Places on the axis of a capsule that are held against a box."""


def margins(state: State) -> Margins:
    """Return the distances (T, pairs) m between surfaces."""
    near, far = _capsules(state), _boxes(state)
    return Margins(np.concatenate([near.value, far.value], axis=1), np.concatenate([near.slopes, far.slopes], axis=2))


def _capsules(state: State) -> Margins:
    body = state.chain.body
    pairs = capsule_pairs(body)
    limbs = sorted({i for pair in pairs for i in pair})
    shape = [capsule(body, i) for i in limbs]
    place, slope = state.points([i for i in limbs for _ in range(2)], np.concatenate([ends for ends, _ in shape]))
    place, slope = (p.reshape(p.shape[0], len(limbs), 2, *p.shape[2:]) for p in (place, slope))
    first, second = ([limbs.index(pair[k]) for pair in pairs] for k in range(2))
    s, t = nearest(place[:, first], place[:, second])
    weight = np.stack([1 - s, s, t - 1, -t], axis=2)
    both = np.concatenate([place[:, first], place[:, second]], axis=2)
    apart = np.einsum("tpk,tpkc->tpc", weight, both)
    distance = np.maximum(np.linalg.norm(apart, axis=2), 1e-9)
    toward = (apart / distance[..., None])[:, :, None, :, None] * weight[..., None, None]
    moved = np.sum(toward[:, :, :2] * slope[:, first], axis=(2, 3)) + np.sum(toward[:, :, 2:] * slope[:, second], axis=(2, 3))
    radii = np.array([shape[i][1] + shape[j][1] for i, j in zip(first, second, strict=True)])
    return Margins(distance - radii, moved[None])


def nearest(a: Array, b: Array) -> tuple[Array, Array]:
    """Return where on two line segments (..., 2, 3) their nearest points lie, 0..1 from the first to the second end."""
    d1, d2, r = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :], a[..., 0, :] - b[..., 0, :]
    A, E, B = (np.sum(p * q, axis=-1) for p, q in ((d1, d1), (d2, d2), (d1, d2)))
    C, F = np.sum(d1 * r, axis=-1), np.sum(d2 * r, axis=-1)
    s = np.clip((B * F - C * E) / np.maximum(A * E - B * B, 1e-12), 0.0, 1.0)
    t = np.clip((B * s + F) / E, 0.0, 1.0)
    s = np.clip((B * t - C) / A, 0.0, 1.0)
    return s, np.clip((B * s + F) / E, 0.0, 1.0)


def _boxes(state: State) -> Margins:
    body, values, slopes = state.chain.body, [], []
    for limb, box in box_pairs(body):
        ends, radius = capsule(body, limb)
        points = ends[0] + ALONG[:, None] * (ends[1] - ends[0])
        place, slope = state.points([limb] * len(points), points)
        low, high = body.boxes[box]
        turn, origin = state.rotation[:, box], state.position[:, box]
        local = np.einsum("tji,tkj->tki", turn, place - origin[:, None]) - (low + high) / 2
        over = np.abs(local) - (high - low) / 2
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=2)
        deepest = np.eye(3)[np.argmax(over, axis=2)]
        away = np.where(outside[..., None] > 0, np.maximum(over, 0.0) / np.maximum(outside, 1e-12)[..., None], deepest) * np.sign(local)
        normal = np.einsum("tij,tkj->tki", turn, away)
        still, carried = state.points([box], np.zeros((1, 3)))
        moved = state.chain.ancestors[state.chain.carriers[box]]
        lever = np.cross(place - still, normal)
        turning = np.einsum("tnc,tkc->tkn", state.twists[:, :, 3:], lever) * moved
        values.append(np.where(outside > 0, outside, over.max(axis=2)) - radius)
        slopes.append(np.einsum("tkc,tkcn->tkn", normal, slope - carried) - turning)
    return Margins(np.concatenate(values, axis=1), np.concatenate(slopes, axis=1)[None])

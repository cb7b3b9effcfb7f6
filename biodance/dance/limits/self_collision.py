"""Limbs, trunk and pelvis do not touch each other (paper eq. 14, d > 0).

Capsule against capsule is the exact distance of two line segments; a capsule against a box is judged at points along its axis, and the
finished dance is checked exactly.
"""

import numpy as np

from biodance.dance.limits import FAR, Margins
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
    first, second = (np.array([pair[k] for pair in pairs]) for k in range(2))
    shape = {i: capsule(body, i) for i in {*first, *second}}
    a, b = (state.placed(np.repeat(side, 2), np.concatenate([shape[i][0] for i in side])) for side in (first, second))
    a, b = (place.reshape(len(place), -1, 2, 3) for place in (a, b))
    s, t = nearest(a, b)
    here, there = ((1 - u)[..., None] * c[:, :, 0] + u[..., None] * c[:, :, 1] for u, c in ((s, a), (t, b)))
    apart = here - there
    distance = np.maximum(np.linalg.norm(apart, axis=2), 1e-9)
    value = distance - np.array([shape[i][1] + shape[j][1] for i, j in pairs])
    slopes, close = np.zeros((1, *value.shape, state.chain.size)), (value < FAR * SCALE).any(axis=0)
    normal = (apart / distance[..., None])[:, close]
    slopes[0][:, close] = state.along(first[close], here[:, close], normal) - state.along(second[close], there[:, close], normal)
    return Margins(value, slopes)


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
    body = state.chain.body
    pairs = box_pairs(body)
    if not pairs:
        return Margins(np.empty((len(state.x), 0)), np.empty((1, len(state.x), 0, state.chain.size)))
    limb, box = (np.repeat([pair[k] for pair in pairs], len(ALONG)) for k in range(2))
    shape = {i: capsule(body, i) for i, _ in pairs}
    points = np.concatenate([shape[i][0][0] + ALONG[:, None] * (shape[i][0][1] - shape[i][0][0]) for i, _ in pairs])
    place = state.placed(limb, points)
    low, high = np.swapaxes(body.boxes[box], 0, 1)
    turn = state.rotation[:, box]
    local = np.einsum("tkji,tkj->tki", turn, place - state.position[:, box]) - (low + high) / 2
    over = np.abs(local) - (high - low) / 2
    outside = np.linalg.norm(np.maximum(over, 0.0), axis=2)
    deepest = np.eye(3)[np.argmax(over, axis=2)]
    away = np.where(outside[..., None] > 0, np.maximum(over, 0.0) / np.maximum(outside, 1e-12)[..., None], deepest) * np.sign(local)
    value = np.where(outside > 0, outside, over.max(axis=2)) - np.array([shape[i][1] for i in limb])
    slopes, close = np.zeros((1, *value.shape, state.chain.size)), (value < FAR * SCALE).any(axis=0)
    normal = np.einsum("tkij,tkj->tki", turn[:, close], away[:, close])
    slopes[0][:, close] = state.along(limb[close], place[:, close], normal) - state.along(box[close], place[:, close], normal)
    return Margins(value, slopes)

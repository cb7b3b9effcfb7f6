"""Skin that slides over bone with the angles beside a marker's segment: products of rows with it, and without it."""

import numpy as np

from biodance.body.body import Body
from biodance.body.tables.error_sizes import error_size
from biodance.motion.kinematics import neighbours
from biodance.records import Array, Index


def with_slides(body: Body, products: Array, angles: Array, kept: Index) -> tuple[Array, Array, Array]:
    """Return X'X (p, p), S'X (s, p) and S'S (s, s) of the rows X = [markers, others] of T postures and their slides S.

    Parameters
    ----------
    body : Body
        Whose markers slide.
    products : (T, p, p) array
        X'X of each posture; the first 3 K columns are the K markers along the axes of their segments, 1/m.
    angles : (T, n) array
        Joint angles from the static posture, rad.
    kept : (K,) array
        Which markers of the body these are.

    Returns
    -------
    tuple of arrays
        A slide is a marker's column times an angle beside its segment. Its row of posture t is the marker's own times
        angle(t), so that S'S is the sum over t of products(t) times two angles: block by block of markers that share a
        segment, and so their angles.
    """
    on, beside = np.array(body.markers.segment)[kept], neighbours(body) > 0
    blocks = [(np.flatnonzero(np.repeat(on, 3) == one), angles[:, beside[:, one]]) for one in np.unique(on)]
    # Moments with the angles: sum over t of angle[t, n] X'X[t, own, :].
    shared = [np.tensordot(turn, products[:, own], axes=(0, 0)) for own, turn in blocks]
    square = []
    for own, turn in blocks:
        row = []
        for others, other in blocks:
            pairs = (turn[:, :, None] * other[:, None]).reshape(len(angles), -1)
            block = np.tensordot(pairs, products[:, own][:, :, others], axes=(0, 0))
            block = block.reshape(turn.shape[1], other.shape[1], own.size, others.size)
            # Angles first, then columns, as in `shared`.
            row.append(block.transpose(0, 2, 1, 3).reshape(turn.shape[1] * own.size, -1))
        square.append(row)
    return (
        products.sum(axis=0),
        np.concatenate([one.reshape(-1, products.shape[2]) for one in shared]),
        np.block(square),
    )


def without_slides(square: Array, shared: Array, own: Array, noise: float) -> Array:
    """Return the products ``square`` (p, p) of rows of variance ``noise`` without slides: ``own`` (s, s) of these,
    ``shared`` (s, p) with the rows.
    """
    # Prior N(0, s²) of a slide, in the units of rows with variance `noise`.
    inner = own + noise * error_size("slide", "marker") ** -2 * np.eye(len(own))
    # Schur complement: X'X - X'S (S'S + noise / s²)^-1 S'X.
    return np.asarray((square - shared.T @ np.linalg.solve(inner, shared)) / noise)

"""First guesses of a posture from the markers of one frame alone: typical joint angles, and the root where its markers say.

The root comes from the rigid fit of its markers (Kabsch 1976, DOI 10.1107/S0567739476001873).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from biodance.motion.marker_moments import Measured, fit
from biodance.motion.tree import Tree
from biodance.records import Array

OTHERS = 0.01
"""Weight of the other segments' markers in the root's rigid fit: enough where the root's own markers are hidden."""


def start(tree: Tree, measured: Measured, *, share: float | None = None) -> Array:
    """Return q (nq, B): the angles at a ``share`` of their range between the limits (None: zero), the root where its markers say."""
    angles = np.clip(np.zeros((tree.joints, 1)), tree.lower, tree.upper)
    if share is not None:
        bounded = np.isfinite(tree.lower) & np.isfinite(tree.upper)
        angles = np.where(bounded, (1 - share) * np.where(bounded, tree.lower, 0) + share * np.where(bounded, tree.upper, 0), angles)
    return placed(tree, measured, np.repeat(angles, measured.square.size, axis=1))


def placed(tree: Tree, measured: Measured, angles: Array) -> Array:
    """Return q with the root's pose that fits the body, rigid at ``angles``, best to its markers: the root segment's before all others."""
    if not tree.n_root:
        return angles
    frames = angles.shape[1]
    q = np.concatenate([np.zeros((3, frames)), np.tile([[0.0], [0.0], [0.0], [1.0]], (1, frames)), angles])
    at = fit(tree, measured, q)
    share = np.where(tree.carrier == 0, 1.0, OTHERS)
    weight = share @ measured.weight
    model = np.einsum("n,nib->bi", share, _model_sum(measured, at.rotation, at.place)) / weight[:, None]
    seen = np.einsum("n,nib->bi", share, measured.seen) / weight[:, None]
    cross = np.einsum("nikb,njkb,n->bij", at.rotation, measured.cross, share) + np.einsum("nib,njb,n->bij", at.place, measured.seen, share)
    left, _, right = np.linalg.svd(np.swapaxes(cross / weight[:, None, None] - model[:, :, None] * seen[:, None], 1, 2))
    flip = np.ones((frames, 3))
    flip[:, 2] = np.linalg.det(left @ right)
    rotation = (left * flip[:, None]) @ right
    q[3:7] = Rotation.from_matrix(rotation).as_quat().T
    q[:3] = (seen - np.einsum("bij,bj->bi", rotation, model)).T
    return q


def _model_sum(measured: Measured, rotation: Array, place: Array) -> Array:
    return measured.weight[:, None] * place + np.einsum("nikb,nkb->nib", rotation, measured.model)

"""A trunk that nobody saw: it stays upright and faces where the person goes, instead of swinging with the pelvis.

In walking the pelvis tilts, drops and turns by several degrees while the trunk above it hardly leans (Winter 1995,
doi:10.1016/0966-6362(96)82849-9): upright is the nearer guess, rigid on the pelvis the farther one.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from biodance.body.body import Body
from biodance.motion.kinematics import poses
from biodance.records import Array

_STRIDE = 1.0
"""s over which the direction that the pelvis faces is averaged: about one stride, in which it turns to and fro."""


def upright_trunk(body: Body, q: Array, rate: float) -> Array:
    """Return postures q (T, nq) at ``rate`` Hz with the unseen trunk upright, facing as the pelvis does on average.

    The body is returned to as it is where the trunk is seen, or is no ball joint.
    """
    chain = [i for i, joint in enumerate(body.joints) if joint.name.rsplit("_", 1)[0] == "trunk"]
    if len(chain) != 3 or body.free[chain].any():
        return q
    pelvis = poses(body, q).rotation[:, 0]
    facing = np.unwrap(np.arctan2(pelvis[:, 1, 0], pelvis[:, 0, 0]))
    width = min(len(q), max(1, round(_STRIDE * rate)))
    heading = uniform_filter1d(facing, width, mode="nearest") if len(q) > 1 else facing
    relative = np.swapaxes(pelvis @ body.joints[chain[0]].rotation, 1, 2) @ _upright(heading)
    out = np.array(q)
    first = body.nq - len(body.joints)
    signs = [float(body.joints[i].axis.sum()) for i in chain]
    angles = (
        np.arctan2(-relative[:, 0, 1], relative[:, 1, 1]),
        np.arcsin(np.clip(relative[:, 2, 1], -1.0, 1.0)),
        np.arctan2(-relative[:, 2, 0], relative[:, 2, 2]),
    )
    for i, sign, angle in zip(chain, signs, angles, strict=True):
        out[:, first + i] = sign * angle
    return out


def _upright(heading: Array) -> Array:
    """Return lab_R_trunk (T, 3, 3) of somebody upright: x ahead, y up, z to the right."""
    zero, one = np.zeros_like(heading), np.ones_like(heading)
    ahead = np.stack([np.cos(heading), np.sin(heading), zero], axis=1)
    right = np.stack([np.sin(heading), -np.cos(heading), zero], axis=1)
    return np.stack([ahead, np.stack([zero, zero, one], axis=1), right], axis=2)

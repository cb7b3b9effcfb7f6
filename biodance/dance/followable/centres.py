"""What postures tell of the centres of the ball joints, which identification finds from the movement.

A joint's centre lies at c in the frame of the one segment and at d in that of the other: c = R d + their distance, with
R the rotation between them. Every posture is one such equation, and only postures that differ tell both apart.
"""

import numpy as np

from biodance.dance.problem.chain import Chain
from biodance.motion.kinematics import poses
from biodance.records import Array

_BALLS = (
    ("pelvis", "right_thigh"),
    ("pelvis", "left_thigh"),
    ("pelvis", "trunk_head"),
    ("trunk_head", "right_upper_arm"),
    ("trunk_head", "left_upper_arm"),
)
_UNKNOWN, _SKIN = 0.015, 0.020
"""m: what is not known of a centre before the movement, and how far skin slides in one posture."""
CENTRES = 6 * len(_BALLS)
"""Unknown coordinates of all centres."""


def told_of_centres(chain: Chain, x: Array, columns: int) -> Array:
    """Return the whitened rows (3 J, columns) of a posture ``x`` (n,): per standard deviation of what slides and, in
    the last `CENTRES` columns, of what is not known of the J centres.
    """
    body, out = chain.body, np.zeros((3 * len(_BALLS), columns))
    turned = np.asarray(poses(body, chain.motion(np.zeros(1), x[None], *np.zeros((2, 1, x.size))).q).rotation)[0]
    for k, (near, far) in enumerate(_BALLS):
        first, second = (turned[body.segments.index(name)] for name in (near, far))
        here = columns - CENTRES + 6 * k
        out[3 * k : 3 * k + 3, here : here + 6] = np.hstack([np.eye(3), -first.T @ second])
    return out * _UNKNOWN / _SKIN

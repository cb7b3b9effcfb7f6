"""How two feet share the wrench that the ground must give, while a dance is planned (paper eq. 2).

Each foot bears a share in inverse proportion to the distance of its sole's centre from the zero-moment point, of the
force as of the moment about the vertical through that point; both forces point the same way.
"""

import numpy as np

from biodance.dance.problem.stance import Stance
from biodance.records import Array

_TINY = 1e-30
"""Step of the complex-step derivative: exact to machine precision."""


def foot_forces(total: Array, stance: Stance) -> tuple[Array, Array]:
    """Return the wrenches (T, 2, 6) of the right and left foot and their derivative (T, 2, 6, 6) with respect to the
    total (T, 6).
    """
    if len(stance.planted) == 1:
        chosen = np.eye(2)[stance.planted[0]]
        return total[:, None] * chosen[:, None], np.broadcast_to(
            chosen[:, None, None] * np.eye(6), (len(total), 2, 6, 6)
        )
    stepped = total[:, None] + 1j * _TINY * np.eye(6)
    derivative = np.swapaxes(
        _share(stepped.reshape(-1, 6), stance.sole_centres).reshape(len(total), 6, 2, 6).imag / _TINY, 1, 2
    )
    return _share(total, stance.sole_centres), np.swapaxes(derivative, 2, 3)


def _share(total: Array, centres: Array) -> Array:
    force, moment = total[:, :3], total[:, 3:]
    point = np.stack([-moment[:, 1] / force[:, 2], moment[:, 0] / force[:, 2]], axis=1)
    reach = [np.sqrt(np.sum((point - c[:2]) ** 2, axis=1)) for c in centres]
    right = reach[1] / (reach[0] + reach[1])
    middle = right[:, None] * centres[0, :2] + (1 - right[:, None]) * centres[1, :2]
    twist = moment[:, 2] - point[:, 0] * force[:, 1] + point[:, 1] * force[:, 0]
    feet = []
    for part, centre in ((right, centres[0]), (1 - right, centres[1])):
        x, y = (point + centre[:2] - middle).T
        own = np.stack([y * force[:, 2], -x * force[:, 2], x * force[:, 1] - y * force[:, 0] + twist], axis=1)
        feet.append(part[:, None] * np.concatenate([force, own], axis=1))
    return np.stack(feet, axis=1)

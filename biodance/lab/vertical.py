"""Which way is up? Text formats do not say it (`c3d/vertical.py`: a C3D file may)."""

import numpy as np

from biodance.records import Array

Y_UP_TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) lab_R_file of a Y-up recording (OpenSim: x forward, y up, z right): x stays, y becomes z, z becomes -y."""

CLEARLY_TALLER = 1.3


def body_is_tall_along_z(xyz: Array) -> bool:
    """Return True if the marker cloud (T, K, 3) is clearly taller along the third axis than along the second.

    The extent is taken frame by frame and its median over time is compared, so that walking does not count as height;
    arms that are spread sideways stay below 1.3 times the stature. A single marker has no extent: the answer is then
    False.
    """
    seen = xyz[:, np.logical_not(np.isnan(xyz).all(axis=(0, 2)))]
    if seen.shape[1] < 2:
        return False
    frames = seen[np.logical_not(np.isnan(seen).any(axis=2)).sum(axis=1) >= 2]
    if not len(frames):
        return False
    extent = np.median(np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1), axis=0)
    return bool(extent[2] > CLEARLY_TALLER * extent[1])

"""The quietest part of a recording."""

import numpy as np
from numpy.typing import NDArray

from biodance.records import Markers

WINDOW = 0.5
"""s: length of the quietest part of the static trial that is averaged."""


def quietest(markers: Markers) -> NDArray[np.bool_]:
    """Return (T,) True for the ``WINDOW`` s in which the markers move least while most of them are seen; all frames
    of a shorter trial.
    """
    frames = markers.time.size
    length = frames if frames < 3 else round(WINDOW * markers.rate)
    if frames <= max(length, 2):
        return np.ones(frames, dtype=bool)
    step = np.linalg.norm(np.diff(markers.xyz, axis=0), axis=2)
    unseen = np.isnan(step)
    cost = np.where(unseen, 0.0, step).sum(axis=1) + 0.1 * unseen.sum(
        axis=1
    )  # an unseen marker costs as much as one moving 0.1 m a frame
    total = np.convolve(cost, np.ones(max(length - 1, 1)), mode="valid")
    start = int(np.argmin(total))
    return np.isin(np.arange(frames), np.arange(start, start + length))


_STILL = 0.02
"""m, standard deviation over half a second beyond which a marker does not stand still."""


def posture_frames(markers: Markers) -> tuple[NDArray[np.bool_], bool]:
    """Return (T,) True for the frames that show one posture, and whether the person stands still in them.

    They are the quietest half second; where nobody stands still, the one frame, among those that show most markers, in
    which the lowest third of the markers is lowest: both feet are on the ground.
    """
    quiet = quietest(markers)
    near = markers.xyz[quiet]
    several = np.isfinite(near).all(axis=2).sum(axis=0) > 1
    if markers.time.size <= 2:
        return quiet, True
    if several.any() and np.nanmedian(np.nanstd(near[:, several], axis=0).max(axis=1)) <= _STILL:
        return quiet, True
    height = np.sort(np.where(markers.seen, markers.xyz[:, :, 2], np.inf), axis=1)
    lowest = height[:, : max(1, len(markers.names) // 3)].mean(axis=1)
    unseen = (~markers.seen).sum(axis=1)
    lowest[unseen > unseen.min()] = np.inf
    return np.arange(markers.time.size) == int(np.argmin(lowest)), False

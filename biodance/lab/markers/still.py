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

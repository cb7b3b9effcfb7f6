"""What lies around every sample of a series: any, mean, median. As scipy's ``ndimage`` has them, which takes 50 ms to
load.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from biodance.records.arrays import Array, Mask


def any_near(mask: Mask, reach: int) -> Mask:
    """Return (T,) where ``mask`` (T,) is True at most ``reach`` samples away."""
    at = np.arange(mask.size)
    before = np.concatenate([[0], np.cumsum(mask)])
    return np.asarray(before[np.minimum(at + reach + 1, mask.size)] > before[np.maximum(at - reach, 0)])


def moving_mean(values: Array, width: int, *, ends: Literal["symmetric", "edge"]) -> Array:
    """Return the mean (T,) over ``width`` samples around each of ``values`` (T,), which are mirrored or go on beyond
    their ends.
    """
    return np.asarray(_windows(values, width, ends).mean(axis=1))


def moving_median(values: Array, width: int) -> Array:
    """Return the median (T,) over ``width`` <= T samples around each of ``values`` (T,), mirrored about the end
    points; of an even ``width`` the upper one.
    """
    return np.asarray(np.partition(_windows(values, width, "reflect"), width // 2, axis=1)[:, width // 2])


def _windows(values: Array, width: int, ends: Literal["symmetric", "edge", "reflect"]) -> NDArray[np.float64]:
    longer = np.pad(values, (width // 2, width - 1 - width // 2), mode=ends)
    return np.lib.stride_tricks.sliding_window_view(longer, width)

"""Independent, reproducible random streams, and smooth random motion."""

from zlib import crc32

import numpy as np

from biodance.records import Array


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """Return the random stream of one ``purpose``: drawing more numbers for one purpose never changes another."""
    return np.random.default_rng([seed, *(crc32(word.encode()) for word in purpose)])


def smooth_noise(rng: np.random.Generator, time: Array, *, columns: int, cutoff: float) -> Array:
    """Return smooth random curves (T, columns) of zero mean and unit expected standard deviation.

    ``time`` (T,) s, equidistant; ``cutoff`` Hz: the amplitude spectrum falls as exp(-(f / cutoff)²), so all derivatives
    exist. The number of draws depends on the duration and the cutoff, not on the sampling rate.
    """
    duration = 2.0 * (time[-1] - time[0]) + 1.0
    frequency = np.arange(1, int(np.ceil(3.0 * cutoff * duration)) + 1) / duration
    weight = np.exp(-((frequency / cutoff) ** 2))
    weight /= np.sqrt(np.sum(weight**2))
    cosine, sine = rng.normal(size=(2, frequency.size, columns)) * weight[None, :, None]
    phase = 2 * np.pi * np.outer(time, frequency)
    return np.cos(phase) @ cosine + np.sin(phase) @ sine

"""Rows that were stamped when they arrived: the instants at which the cameras saw them, as the markers tell them.

A middleware (ROS, a network, a script) stamps a frame when it comes, some milliseconds late or less late. All markers
of a row then seem to have moved along their paths by velocity times that error, which no white noise does: the errors
of fast rows are known to a fraction of a millisecond. Cameras run at an even rate, so that the instants lie on a grid,
though frames may be missing; where the corrected stamps gather on one, every row is put on it.
"""

import numpy as np
from scipy.fft import next_fast_len
from scipy.interpolate import make_smoothing_spline

from biodance.lab.markers.time_axis import time_axis
from biodance.records import Array

_ROUNDS = 15
_COMPONENTS = 3
"""Principal components of the markers' movement whose paths are smoothed: what is left holds noise and little else."""
_SLOW = 0.375
"""Share of the rate of the rows at which the smooth paths have half their amplitude: people move more slowly."""
_STILL = 0.01
"""Of the mean squared speed: rows that are slower tell nothing of their instants."""
_HIGHEST = 500.0
"""Hz of cameras that are looked for."""
_TICK = 0.25 / _HIGHEST
"""s to which instants are rounded where rates are tried."""
_FINE = 16
"""Rates tried per cycle that a recording holds more."""
_CHANCE = 1e-6
"""That stamps without a grid gather as much at any rate."""
_FEWEST = 100
"""Rows without which nothing is looked for."""


def camera_instants(stamps: Array, xyz: Array) -> tuple[Array, str]:
    """Return the instants (S,) s at which rows of markers (S, K, 3) m with ``stamps`` (S,) s were seen, on the grid of
    the cameras, and a sentence on it; the stamps and "" where their steps are even, or no grid is told.
    """
    rows = _without_holes(stamps)
    paths = _paths(xyz[rows]) if time_axis(stamps, where="").sampled and rows.stop - rows.start >= _FEWEST else None
    grid = None if paths is None else _on_grid(stamps[rows], paths)
    if grid is None:
        return stamps, ""
    instants, rate = grid
    found = np.array(stamps)
    found[rows] = instants
    off = 1000 * float(np.std(instants - stamps[rows]))
    return found, (
        f"The rows were stamped when they arrived: what all markers share of their errors puts them on the frames of "
        f"cameras at {rate:.5g} Hz, {off:.2g} ms (RMS) from their stamps, and these instants were taken."
    )


def _without_holes(stamps: Array) -> slice:
    """Return the longest run of rows without a hole of more than ten steps."""
    holes = np.flatnonzero(np.diff(stamps) > 10 * np.median(np.diff(stamps))) + 1
    edges = [0, *holes.tolist(), stamps.size]
    longest = int(np.argmax(np.diff(edges)))
    return slice(edges[longest], edges[longest + 1])


def _paths(xyz: Array) -> Array | None:
    """Return the principal components (S, c) m of the markers that are seen throughout; None without three."""
    seen = xyz[:, np.isfinite(xyz).all(axis=(0, 2))]
    if seen.shape[1] < 3:
        return None
    columns = seen.reshape(len(seen), -1) - seen.mean(axis=0).ravel()
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray((left * size)[:, :_COMPONENTS])


def _on_grid(stamps: Array, paths: Array) -> tuple[Array, float] | None:
    """Return the instants (S,) s, one a frame, at which the ``paths`` (S, c) are smoothest, and the rate (Hz) of the
    cameras; None where no grid is told.
    """
    instants = np.array(stamps)
    for _ in range(_ROUNDS):
        late, weight = _late(instants, paths)
        if np.any(np.diff(instants + late) <= 0):
            break
        instants += late
    grid = _grid(instants, weight, 1 / float(np.median(np.diff(instants))))
    if grid is None:
        return None
    rate, first = grid
    frames = np.rint((instants - first) * rate)
    for _ in range(_ROUNDS):
        if np.any(np.diff(frames) < 1):
            return None
        instants = first + frames / rate
        before, frames = frames, np.rint((instants + _late(instants, paths)[0] - first) * rate)
        if np.array_equal(before, frames):
            break
    return instants, rate


def _late(instants: Array, paths: Array) -> tuple[Array, Array]:
    """Return how much later (S,) s than ``instants`` (S,) s rows of ``paths`` (S, c) were seen, if they are smooth, and
    the squared speed (S,) that tells it.
    """
    rate = 1 / float(np.median(np.diff(instants)))
    stiff = rate / (2 * np.pi * _SLOW * rate) ** 4
    smooth = [make_smoothing_spline(instants, path, lam=stiff) for path in paths.T]
    left = paths - np.stack([one(instants) for one in smooth], axis=1)
    speed = np.stack([one.derivative()(instants) for one in smooth], axis=1)
    square = np.sum(speed**2, axis=1)
    return np.sum(left * speed, axis=1) / (square + _STILL * square.mean()), square


def _grid(instants: Array, weight: Array, rate: float) -> tuple[float, float] | None:
    """Return the rate (Hz) and an instant (s) of the grid on which the ``instants`` (S,) gather; None where they
    gather no more than chance would.
    """
    share = weight / weight.sum()
    places = np.rint((instants - instants[0]) / _TICK).astype(int)
    count = next_fast_len(_FINE * (int(places[-1]) + 1), real=True)
    gathered = np.fft.rfft(np.bincount(places, share), count)
    tried = np.arange(gathered.size) / (count * _TICK)
    legal = np.flatnonzero((tried > 1.5 * rate) & (tried < _HIGHEST))
    best = legal[int(np.argmax(np.abs(gathered[legal])))]
    chance = legal.size * np.exp(-(np.abs(gathered[best]) ** 2) / np.sum(share**2))
    if chance > _CHANCE:
        return None
    frequency = float(tried[best])
    return frequency, float(instants[0] - np.angle(gathered[best]) / (2 * np.pi * frequency))

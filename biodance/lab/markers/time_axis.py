"""The time of a recording whose rows carry stamps: equal steps are taken as such, changing ones are resampled on their
own stamps, and what that costs is said. One place for tables, .trc and .mot; C3D holds a rate and no stamps.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.fft import next_fast_len
from scipy.interpolate import make_interp_spline, make_smoothing_spline

from biodance.errors import FileRefused
from biodance.lab.markers.signals import faulty_markers, without_faults
from biodance.records import Array, Markers, Mask, runs

_HOLE = 2.5
"""Steps between two stamps from which on nothing is told between them: one row is missing at two."""
LONGEST_STEP = 0.2
"""s: rows farther apart are postures. Below 5 Hz a movement of 2 Hz, the fastest that a person repeats with the whole
body, cannot be told (Nyquist).
"""


def of_postures(time: Array) -> bool:
    """Return whether frames at ``time`` (T,) s lie too far apart to tell a movement between them: postures at rest."""
    return time.size > 1 and bool(np.median(np.diff(time)) > LONGEST_STEP)


@dataclass(frozen=True, eq=False)
class TimeAxis:
    """``stamps`` (S,) s as recorded; ``time`` (T,) s with equal steps on which the recording is given; ``sampled``
    whether values must be interpolated for that (``at``); ``said`` what was decided, "" for equal steps.
    """

    stamps: Array
    time: Array
    sampled: bool
    said: str = ""

    def at(self, values: Array) -> Array:
        """Return ``values`` (S, ...) on ``time``, by cubic splines between samples that are known; NaN where one of the
        two neighbours is not, or where they lie more than 2.5 steps apart.
        """
        if not self.sampled:
            return values
        columns = values.reshape(len(values), -1)
        out = np.full((self.time.size, columns.shape[1]), np.nan)
        known = np.isfinite(columns)
        whole = known.all(axis=0)
        # columns that are known throughout go together
        for group in [np.flatnonzero(whole)] * bool(whole.any()) + [np.array([k]) for k in np.flatnonzero(~whole)]:
            for start, stop in _pieces(self.stamps, known[:, group[0]]):
                stamps = self.stamps[start:stop]
                inside = (self.time >= stamps[0]) & (self.time <= stamps[-1])
                if stamps.size > 1 and inside.any():
                    spline = make_interp_spline(stamps, columns[start:stop, group], k=min(3, stamps.size - 1))
                    out[np.ix_(inside, group)] = spline(self.time[inside])
        return out.reshape(self.time.size, *values.shape[1:])

    @property
    def noise(self) -> float:
        """Factor on the standard deviation of white noise, as drawn noise (fixed seed, known to 1 %) comes out."""
        # The interpolation is linear: its effect on white noise is a factor.
        drawn = np.random.default_rng(0).normal(size=(self.stamps.size, 16))
        return float(np.nanstd(self.at(drawn)))

    def missed_by(self, values: Array) -> float:
        """Return by how much (RMS, unit of ``values`` (S, ...)) a sample left out is missed by the cubic through the
        two before and the two behind it: no less than the error between samples, which are half as far apart; NaN where
        nothing is told.
        """
        if self.stamps.size < 5 or not self.sampled:
            return float("nan")
        columns = values.reshape(len(values), -1)
        around = np.stack([self.stamps[k : self.stamps.size - 4 + k] for k in (0, 1, 3, 4)])
        at = self.stamps[2:-2]
        expected = np.zeros_like(columns[2:-2])
        for k, shift in enumerate((0, 1, 3, 4)):
            others = np.delete(around, k, axis=0)
            weight = np.prod((at - others) / (around[k] - others), axis=0)  # Lagrange's
            expected += weight[:, None] * columns[shift : len(columns) - 4 + shift]
        inner = np.ptp(around, axis=0) < 4 * _HOLE * np.median(np.diff(self.stamps))
        off = (expected - columns[2:-2])[inner]
        return float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else float("nan")


def time_axis(stamps: Array, *, where: str, row: str = "row") -> TimeAxis:
    """Return the time axis of rows with ``stamps`` (S,) s; ``row`` is what the file calls one.

    Stamps within a fifth of a step of equal steps are equal steps, rounded. Others are resampled at their median step;
    single rows at an end, before or behind a hole of more than 2.5 steps, are left out. Rows
    more than 0.2 s apart are single postures: they are kept as they are, on equal steps.

    Raises
    ------
    FileRefused
        ``where``: a stamp is no number, or they do not increase.
    """
    bad = np.isnan(stamps)
    if bad.any() or np.any(np.diff(stamps) <= 0):
        at = int(np.argmax(bad)) if bad.any() else int(np.argmax(np.diff(stamps) <= 0)) + 1
        raise FileRefused(
            f"{where}: the time does not increase at {row} {at + 1} ({stamps[at]:g} s). Export the file again."
        )
    if stamps.size < 2:
        return TimeAxis(stamps, stamps, False)
    even = np.linspace(stamps[0], stamps[-1], stamps.size)
    if np.abs(stamps - even).max() <= 0.2 * (even[1] - even[0]):  # writers round the time column
        return TimeAxis(stamps, even, False)
    step = float(np.median(np.diff(stamps)))
    if step > LONGEST_STEP:
        said = f"{_varying(stamps)}: too far apart to tell a movement between rows. Each was kept as a posture."
        return TimeAxis(stamps, stamps[0] + step * np.arange(stamps.size), False, said)
    pieces = [(a, b) for a, b in _pieces(stamps, np.ones(stamps.size, dtype=bool)) if b - a > 1]
    first, last = pieces[0][0], pieces[-1][1] - 1
    kept = stamps[first : last + 1]
    time = np.minimum(kept[0] + step * np.arange(int((kept[-1] - kept[0]) / step + 1e-6) + 1), kept[-1])
    lone = stamps.size - kept.size
    cut = f" {lone} row{'s' * (lone > 1)} apart from the others at the ends left out." if lone else ""
    said = f"{_varying(kept)}: the rows were resampled at {1 / step:.4g} Hz by cubic splines on their own stamps.{cut}"
    return TimeAxis(stamps, time, True, said)


def _varying(stamps: Array) -> str:
    low, middle, high = 1000 * np.percentile(np.diff(stamps), [0, 50, 100])
    return f"The time steps are not equal ({low:.2g} to {high:.3g} ms, half of them below {middle:.3g})"


def _pieces(stamps: Array, known: Mask) -> list[tuple[int, int]]:
    """Return the runs (start, stop) of ``known`` samples (S,) without a hole between their stamps."""
    holes = np.flatnonzero(np.diff(stamps) > _HOLE * np.median(np.diff(stamps))) + 1
    found: list[tuple[int, int]] = []
    for start, stop in runs(known):
        cuts = [start, *holes[(holes > start) & (holes < stop)].tolist(), stop]
        found += pairwise(cuts)
    return found


_ROUNDS = 15
_HIGHEST = 500.0  # Hz of cameras that are looked for
_TICK = 0.25 / _HIGHEST  # s to which instants are rounded where rates are tried


def camera_instants(stamps: Array, xyz: Array) -> tuple[Array, str]:
    """Return the instants (S,) s at which rows of markers (S, K, 3) m with ``stamps`` (S,) s were seen, on the grid of
    the cameras, and a sentence on it; the stamps and "" where their steps are even, or no grid is told.
    """
    holes = np.flatnonzero(np.diff(stamps) > 10 * np.median(np.diff(stamps))) + 1
    edges = [0, *holes.tolist(), stamps.size]
    longest = int(np.argmax(np.diff(edges)))
    rows = slice(edges[longest], edges[longest + 1])
    # Fewer than a hundred rows tell no grid.
    paths = _paths(xyz[rows]) if time_axis(stamps, where="").sampled and rows.stop - rows.start >= 100 else None
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


def _paths(xyz: Array) -> Array | None:
    """Return the first three principal components (S, 3) m of the markers that are seen throughout: what is left holds
    noise and little else; None without three markers.
    """
    seen = xyz[:, np.isfinite(xyz).all(axis=(0, 2))]
    if seen.shape[1] < 3:
        return None
    # Each coordinate less its mean.
    columns = seen.reshape(len(seen), -1) - seen.mean(axis=0).ravel()
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    # U S: paths along the principal directions, largest first.
    return np.asarray((left * size)[:, :3])


def _on_grid(stamps: Array, paths: Array) -> tuple[Array, float] | None:
    """Return the instants (S,) s at which the ``paths`` (S, c) are smoothest and the cameras' rate; or None."""
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
    """Return how much later (S,) s rows of ``paths`` (S, c) were seen, if smooth, and their squared speed (S,)."""
    rate = 1 / float(np.median(np.diff(instants)))
    # A smoothing spline passes 1 / (1 + lam w⁴ / rate): half at 0.375 of the rows' rate; people move more slowly.
    stiff = rate / (2 * np.pi * 0.375 * rate) ** 4
    smooth = [make_smoothing_spline(instants, path, lam=stiff) for path in paths.T]
    left = paths - np.stack([one(instants) for one in smooth], axis=1)
    speed = np.stack([one.derivative()(instants) for one in smooth], axis=1)
    square = np.sum(speed**2, axis=1)
    # path = smooth(t + late), so late = left · speed / speed², damped where the marker hardly moves.
    return np.sum(left * speed, axis=1) / (square + 0.01 * square.mean()), square


def _grid(instants: Array, weight: Array, rate: float) -> tuple[float, float] | None:
    """Return rate (Hz) and an instant (s) of the grid on which ``instants`` (S,) gather; None as by chance."""
    # Fast rows tell most of their instants.
    share = weight / weight.sum()
    places = np.rint((instants - instants[0]) / _TICK).astype(int)
    # Zeros behind: rates are tried sixteen times more finely than one cycle in the whole recording.
    count = next_fast_len(16 * (int(places[-1]) + 1), real=True)
    # Sum of share exp(-i w t): large where all instants lie on a grid of that rate.
    gathered = np.fft.rfft(np.bincount(places, share), count)
    tried = np.arange(gathered.size) / (count * _TICK)
    legal = np.flatnonzero((tried > 1.5 * rate) & (tried < _HIGHEST))
    best = legal[int(np.argmax(np.abs(gathered[legal])))]
    # |sum of share exp(i phase)|² of random phases is exponential with the mean sum(share²); so many rates were tried
    chance = legal.size * np.exp(-(np.abs(gathered[best]) ** 2) / np.sum(share**2))
    # Probability that stamps without a grid gather as much at any rate.
    if chance > 1e-6:
        return None
    frequency = float(tried[best])
    # exp(-i w t0): the phase tells the first instant.
    return frequency, float(instants[0] - np.angle(gathered[best]) / (2 * np.pi * frequency))


def resampled(names: tuple[str, ...], xyz: Array, axis: TimeAxis) -> tuple[Markers, list[str]]:
    """Return markers ``xyz`` (S, K, 3) m of rows on the time of their ``axis``, and what was taken as not seen, one
    sentence a marker; markers with equal steps as they are: `prepare` looks at these.
    """
    if not axis.sampled:
        return Markers(names, axis.time, xyz), []
    rows = Markers(names, axis.stamps, xyz)
    faults = faulty_markers(rows)
    seen = without_faults(rows, faults)
    return Markers(names, axis.time, axis.at(seen.xyz)), [one.sentence(one.when(axis.stamps)) for one in faults]

"""From which postures the frames of a trial descend, so that each reaches its best minimum and most need two or three steps.

Few frames start from their own markers alone, all others from the postures solved around them. A frame that fits much worse than its
neighbours is tried again from theirs and from its own markers.
"""

from functools import reduce

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import median_filter

from biodance.motion.chart import Chart
from biodance.motion.marker_moments import fit
from biodance.motion.marker_problem import MarkerProblem, better, descend
from biodance.motion.newton import Minimum
from biodance.motion.starts import placed, start
from biodance.motion.tree import Index
from biodance.records import Array

STRIDES = (64, 16, 4, 1)
"""Every 64th frame is solved from its own markers; then every 16th, 4th and each frame from those around it."""

SHARES = (0.5, None)
"""First guesses of the angles, as shares of their range (None: zero): a bent body finds straight limbs more often than the reverse."""

MORE_SHARES = (0.25, 0.75)
"""Further guesses for doubtful frames, and for all first frames of a short trial."""

SHORT = 640
"""Frames below which a trial is short: it has too few neighbours to correct a frame that started wrongly."""

NEIGHBOURS = 11
"""Frames whose median fit a frame is compared with."""

DOUBT = (1.5, 0.001)
"""A frame is doubtful where its RMS distance exceeds the neighbours' median times the first number plus the second (m)."""


def search(problem: MarkerProblem, frames: Index) -> Minimum:
    """Return the minima (F frames) of ``frames`` (F,), increasing, without any guess."""
    count = len(frames)
    out = Minimum(np.zeros((problem.chart.nq, count)), np.zeros(count), np.full(count, np.inf), np.zeros(count, dtype=np.intp))
    known = np.zeros(0, dtype=np.intp)
    for stride in STRIDES:
        level = np.setdiff1d(np.append(np.arange(0, count, stride), count - 1), known)
        if not known.size:
            found = from_markers(problem, frames[level], SHARES if count > SHORT else (*SHARES, *MORE_SHARES))
        elif level.size:
            found = descend(problem, frames[level], between(problem.chart, frames[known], out.q[:, known], frames[level]))
        else:
            continue
        _store(out, level, found)
        known = np.union1d(known, level)
        if stride in (STRIDES[0], STRIDES[-1]):
            _store(out, known, retry(problem, frames[known], _part(out, known)))
    return out


def from_markers(problem: MarkerProblem, frames: Index, shares: tuple[float | None, ...]) -> Minimum:
    """Return the best of the minima reached from the first guesses at the given ``shares`` of the joint ranges."""
    measured, origin = problem.measured(frames)
    found = []
    for share in shares:
        q = start(problem.tree, measured, share=share)
        q[: min(problem.tree.n_root, 3)] += origin[: min(problem.tree.n_root, 3)]
        found.append(descend(problem, frames, q))
    return reduce(better, found)


def from_guess(problem: MarkerProblem, frames: Index, guess: Array) -> Minimum:
    """Return the minima reached from the postures ``guess`` (nq, F), each root first put where the markers say if that is nearer."""
    measured, origin = problem.measured(frames)
    r, angles = min(problem.tree.n_root, 3), guess[len(guess) - problem.tree.joints :]
    own, moved = guess.copy(), placed(problem.tree, measured, angles)
    own[:r] -= origin[:r]
    nearer = fit(problem.tree, measured, moved).cost < fit(problem.tree, measured, own).cost
    start = np.where(nearer, moved, own)
    start[:r] += origin[:r]
    return retry(problem, frames, descend(problem, frames, start))


def retry(problem: MarkerProblem, frames: Index, found: Minimum) -> Minimum:
    """Return ``found`` with the doubtful frames tried again: from their markers, and from the nearest sound frames on both sides."""
    rms = np.sqrt(np.maximum(2 * found.cost, 0.0) / problem.weight[frames].sum(axis=1))
    doubtful = rms > DOUBT[0] * median_filter(rms, min(NEIGHBOURS, len(rms)), mode="mirror") + DOUBT[1]
    sound, bad = np.flatnonzero(~doubtful), np.flatnonzero(doubtful)
    if not (bad.size and sound.size):
        return found
    best = better(_part(found, bad), from_markers(problem, frames[bad], (*SHARES, *MORE_SHARES)))
    after = np.searchsorted(sound, bad)
    for neighbour in (sound[np.maximum(after - 1, 0)], sound[np.minimum(after, len(sound) - 1)]):
        best = better(best, descend(problem, frames[bad], found.q[:, neighbour]))
    out = _part(found, np.arange(len(frames)))
    _store(out, bad, best)
    return out


def between(chart: Chart, known: Index, q: Array, wanted: Index) -> Array:
    """Return postures (nq, F) at the frames ``wanted`` (F,) between the postures ``q`` (nq, M) at the frames ``known`` (M,), increasing.

    Monotone cubics in smooth coordinates; the first and the last posture are kept outside.
    """
    values = chart.smooth(q).stacked()
    if known.size > 1:
        values = PchipInterpolator(known, values, axis=1)(np.clip(wanted, known[0], known[-1]))
    else:
        values = np.repeat(values, len(wanted), axis=1)
    nearest = np.clip(np.searchsorted(known, wanted), 0, known.size - 1)
    return chart.posture(chart.split(values), q[len(q) - chart.joint_count :, nearest])


def _part(whole: Minimum, frames: Index) -> Minimum:
    return Minimum(whole.q[:, frames], whole.cost[frames], whole.slope[frames], whole.steps[frames])


def _store(whole: Minimum, frames: Index, part: Minimum) -> None:
    whole.q[:, frames], whole.cost[frames], whole.slope[frames] = part.q, part.cost, part.slope
    whole.steps[frames] = part.steps

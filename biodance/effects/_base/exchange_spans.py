"""When two markers carry each other's names: in a whole trial, or from one change of places to the next."""

from collections.abc import Iterable, Mapping

import numpy as np

from biodance.records import Array, Markers, Mask, runs

Pair = tuple[str, str]
"""Two labels in alphabetical order."""
Spans = tuple[tuple[int, int], ...]
"""Frames (start, stop), stop excluded."""
LEAST_EXCHANGED = 4
"""Frames of an exchange in a part of a trial; less is a spike."""
_HOLE = 0.1
"""s: shorter pauses of an exchange belong to it."""
_WHOLE = 0.9
"""Share of the frames from which on an exchange is one of the whole trial."""
_NEAR = 3
"""Frames about the end of a span within which the two markers must change places."""


def renamed_markers(markers: Markers, found: Mapping[Pair, Spans]) -> Markers:
    """Return the markers with the two of each pair ``found`` exchanged in its frames."""
    if not found:
        return markers
    xyz = markers.xyz.copy()
    for pair, spans in found.items():
        columns = [markers.names.index(name) for name in pair]
        for start, stop in spans:
            xyz[start:stop, columns] = xyz[start:stop, columns[::-1]]
    xyz.setflags(write=False)  # the record keeps it without a copy
    return Markers(markers.names, markers.time, xyz)


def exchange_spans(markers: Markers, pairs: Iterable[Pair], wrong: Mask, told: Mask) -> Spans:
    """Return the frames of an exchange: all where it is ``wrong`` (T,) in nearly all frames that tell, else the runs at
    whose ends the markers change places.
    """
    if not wrong.any():
        return ()
    if wrong.sum() >= _WHOLE * told.sum():
        return ((0, wrong.size),)
    joined = wrong.copy()
    for start, stop in runs(~wrong):
        short = stop - start <= _HOLE * markers.rate or not told[start:stop].any()
        joined[start:stop] = short and start > 0 and stop < wrong.size
    changes = _changes(markers, pairs)
    found = []
    for start, stop in runs(joined):
        ends = (_changed_at(changes, start), _changed_at(changes, stop))
        if (
            wrong[start:stop].sum() >= LEAST_EXCHANGED
            and ends[0] is not None
            and ends[1] is not None
            and ends[0] < ends[1]
        ):
            found.append((ends[0], ends[1]))
    return tuple(found)


def _changes(markers: Markers, pairs: Iterable[Pair]) -> Array:
    """Return (T + 1,) 1 where markers move less from one frame to the next if they change their names between the two,
    0 where they move more, NaN where that is not seen, as before the first and behind the last frame.
    """
    ways = np.zeros(markers.time.size + 1)
    ways[[0, -1]] = np.nan
    for one, other in ((markers[a], markers[b]) for a, b in pairs):
        straight = np.linalg.norm(np.diff(one, axis=0), axis=1) + np.linalg.norm(np.diff(other, axis=0), axis=1)
        # Way of both markers under their names less that under exchanged ones: positive where exchange is shorter.
        crossing = np.linalg.norm(other[1:] - one[:-1], axis=1) + np.linalg.norm(one[1:] - other[:-1], axis=1)
        ways[1:-1] += straight - crossing
    return np.where(np.isnan(ways), np.nan, np.where(ways > 0, 1.0, 0.0))


def _changed_at(changes: Array, end: int) -> int | None:
    """Return the frame near the ``end`` of a span at which the markers change places, the end itself where that is not
    seen; None where they do not.
    """
    first = max(end - _NEAR, 0)
    near = changes[first : end + _NEAR + 1]
    there = np.flatnonzero(near == 1)
    if there.size:
        return first + int(there[np.argmin(np.abs(first + there - end))])
    return end if np.isnan(near).any() else None


def alphabetical(pair: Pair) -> Pair:
    """Return a pair with its labels in alphabetical order."""
    return (min(pair), max(pair))

"""Padding: recording programs and filters that need what was before the first or after the last sample write that
sample again; nothing was measured there.
"""

import numpy as np

from biodance.lab.c3d.raw import RawC3d
from biodance.records import Array, Markers, Mask

_FEWEST = 5
"""Equal samples in a row that are no chance: where each of six channels repeats its number half of the time, as a
coarse converter does at rest, all of them repeat it four times in six of a hundred million rows.
"""


def padded_samples(raw: RawC3d, markers: Markers | None) -> Mask:
    """Return (S,) True for the samples at the start and the end of a recording in which all channels repeat the first
    or the last measured one to the last digit, though the markers go on.

    Channels that never change say nothing; what is zero on all others is a plate that was set to zero while unloaded.
    A recording that repeats one sample from start to end was computed, not padded.
    """
    padded = np.zeros(len(raw.analog), dtype=bool)
    live = raw.analog[:, (raw.analog != raw.analog[:1]).any(axis=0)] if len(raw.analog) else raw.analog
    if not live.size:
        return padded
    first, last = _repeats(live), _repeats(live[::-1])
    if first and _moves(markers, 0.0, first / raw.analog_rate):
        padded[:first] = True
    if last and _moves(markers, (len(live) - last) / raw.analog_rate, np.inf):
        padded[-last:] = True
    return padded


def _repeats(live: Array) -> int:
    """Return how many samples before the first measured one repeat it; 0 for too few."""
    count = int(np.argmax((live != live[0]).any(axis=1))) - 1
    return count if count + 1 >= _FEWEST and live[0].any() else 0


def _moves(markers: Markers | None, start: float, stop: float) -> bool:
    """Return whether a marker moves between two times (s from the first frame); True where nobody can tell."""
    if markers is None or markers.time.size < 2:
        return True
    time = markers.time - markers.time[0]
    first = min(int(np.searchsorted(time, start)), time.size - 2)
    some = markers.xyz[first : max(int(np.searchsorted(time, stop)), first + 1) + 1]
    return bool((np.diff(some, axis=0) != 0)[np.isfinite(np.diff(some, axis=0))].any())


def padding_said(padded: Mask, rate: float) -> str:
    """Return the sentence about padded samples (S,); "" for none."""
    first = int(np.argmin(padded)) if padded[:1].any() else 0
    last = int(np.argmin(padded[::-1])) if padded[-1:].any() else 0
    ends = [f"{end} {1000 * count / rate:.4g} ms" for end, count in (("first", first), ("last", last)) if count]
    if not ends:
        return ""
    return (
        f"The {' and the '.join(ends)} of every analog channel repeat one sample: padding by the recording program. "
        f"They were left out."
    )

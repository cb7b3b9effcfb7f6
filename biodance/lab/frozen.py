"""Frames that carry the markers of the frame before to the last digit: the recording hung, or a gap of all markers was
filled by holding them. Nobody stands so still, noise alone moves markers more, and what hangs begins or ends abruptly:
a computed movement that rests comes to it by and by.
"""

from dataclasses import replace

import numpy as np

from biodance.records import Array, Mask, Trial, runs

_FEWEST = 4
"""Markers that must be seen; fewer may rest on something, or be rounded to the same digits."""
_LASTING = 5
"""Frames in a row; shorter runs come from a slower camera whose frames were repeated."""
_ABRUPT = 0.5
"""Share of the step beside it (m a frame) that the last step before a rest or the first behind it has at least."""
_FELT = 1e-5
"""m: smaller steps are the last digits of a computed movement."""


def frozen_frames(xyz: Array) -> Mask:
    """Return (T,) True where all markers ``xyz`` (T, N, 3) m, NaN = unseen, repeat the frame before for at least five
    frames, into or out of which they move abruptly; nowhere in a recording that never moves, as a posture kept as many
    equal frames is.
    """
    seen: Mask = np.asarray(np.isfinite(xyz).all(axis=2))
    equal = np.all(xyz[1:] == xyz[:-1], axis=2) | ~(seen[1:] | seen[:-1])
    repeats = np.zeros(len(xyz), dtype=bool)
    repeats[1:] = equal.all(axis=1) & (seen[1:].sum(axis=1) >= _FEWEST)
    if repeats.sum() >= len(repeats) - 1:
        return np.zeros(len(xyz), dtype=bool)
    steps = np.zeros(len(xyz))
    steps[1:] = np.nan_to_num(np.linalg.norm(xyz[1:] - xyz[:-1], axis=2)).max(axis=1)
    for start, stop in runs(repeats):
        repeats[start:stop] = stop - start >= _LASTING and _abrupt(steps, start, stop)
    return repeats


def _abrupt(steps: Array, start: int, stop: int) -> bool:
    """Return whether the movement of ``steps`` (T,) m breaks off at frame ``start`` or sets in at ``stop`` in full."""
    before, behind = steps[max(start - 2, 0) : start], steps[stop : stop + 2]
    return any(
        pair.size == 2 and pair[near] > _FELT and pair[near] >= _ABRUPT * pair[1 - near]
        for pair, near in ((before, 1), (behind, 0))
    )


def without_frozen(trial: Trial) -> Trial:
    """Return the trial with its markers unseen where they are frozen, and a warning that says so; as it is where none
    are.
    """
    markers = trial.markers
    frozen = np.zeros(0, dtype=bool) if markers is None else frozen_frames(markers.xyz)
    if markers is None or not frozen.any():
        return trial
    xyz = np.where(frozen[:, None, None], np.nan, markers.xyz)
    spans = [f"{markers.time[start]:.2f} to {markers.time[stop - 1]:.2f} s" for start, stop in runs(frozen)]
    said = ", ".join(spans[:3]) + (f" and {len(spans) - 3} times more" if len(spans) > 3 else "")
    warning = (
        f"All markers stand still to the last digit at {said}: the recording hung, or a gap was filled by holding "
        f"them. These {int(frozen.sum())} frames count as not seen."
    )
    return replace(trial, markers=replace(markers, xyz=xyz), warnings=(*trial.warnings, warning))

"""Gaps in marker trajectories: report them, bridge the short ones, fill from the rigid segment, leave the rest. Nothing
is extrapolated.

- Short: a cubic spline between the two ends, whose positions and slopes come from a parabola through the last six
  frames on each side.
- Longer: the other markers of the same segment carry the marker across. Those are chosen whose distance to it hardly
  changes in the recording; the prediction from the frame before the gap and that from the frame after it are blended
  (Kabsch 1976, doi:10.1107/S0567739476001873, for the rotation).
- Whatever is left stays NaN: the kinematics give it no weight.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biodance.records import Array, Markers, longest_run, runs
from biodance.spatial import rigid_fit

_FLANK = 6
"""Seen frames that each side of a short gap must have."""
_CARRIERS = 5
"""At most so many neighbours carry a marker across a gap; at least three are needed."""
_RIGID = 0.01
"""m: a neighbour carries a marker if their distance has a smaller standard deviation than this."""
_OFF_LINE = 0.01
"""m: so far from one line the neighbours must lie to fix a rotation."""
_CLOSURE = 0.02
"""m: the neighbours must predict the marker across the gap to this, or it is left unseen."""


@dataclass(frozen=True)
class MarkerGaps:
    """How often a marker was not seen: ``percent`` of all frames, ``longest`` gap in s (the ends of the recording
    count).
    """

    label: str
    percent: float
    longest: float


@dataclass(frozen=True)
class Gap:
    """Frames ``start`` to ``stop`` (excluded) of one marker that were not seen; ``how`` it was dealt with, one plain
    sentence.
    """

    label: str
    start: int
    stop: int
    how: str = ""


def unseen_at_origin(xyz: Array) -> tuple[Array, tuple[str, ...]]:
    """Return samples (T, K, 3) with NaN where all three coordinates are exactly zero, as many programs write a marker
    that was not seen, and how many there were in a sentence; nothing is said where there were none.
    """
    zero = (xyz == 0).all(axis=2)
    if not zero.any():
        return xyz, ()
    said = f"{int(zero.sum())} of {zero.size} samples of markers are (0, 0, 0): they count as not seen."
    return np.where(zero[:, :, None], np.nan, xyz), (said,)


def report_gaps(markers: Markers) -> tuple[MarkerGaps, ...]:
    """Return percentage and longest gap of every marker, in the order of ``markers``."""
    step = 1 / markers.rate if markers.time.size > 1 else 0.0
    found = []
    for label, hidden in zip(markers.names, ~markers.seen.T, strict=True):
        start, stop = longest_run(hidden)
        found.append(MarkerGaps(label, 100.0 * float(np.mean(hidden)) if hidden.size else 0.0, (stop - start) * step))
    return tuple(found)


def fill_gaps(markers: Markers, segments: Mapping[str, str], *, short: float = 0.2) -> tuple[Markers, tuple[Gap, ...]]:
    """Return the markers with their gaps filled where that is safe, and every gap with the way it was dealt with.

    ``segments`` label -> segment; markers without one are only bridged. Gaps up to ``short`` s are bridged by a spline,
    longer ones and those without six seen frames on both sides are filled from at least three other markers of the
    segment that were seen throughout.
    """
    hidden = {label: runs(~seen) for label, seen in zip(markers.names, markers.seen.T, strict=True)}
    if not any(map(len, hidden.values())):
        return markers, ()
    xyz = markers.xyz.copy()
    gaps: list[Gap] = []
    later: list[Gap] = []
    for column, (label, found) in enumerate(hidden.items()):
        for start, stop in found:
            is_short = stop - start <= short * markers.rate + 1e-9
            bridge = _bridge(markers.time, markers.xyz[:, column], start, stop) if is_short else None
            if bridge is None:
                later.append(Gap(label, start, stop))
            else:
                xyz[start:stop, column] = bridge
                gaps.append(Gap(label, start, stop, "bridged by a spline"))
    xyz.setflags(write=False)  # the record keeps it without a copy
    bridged = Markers(markers.names, markers.time, xyz, _filled(markers, xyz))
    if not later:
        return bridged, tuple(gaps)
    xyz = xyz.copy()
    for gap in later:
        carried, how = _carry(bridged, gap, segments)
        if carried is not None:
            xyz[gap.start : gap.stop, markers.names.index(gap.label)] = carried
        gaps.append(Gap(gap.label, gap.start, gap.stop, how))
    xyz.setflags(write=False)
    return Markers(markers.names, markers.time, xyz, _filled(markers, xyz)), tuple(gaps)


def _filled(markers: Markers, xyz: Array) -> NDArray[np.bool_]:
    """Return (T, K) where places ``xyz`` are known that the ``markers`` as recorded do not show."""
    return np.asarray(~markers.seen & np.isfinite(xyz).all(axis=2))


def _bridge(time: Array, xyz: Array, start: int, stop: int) -> Array | None:
    """Return the spline over one gap of one marker (T, 3); None where a side has fewer than FLANK seen frames."""
    from scipy.interpolate import CubicHermiteSpline

    before, after = slice(start - _FLANK, start), slice(stop, stop + _FLANK)
    if start < _FLANK or stop + _FLANK > len(time) or np.isnan(xyz[before]).any() or np.isnan(xyz[after]).any():
        return None
    ends = []
    for side, edge in ((before, start - 1), (after, stop)):
        offset = time[side] - time[edge]
        powers = np.stack([np.ones(_FLANK), offset, offset**2], axis=1)
        place, slope, _ = np.linalg.lstsq(powers, xyz[side], rcond=None)[0]
        ends.append((time[edge], place, slope))
    knots, places, slopes = zip(*ends, strict=True)
    return CubicHermiteSpline(knots, places, slopes)(time[start:stop])


def _carry(markers: Markers, gap: Gap, segments: Mapping[str, str]) -> tuple[Array | None, str]:
    """Return the positions (n, 3) of a marker over its gap from its segment, or None; and how, or why not."""
    if gap.start == 0 or gap.stop == markers.time.size:
        return None, "left unseen: it reaches the end of the recording, and nothing is extrapolated"
    carriers = _carriers(markers, gap, segments)
    if len(carriers) < 3:
        return None, "left unseen: fewer than three markers that keep their distance to it were seen throughout"
    span = slice(gap.start - 1, gap.stop + 1)
    others, own = np.stack([markers[label][span] for label in carriers], axis=1), markers[gap.label][span]
    ways = ((rigid_fit(others[edge], others), own[edge]) for edge in (0, -1))
    forward, backward = (turn @ point + place for (turn, place), point in ways)
    closure = max(np.linalg.norm(forward[-1] - own[-1]), np.linalg.norm(backward[0] - own[0]))
    if closure > _CLOSURE:
        error = f"with an error of {1000 * closure:.0f} mm across the gap"
        return None, f"left unseen: {', '.join(carriers)} predict it {error}"
    part = np.linspace(0.0, 1.0, len(own))[:, None]
    blend = (1 - part) * forward + part * backward
    return blend[1:-1], f"filled from {', '.join(carriers)} ({1000 * closure:.0f} mm off across the gap)"


def _carriers(markers: Markers, gap: Gap, segments: Mapping[str, str]) -> list[str]:
    """Return the labels of the segment, seen throughout, whose distance to the marker varies least."""
    own = markers[gap.label]
    spread = {}
    for label in markers.names:
        same = label != gap.label and label in segments and segments[label] == segments.get(gap.label)
        if same and not np.isnan(markers[label][gap.start - 1 : gap.stop + 1]).any():
            distance = np.linalg.norm(markers[label] - own, axis=1)
            spread[label] = float(np.nanstd(distance))
    rigid = sorted((label for label, value in spread.items() if value < _RIGID), key=spread.__getitem__)[:_CARRIERS]
    if len(rigid) < 3:
        return []
    points = np.stack([markers[label][gap.start - 1] for label in rigid])
    from_a_line = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1]
    return rigid if from_a_line > _OFF_LINE else []

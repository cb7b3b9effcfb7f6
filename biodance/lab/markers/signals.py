"""What a marker on a person cannot do: stand still to the last bit while the others move, or jump away and back within
three frames. Such frames count as not seen; gaps are reported and filled.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from biodance.records import Array, Markers, Mask, Trial, any_coordinate, lengths_of, longest_run, runs
from biodance.spatial import rigid_fit

_REPEATS = 5
"""Frames that repeat the one before to the last bit. In 62 trials of 14 laboratories no marker of somebody who moves
does so four times in a row: cameras see 0.01 to 0.5 mm of noise.
"""
_LONGEST = 3  # Frames of a spike at most; what lasts longer may be another marker


class MarkerFault(Enum):
    """What a marker does that nobody can."""

    FROZEN = "frozen"
    SPIKE = "spike"


@dataclass(frozen=True)
class FaultyMarker:
    """A marker ``label`` with its ``fault`` in frames ``spans`` (start, stop), stop excluded; ``size`` m how far it is
    off at most (NaN where nobody knows).
    """

    label: str
    fault: MarkerFault
    spans: tuple[tuple[int, int], ...]
    size: float

    def when(self, time: Array) -> str:
        """Return the seconds of its frames among ``time`` (T,) s in words."""
        long = self.fault is MarkerFault.FROZEN
        at = [f"{time[start]:.2f}" + f" to {time[stop - 1]:.2f}" * long for start, stop in self.spans]
        return ", ".join(at[:8]) + (f" and {len(at) - 8} times more" if len(at) > 8 else "") + " s"

    def sentence(self, where: str) -> str:
        """Return what was seen ``where`` (trials and seconds in words)."""
        if self.fault is MarkerFault.FROZEN:
            seen = (
                f"stands still to the last bit while the others move: {where}. A gap was filled by holding the marker"
            )
        else:
            seen = (
                f"jumps by up to {1000 * self.size:.0f} mm and back within {_LONGEST} frames: {where}. No body does so"
            )
        return f"{self.label} {seen}; these frames count as not seen."


def faulty_markers(markers: Markers) -> tuple[FaultyMarker, ...]:
    """Return the markers that stand still to the last bit while the others move, and those that jump."""
    frozen = _frozen(markers.xyz)
    clean = np.where(frozen[:, :, None], np.nan, markers.xyz)
    found = [
        FaultyMarker(label, MarkerFault.FROZEN, tuple(runs(frozen[:, k])), float("nan"))
        for k, label in enumerate(markers.names)
    ]
    step = 1 / markers.rate if markers.time.size > 1 else np.nan
    off = [_off_its_way(clean, frames)[0].max(axis=0, initial=0.0) for frames in range(1, _LONGEST + 1)]
    for k in np.flatnonzero(np.max(off, axis=0) > _limit(step)):
        jumps, size = _spikes(clean[:, k], step)
        found.append(FaultyMarker(markers.names[k], MarkerFault.SPIKE, tuple(runs(jumps)), size))
    return tuple(one for one in found if one.spans)


def without_faults(markers: Markers, faults: tuple[FaultyMarker, ...]) -> Markers:
    """Return the markers unseen in the frames of their ``faults``."""
    if not faults:
        return markers
    xyz = markers.xyz.copy()
    for one in faults:
        for start, stop in one.spans:
            xyz[start:stop, markers.names.index(one.label)] = np.nan
    xyz.setflags(write=False)  # the record keeps it without a copy
    return Markers(markers.names, markers.time, xyz)


def frozen_frames(xyz: Array) -> Mask:
    """Return (T,) True where all markers ``xyz`` (T, N, 3) m, NaN = unseen, repeat the frame before for at least five
    frames, into or out of which they move abruptly; nowhere in a recording that never moves, as a posture kept as many
    equal frames is.

    The recording hung, or a gap of all markers was filled by holding them. Nobody stands so still, noise alone moves
    markers more, and what hangs begins or ends abruptly: a computed movement that rests comes to it by and by. Shorter
    runs come from a slower camera whose frames were repeated.
    """
    seen = ~any_coordinate(~np.isfinite(xyz))
    equal = ~any_coordinate(xyz[1:] != xyz[:-1]) | ~(seen[1:] | seen[:-1])
    repeats = np.zeros(len(xyz), dtype=bool)
    # Fewer than four markers may rest on something, or be rounded to the same digits.
    repeats[1:] = equal.all(axis=1) & (seen[1:].sum(axis=1) >= 4)
    if not repeats.any() or repeats.sum() >= len(repeats) - 1:
        return np.zeros(len(xyz), dtype=bool)
    steps = np.zeros(len(xyz))
    steps[1:] = np.nan_to_num(np.linalg.norm(xyz[1:] - xyz[:-1], axis=2)).max(axis=1)
    for start, stop in runs(repeats):
        repeats[start:stop] = stop - start >= _REPEATS and _breaks_off(steps, start, stop)
    return repeats


def without_frozen(trial: Trial) -> Trial:
    """Return the trial with its markers unseen where they are frozen, and a warning that says so."""
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


def _frozen(xyz: Array) -> Mask:
    """Return (T, K) where markers ``xyz`` (T, K, 3) repeat the frame before while the others move."""
    frozen = np.zeros(xyz.shape[:2], dtype=bool)
    if len(xyz) < 2:
        return frozen
    repeats = np.zeros_like(frozen)
    repeats[1:] = (xyz[1:] == xyz[:-1]).all(axis=2)
    for k in np.flatnonzero(repeats.sum(axis=0) >= _REPEATS):
        steps = np.linalg.norm(np.diff(xyz[:, k], axis=0, prepend=np.nan), axis=1)
        for start, stop in runs(repeats[:, k]):
            if stop - start >= _REPEATS and _breaks_off(steps, start, stop):
                # the markers that do not repeat themselves too must move meanwhile
                others = repeats[start:stop].mean(axis=0) < 0.5
                with np.errstate(invalid="ignore"):
                    away = np.linalg.norm(xyz[start:stop, others] - xyz[start - 1, others], axis=2)
                farthest = np.nan_to_num(away).max(axis=0, initial=0.0)
                # By more than the coarsest numbers of a file hide (0.5 mm), and than somebody who stands sways.
                frozen[start:stop, k] = bool(farthest.size) and float(np.median(farthest)) > 0.01
    return frozen


def _breaks_off(steps: Array, start: int, stop: int) -> bool:
    """Return whether ``steps`` (T,) m a frame break off before ``start`` or set in at ``stop`` in full."""
    # Before the stretch its steps in reverse, behind it in order.
    for near, far, farther in ((start - 1, start - 2, start - 3), (stop, stop + 1, stop + 2)):
        if min(near, far) >= 0 and max(near, far) < steps.size:
            slower_yet = not 0 <= farther < steps.size or steps[far] < steps[farther]
            # 1e-5 m: smaller steps are the last digits of a computed movement, which comes to rest by and by
            if steps[near] > 1e-5 and not (steps[near] < 0.5 * steps[far] and slower_yet):
                return True
    return False


def _off_its_way(xyz: Array, frames: int) -> tuple[Array, Array]:
    """Return (T, ...) m how far ``frames`` frames from each one on are off their way, the least of them: from the cubic
    through the two frames before and the two behind, and from the line between the next ones; 0 where neither of these
    sides leads to the other as well. And by how much (T, ...) m a side may miss the other.
    """
    off, missed = np.zeros((2, *xyz.shape[:-1]))
    count = len(xyz) - frames - 3
    if count < 1:
        return off, missed
    places = np.array([-2.0, -1.0, frames, frames + 1.0])
    a, b, c, d = (xyz[at : at + count] for at in (0, 1, frames + 2, frames + 3))
    least = np.full(a.shape[:-1], np.inf)
    for k in range(frames):
        # Lagrange's weights of the cubic through the four places, at k
        weight = [np.prod((k - places[places != one]) / (one - places[places != one])) for one in places]
        way = weight[0] * a + weight[1] * b + weight[2] * c + weight[3] * d
        line = b + (k + 1) / (frames + 1) * (c - b)
        for expected in (line, np.where(np.isnan(way), line, way)):
            least = np.minimum(least, lengths_of(xyz[2 + k : 2 + k + count] - expected))
    # Straight on from either side: how far it misses the other one.
    forth, back = (
        lengths_of(near + (frames + 1) * (near - far) - other) for near, far, other in ((b, a, c), (c, d, b))
    )
    with np.errstate(invalid="ignore"):
        off[2 : 2 + count] = np.where(least > np.fmin(forth, back), least, 0.0)
    missed[2 : 2 + count] = np.fmax(forth, back)
    return off, missed


def _limit(step: float) -> float:
    """Return how far (m) a marker must be off its way, for frames every ``step`` s: what skin, wands and heads of
    markers cannot swing (4 to 9 mm after heel strikes of running at 2.5 and 3.5 m/s, 10 people, 150 Hz; 16 mm at most
    in runs, drop jumps and squats of 14 laboratories), and what needs ten times gravity from one frame to the next.
    """
    # A change a of acceleration moves a marker by about a dt². What limbs do below 100 m/s² shows in the frames on
    # both sides; impacts reach 200, but move a marker by millimetres.
    return max(0.03, 100.0 * step**2)


def _spikes(path: Array, step: float) -> tuple[Mask, float]:
    """Return (T,) where a marker's ``path`` (T, 3) jumps, the clearest taken out first, and how far at most."""
    path, spiky, farthest = path.copy(), np.zeros(len(path), dtype=bool), 0.0
    while True:
        found = [_off_its_way(path, frames) for frames in range(1, _LONGEST + 1)]
        off = np.array([one for one, _ in found])
        # Clearest first: how far off beyond what the sides themselves miss.
        clear = np.where(off > _limit(step), off - [missed for _, missed in found], -np.inf)
        if not np.isfinite(clear).any():
            return spiky, farthest
        shorter, at = np.unravel_index(int(np.argmax(clear)), clear.shape)
        frames = slice(int(at), int(at) + int(shorter) + 1)
        farthest = max(farthest, float(off[shorter, at]))
        spiky[frames], path[frames] = True, np.nan


# Gaps in marker trajectories: report them, bridge the short ones, fill from the rigid segment, leave the rest. Nothing
# is extrapolated.
#
# - Short: a cubic spline between the two ends, whose positions and slopes come from a parabola through the last six
#   frames on each side.
# - Longer: the other markers of the same segment carry the marker across. Those are chosen whose distance to it hardly
#   changes in the recording; the prediction from the frame before the gap and that from the frame after it are blended
#   (Kabsch 1976, doi:10.1107/S0567739476001873, for the rotation).
# - Whatever is left stays NaN: the kinematics give it no weight.

_FLANK = 6  # Seen frames that each side of a short gap must have


@dataclass(frozen=True)
class MarkerGaps:
    """How often a marker was not seen: ``percent`` of all frames, ``longest`` gap in s (ends count)."""

    label: str
    percent: float
    longest: float


BRIDGED = "bridged by a spline"
"""How a short gap was dealt with."""


@dataclass(frozen=True)
class Gap:
    """Frames ``start`` to ``stop`` (excluded) of a marker that were not seen; ``how`` it was dealt with."""

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
                gaps.append(Gap(label, start, stop, BRIDGED))
    xyz.setflags(write=False)  # the record keeps it without a copy
    bridged = Markers(markers.names, markers.time, xyz, _filled(markers, xyz))
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
        # Parabola about the edge: its first two coefficients are place and slope there.
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
    # Rigid motion of the carriers from one edge to every frame.
    ways = ((rigid_fit(others[edge], others), own[edge]) for edge in (0, -1))
    forward, backward = (turn @ point + place for (turn, place), point in ways)
    closure = max(np.linalg.norm(forward[-1] - own[-1]), np.linalg.norm(backward[0] - own[0]))
    if closure > 0.02:
        error = f"with an error of {1000 * closure:.0f} mm across the gap"
        return None, f"left unseen: {', '.join(carriers)} predict it {error}"
    # Linear blend: each prediction is exact at its own edge.
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
    # The five whose distance varies least, by less than 0.01 m; at least three are needed.
    rigid = sorted((label for label, value in spread.items() if value < 0.01), key=spread.__getitem__)[:5]
    if len(rigid) < 3:
        return []
    points = np.stack([markers[label][gap.start - 1] for label in rigid])
    # Second singular value: spread beside the best line; on a line the turn about it is not told.
    from_a_line = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1]
    # 0.01 m: so far from one line the neighbours must lie to fix a rotation
    return rigid if from_a_line > 0.01 else []

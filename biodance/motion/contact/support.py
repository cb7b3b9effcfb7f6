"""Frames in which nothing carries the person, and frames in which something else does: what markers and weight tell of
them.
"""

import numpy as np

from biodance.lab.markers.sets import read_marker_set
from biodance.records import Array, Mask, Trial, runs

_SHORTEST_FLIGHT = 0.05
"""s: in less the parabola of the markers cannot be seen."""
_FALLS = 0.6
"""Downward acceleration, in g, from which the markers fall freely. Whatever carries somebody makes the fall slower; the
swing of the limbs leaves 0.95 to 1.1 for the mean of markers all over the body, 0.97 to 1.45 for those of the pelvis
(legs that swing up push it down), which runners marked on the legs alone need: the mean of their markers is the legs'.
"""
_PARABOLA = 0.005
"""m, RMS, by which the mean of the markers may leave the parabola (limbs move)."""
_STILL = 0.05
"""m/s: the mean of the markers of somebody who sits or stands still is slower ..."""
_LASTING = 0.4
"""s: ... for this long."""
_CARRIED = (0.25, 0.75)
"""Share of the weight on the plates between which somebody who is still is carried by something else, too."""
_WHOLE = 0.9
"""Share of the weight from which on nothing else carries."""
_UNITS = (0.45359237,)
"""Shares that a wrong unit explains (pounds for kilograms) ..."""
_NEAR = 0.03
"""... within this."""


def flight(trial: Trial, touching: Mask, load: Mask) -> Mask:
    """Return (T,) where the person flies: no plate is loaded and the markers fall freely, for as long as no foot may
    touch, or for as long as no plate is loaded (the foot that has just left a belt is low and slow).

    ``touching`` (T, 2), ``load`` (T, P). The plates then measure all that the ground does: nothing.
    """
    found = np.zeros(len(touching), dtype=bool)
    unloaded = np.logical_not(load.any(axis=1))
    for free in (unloaded, unloaded & np.logical_not(touching.any(axis=1))):
        for start, stop in runs(free):
            if not found[start] and _falls(trial, start, stop):
                found[start:stop] = True
    return found


def _falls(trial: Trial, start: int, stop: int) -> bool:
    """Return whether the markers of the body, or those of the pelvis, fall freely from frame ``start`` to before
    ``stop``: their mean on a parabola of about one g.
    """
    if trial.markers is None or trial.markers.time.size < 2:
        return False
    span = slice(max(0, start - 1), min(trial.markers.time.size, stop + 1))
    time, height = trial.markers.time[span], trial.markers.xyz[span, :, 2]
    whole = np.isfinite(height).all(axis=0)
    if time[-1] - time[0] < _SHORTEST_FLIGHT or time.size < 4:
        return False
    own = read_marker_set(trial.marker_set).markers if trial.marker_set else ()
    pelvis = np.isin(trial.markers.names, [one.label for one in own if one.segment == "pelvis"])
    parts = [height[:, some].mean(axis=1) for some in (whole, whole & pelvis) if some.any()]
    return any(_is_free_fall(time, mean, trial.settings.gravity) for mean in parts)


def _is_free_fall(time: Array, height: Array, gravity: float) -> bool:
    middle = time - time.mean()
    curve = np.polyfit(middle, height, 2)
    straight = np.sqrt(np.mean((np.polyval(curve, middle) - height) ** 2)) < _PARABOLA
    return bool(straight and -2 * curve[0] >= _FALLS * gravity)


def carried_elsewhere(trial: Trial, *, weight: float) -> Mask:
    """Return (T,) where something beside the plates carries a good part of the ``weight`` (N; NaN = unknown, then
    nowhere): a chair, a rail.

    The person is still and the plates carry clearly less than the weight, and nobody's unit explains it; the frames
    around until they carry it all count, too.
    """
    markers, total = trial.markers, trial.wrench.force[:, 2]
    found = np.zeros(total.size, dtype=bool)
    if markers is None or markers.time.size < 2 or not weight > 0:
        return found
    speed = _mean_speed(markers.time, markers.xyz)
    share = np.nan_to_num(total / weight, nan=1.0)
    least = _LASTING / float(np.median(np.diff(markers.time)))
    for start, stop in runs((speed < _STILL) & (_CARRIED[0] < share) & (share < _CARRIED[1])):
        level = float(share[start:stop].mean())
        if stop - start < least or any(abs(level - unit) < _NEAR for unit in _UNITS):
            continue
        for first, last in runs(share < _WHOLE):
            if first < stop and start < last:
                found[first:last] = True
    return found


def _mean_speed(time: Array, xyz: Array) -> Array:
    """Return the speed (T,) m/s of the mean of the markers that are seen throughout; infinite without one."""
    whole: Mask = np.asarray(np.isfinite(xyz).all(axis=(0, 2)))
    if not whole.any():
        return np.full(time.size, np.inf)
    seen = xyz if whole.all() else xyz[:, whole]
    middle = np.einsum("tki->ti", seen) / seen.shape[1]  # a tenth of the time of mean(axis=1, where=...)
    return np.asarray(np.linalg.norm(np.gradient(middle, time, axis=0), axis=1))

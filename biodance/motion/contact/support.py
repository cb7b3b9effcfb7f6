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
_LACKS, _ENDS = 0.15, 0.05
"""Share of the weight that the plates lack while something else carries, and under which it has ended. In clean squats
and walks they lack less for more than half of `_LASTING`."""
_LASTING = 0.4
"""s, at least, that something else carries: delays and impacts are over sooner."""
_PLAIN = 1.0
"""s of other times that must agree: a trunk goes otherwise than the whole body for as long as one bend lasts."""
_RIGHT = 0.1
"""Share of the weight, RMS, within which plates and movement agree at all other times. A late clock, a wrong gain or
mass is wrong then, too: what carries only at times takes away only at times."""
_SMOOTH = 0.3
"""s of the parabola whose curvature is the acceleration: 1 mm of noise in the mean of the markers is 0.02 g."""


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
    parts = [height[:, some].mean(axis=1) for some in (whole, whole & _on(trial, "pelvis")) if some.any()]
    return any(_is_free_fall(time, mean, trial.settings.gravity) for mean in parts)


def _is_free_fall(time: Array, height: Array, gravity: float) -> bool:
    middle = time - time.mean()
    curve = np.polyfit(middle, height, 2)
    straight = np.sqrt(np.mean((np.polyval(curve, middle) - height) ** 2)) < _PARABOLA
    return bool(straight and -2 * curve[0] >= _FALLS * gravity)


def carried_elsewhere(trial: Trial, *, weight: float) -> Mask:
    """Return (T,) where something beside the plates carries a good part of the ``weight`` (N; NaN = unknown, then
    nowhere): a chair, a rail.

    By Newton the ground carries weight (1 + a / g), with a the vertical acceleration of pelvis and trunk. Where the
    plates lack a good part of it for a while, and nothing of it at all other times, something else carries.
    """
    from scipy.ndimage import uniform_filter1d

    lacks = share_lacking(trial, weight=weight)
    found = np.zeros(lacks.size, dtype=bool)
    if not lacks.any() or trial.markers is None:
        return found
    step = float(np.median(np.diff(trial.markers.time)))
    smooth = uniform_filter1d(lacks, max(1, round(_SMOOTH / step / 2)))
    long = [(start, stop) for start, stop in runs(smooth > _LACKS) if stop - start >= _LASTING / step]
    for first, last in runs(lacks > _ENDS):
        found[first:last] = any(first < stop and start < last for start, stop in long)
    rest = smooth[~found]
    return found & (rest.size >= _PLAIN / step and float(np.sqrt(np.mean(rest**2))) < _RIGHT)


def share_lacking(trial: Trial, *, weight: float) -> Array:
    """Return (T,) which share of the ``weight`` N the plates lack of what pelvis and trunk (else all markers) need to
    move as they do; zero where nothing tells it: no markers or weight, forces that are unknown.
    """
    from scipy.signal import savgol_filter

    total, markers = trial.wrench.force[:, 2], trial.markers
    if markers is None or not weight > 0 or markers.time.size != total.size or total.size < 2:
        return np.zeros(total.size)
    step = float(np.median(np.diff(markers.time)))
    frames = 2 * max(2, round(_SMOOTH / step / 2)) + 1
    whole: Mask = np.asarray(np.isfinite(markers.xyz).all(axis=(0, 2)))
    trunk = whole & _on(trial, "pelvis", "trunk_head")
    if not whole.any() or total.size < frames:
        return np.zeros(total.size)
    height = markers.xyz[:, trunk if trunk.any() else whole, 2].mean(axis=1)
    needed = 1 + savgol_filter(height, frames, 2, deriv=2, delta=step) / trial.settings.gravity
    return np.nan_to_num(needed - total / weight)


def _on(trial: Trial, *segments: str) -> Mask:
    """Return (K,) which markers of a trial sit on ``segments``, as far as its set tells."""
    own = read_marker_set(trial.marker_set).markers if trial.marker_set else ()
    names = () if trial.markers is None else trial.markers.names
    return np.isin(names, [one.label for one in own if one.segment in segments])

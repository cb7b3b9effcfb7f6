"""How tall somebody is by the markers of a static trial: pooled heights over the ankles, so that shoes do not count."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from biodance.lab.markers.sets import landmark, read_marker_set
from biodance.records import SIDES, Array, Markers, Trial

_SHARES = {
    ("head_front", "head_back"): ("the head markers", 0.897, 0.009),
    ("jugular_notch",): ("the jugular notch", 0.760, 0.013),
    ("c7",): ("C7", 0.798, 0.015),
    ("right_acromion", "left_acromion"): ("the acromia", 0.766, 0.014),
    ("right_asis", "left_asis"): ("the anterior iliac spines", 0.515, 0.029),
    ("right_knee_lateral", "left_knee_lateral"): ("the knees", 0.240, 0.039),
}
"""Landmarks with their name, their height over the lateral ankle markers as a share of the declared stature, and the
standard deviation of that share as a part of it, the surest first.

Measured on 25 people of 1.33 to 1.86 m in 8 laboratories, whose differences count (random effects; DerSimonian and
Laird 1986, doi:10.1016/0197-2456(86)90046-2): knees on 22, iliac spines 25, acromia 11, notch and C7 12, head 10.
"""
_WALKING, _WALKING_SD = 0.018, 0.013
"""Share of the stature by which somebody who moves is lower at the highest, and its standard deviation: the tallest
trial of 12 people of 9 laboratories (walks, squats, marching) against their static trial, -3.9 to -0.1 %.
"""
_DOWN, _SINKS = 0.03, 0.02
"""m of an ankle over its lowest place (5th percentile), and of the iliac spines under their highest (95th), up to which
both feet are on the ground and the person is upright."""
_UPRIGHT = 10
"""Frames of that at least: on stairs both ankles are hardly ever low."""
_ALIKE = 0.4
"""Correlation of the shares of two landmarks, the mean over the pairs: long legs lift all of them."""
_RISE = 0.026
"""Share of the stature by which acromion markers rise with arms lifted by 90 degrees (45 mm at 1.75 m), in proportion
to the angle and known to half; measured on 7 people with arms out and 6 with arms down.
"""
_LIFTED = 45.0
"""Degrees of arms that have no marker at the elbow."""


def stature_of_markers(trial: Trial) -> tuple[float, float, str]:
    """Return the stature (m) of a standing person, its standard deviation (m) and of which markers it was told; NaN
    and "" where ankles or all else were not recorded.

    The mean of what each landmark tells, ``height over the ankles / share``, weighted by its precision; the standard
    deviation has the correlation of the landmarks in it. Left out one by one, the 25 people are told to 2.1 % (RMS),
    the 12 with markers of the upper trunk to 1.0 %.
    """
    at = _places(trial)
    ankles = _mean(at, tuple(f"{side}_ankle_lateral" for side in SIDES))
    rise, doubt = _shoulder_rise(at)
    told, spread, names = [], [], []
    for landmarks, (name, share, sd) in _SHARES.items():
        height = _mean(at, landmarks)[2] - ankles[2]
        if math.isfinite(height) and height > 0:
            lifted = landmarks[0].endswith("acromion")
            told.append(height / (share + rise * lifted))
            spread.append(math.hypot(sd, doubt / share * lifted))
            names.append(name)
    if not told:
        return math.nan, math.nan, ""
    sds = np.array(spread)
    weight = sds**-2 / (sds**-2).sum()
    covariance = np.outer(sds, sds) * (_ALIKE + (1 - _ALIKE) * np.eye(len(sds)))
    stature = float(weight @ told)
    return stature, stature * float(np.sqrt(weight @ covariance @ weight)), ", ".join(names)


def stature_of_movement(trial: Trial) -> tuple[float, float, str]:
    """Return the stature (m), its standard deviation (m) and of which markers it was told, as `stature_of_markers`, of
    somebody who moves: while both ankles are low and the iliac spines high; NaN and "" where that is never seen.
    """
    nothing = (math.nan, math.nan, "")
    if trial.markers is None or not trial.marker_set:
        return nothing
    worn, markers = read_marker_set(trial.marker_set), trial.markers
    wanted = [landmark(markers, worn, f"{side}_{part}") for part in ("ankle_lateral", "asis") for side in SIDES]
    heights = np.array([path[:, 2] for path in wanted if path is not None])
    if len(heights) < len(wanted) or np.isnan(heights).all(axis=1).any():
        return nothing
    low, high = heights[:2], heights[2:].mean(axis=0)
    upright = (low < np.nanpercentile(low, 5, axis=1, keepdims=True) + _DOWN).all(axis=0) & np.isfinite(high)
    if upright.any():
        upright &= high > np.percentile(high[upright], 95) - _SINKS
    if upright.sum() < _UPRIGHT:
        return nothing
    standing = Markers(markers.names, markers.time[upright], markers.xyz[upright])
    stature, sd, told_by = stature_of_markers(replace(trial, markers=standing))
    return stature / (1 - _WALKING), math.hypot(sd, _WALKING_SD * stature), told_by


def _places(trial: Trial) -> Mapping[str, Array]:
    """Return the median place (3,) m of every landmark that is needed and was recorded."""
    if trial.markers is None or not trial.marker_set:
        return {}
    marker_set = read_marker_set(trial.marker_set)
    sided = [f"{side}_{part}" for side in SIDES for part in ("ankle_lateral", "elbow_lateral")]
    found = {name: landmark(trial.markers, marker_set, name) for name in (*sum(_SHARES, ()), *sided)}
    seen = {name: path[np.isfinite(path).all(axis=1)] for name, path in found.items() if path is not None}
    return {name: np.median(path, axis=0) for name, path in seen.items() if len(path)}


def _mean(at: Mapping[str, Array], landmarks: tuple[str, ...]) -> Array:
    """Return the middle (3,) m of some landmarks; NaN if one of them was not recorded."""
    return np.mean([at.get(name, np.full(3, np.nan)) for name in landmarks], axis=0)


def _shoulder_rise(at: Mapping[str, Array]) -> tuple[float, float]:
    """Return by which share of the stature lifted arms raise the acromion markers, and its standard deviation."""
    arms = [at[f"{side}_elbow_lateral"] - at[f"{side}_acromion"] for side in SIDES if _has_arm(at, side)]
    angles = [math.degrees(math.acos(float(-arm[2] / np.linalg.norm(arm)))) for arm in arms]
    rise = _RISE * (float(np.mean(angles)) if angles else _LIFTED) / 90.0
    return rise, rise / 2


def _has_arm(at: Mapping[str, Array], side: str) -> bool:
    return f"{side}_elbow_lateral" in at and f"{side}_acromion" in at

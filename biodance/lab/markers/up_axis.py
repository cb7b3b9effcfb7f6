"""Which axis of a recording is up: from the feet to the head, by labels or by the only way in which somebody stands."""

import numpy as np

from biodance.lab.markers.names import meanings, meanings_of
from biodance.lab.markers.set_file import LANDMARKS, segment_of
from biodance.lab.markers.sets import MarkerSet, landmark
from biodance.lab.markers.spelling import plain_labels
from biodance.lab.markers.still import median_places, quietest
from biodance.lab.markers.upright import bound, standing_by_points
from biodance.records import Array, Markers, spread_frames

_UPPER = ("head_front", "head_back", "c7", "jugular_notch", "mid_psis", "right_asis", "left_asis")
_LOWER = ("right_heel", "left_heel", "right_toe", "left_toe", "right_ankle_lateral", "left_ankle_lateral")
_HIGH, _DEEP = ("trunk_head", "pelvis"), ("right_foot", "left_foot", "right_shank", "left_shank")
"""Segments of the upper and of the lowest part of the body, for sets that nobody described."""
_CLEARLY_TALLER = 1.3
"""A body stands along an axis along which it is so many times as long: arms spread sideways stay below."""


def axis_to_head(markers: Markers, known: MarkerSet | None) -> Array | None:
    """Return the signed coordinate axis (3,) from the feet to the head or pelvis in most frames, by what labels say of
    high and low markers; where they say nothing, the only way up in which somebody stands. None if neither tells it.
    ``known`` is the set of the labels (`recognise`).
    """
    few = Markers(markers.names, spread_frames(markers.time), spread_frames(markers.xyz))
    ends = [
        [p for name in names if known and (p := landmark(few, known, name)) is not None] for names in (_UPPER, _LOWER)
    ]
    if not all(ends):
        # Read in the whole set or, where that says nothing, alone: sides do not matter.
        together = meanings_of(markers.names)
        said = {label: together.get(label) or meanings(label) for label in markers.names}
        on = {label: ways[0].place for label, ways in said.items() if ways}
        on = {label: segment_of(place) if place in LANDMARKS else place for label, place in on.items()}
        ends = [[few[label] for label in on if on[label] in group] for group in (_HIGH, _DEEP)]
    if not all(ends):
        return _only_way_to_stand(markers)
    top, bottom = (np.concatenate(points) for points in ends)
    if not (np.isfinite(top).any() and np.isfinite(bottom).any()):
        return None
    return clear_axis(np.nanmedian(top, axis=0) - np.nanmedian(bottom, axis=0))


def _only_way_to_stand(markers: Markers) -> Array | None:
    """Return the signed axis (3,) along which alone the points are a standing person; None if none or several are."""
    points = median_places(markers, quietest(markers))
    at = {label: points[label] for label in plain_labels(points)}
    if len(at) < bound("cloud"):
        return None
    extent = np.ptp(np.percentile(list(at.values()), (5, 95), axis=0), axis=0)
    found = []
    for up in (
        sign * np.eye(3)[k] for k in np.flatnonzero(extent > bound("tall") * extent.max()) for sign in (1.0, -1.0)
    ):
        first = np.roll(np.abs(up), 1)
        turned = np.stack([first, np.cross(up, first), up])
        if standing_by_points({label: turned @ point for label, point in at.items()}) is not None:
            found.append(up)
    return found[0] if len(found) == 1 else None


def clear_axis(direction: Array) -> Array | None:
    """Return the signed coordinate axis that a direction (3,) clearly follows; None if none or the direction is not
    finite.
    """
    size = np.sort(np.abs(direction))
    if not np.isfinite(size).all() or size[2] <= bound("clear") * size[1]:
        return None
    i = int(np.argmax(np.abs(direction)))
    axis: Array = np.eye(3)[i] * np.sign(direction[i])
    return axis


def turn_to(up: Array) -> Array:
    """Return the rotation (3, 3) whose third row is a coordinate axis ``up``; its first row is x where possible."""
    first = np.array([1.0, 0.0, 0.0]) if up[0] == 0 else np.array([0.0, 1.0, 0.0])
    return np.stack([first, np.cross(up, first), up]) + 0.0


def body_is_tall_along_z(xyz: Array) -> bool:
    """Return True if the marker cloud (T, K, 3) is clearly taller along the third axis than along the second.

    The extent is taken frame by frame and its median over time is compared, so that walking does not count as height;
    arms that are spread sideways stay below 1.3 times the stature. A single marker has no extent: the answer is then
    False.
    """
    seen = xyz[:, np.logical_not(np.isnan(xyz).all(axis=(0, 2)))]
    if seen.shape[1] < 2:
        return False
    frames = seen[np.logical_not(np.isnan(seen).any(axis=2)).sum(axis=1) >= 2]
    if not len(frames):
        return False
    extent = np.median(np.nanmax(frames, axis=1) - np.nanmin(frames, axis=1), axis=0)
    return bool(extent[2] > _CLEARLY_TALLER * extent[1])

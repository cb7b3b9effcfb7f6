"""Which way is up, by the person: the axis from the feet to the head, by what labels say of high and low markers."""

import re

import numpy as np

from biodance.lab.markers.names import meanings_of
from biodance.lab.markers.sets import landmark, recognise
from biodance.lab.markers.standing import part_of
from biodance.records import Array, Markers

UPPER = ("head_front", "head_back", "c7", "jugular_notch", "mid_psis", "right_asis", "left_asis")
LOWER = ("right_heel", "left_heel", "right_toe", "left_toe", "right_ankle_lateral", "left_ankle_lateral")
_HIGH = re.compile(
    r"head|[fb]hd|^hd|nasion|sellion|c7|clav|acr|sho(u|$)|asis?$|psis?$|[_.]?i[ap]s$|sacr", re.IGNORECASE
)
_DEEP = re.compile(r"hee|calc|cal[0-9]?$|toe|hallux|ank|mal|mt[p0-9]|foot|^[lr][lm]m$|f[cm][ac]|fm[125]", re.IGNORECASE)
"""What labels of the upper and of the lowest part of the body are called in sets that nobody described."""
_HIGH_PARTS = (
    "asis",
    "psis",
    "mid_psis",
    "acromion",
    "c7",
    "t10",
    "jugular_notch",
    "xiphoid",
    "head_front",
    "head_back",
)
_DEEP_PARTS = ("heel", "toe", "toe_lateral", "toe_medial", "ankle_lateral", "ankle_medial", "foot")
_CLEAR = 2.0
"""A direction counts if its largest component is so many times the others."""


def axis_to_head(markers: Markers) -> Array | None:
    """Return the signed coordinate axis (3,) from the feet to the head or pelvis in most frames; None if the labels or
    the posture do not tell it.
    """
    known = recognise(markers.names)
    ends = [
        [p for name in names if known and (p := landmark(markers, known, name)) is not None] for names in (UPPER, LOWER)
    ]
    if not all(ends):
        parts = {label: part_of(found[0].place) for label, found in meanings_of(markers.names).items()}
        ends = [[markers[label] for label in parts if parts[label] in group] for group in (_HIGH_PARTS, _DEEP_PARTS)]
    if not all(ends):
        ends = [[markers[name] for name in markers.names if words.search(name)] for words in (_HIGH, _DEEP)]
    if not all(ends):
        return None
    top, bottom = (np.concatenate(points) for points in ends)
    if not (np.isfinite(top).any() and np.isfinite(bottom).any()):
        return None
    return clear_axis(np.nanmedian(top, axis=0) - np.nanmedian(bottom, axis=0))


def clear_axis(direction: Array) -> Array | None:
    """Return the signed coordinate axis that a direction (3,) clearly follows; None if none or the direction is not
    finite.
    """
    size = np.sort(np.abs(direction))
    if not np.isfinite(size).all() or size[2] <= _CLEAR * size[1]:
        return None
    i = int(np.argmax(np.abs(direction)))
    axis: Array = np.eye(3)[i] * np.sign(direction[i])
    return axis

"""Which side of the body a marker lies on, and which of two lies in front, judged by pelvis and trunk: feet step and
arms swing, and cross the middle.
"""

import numpy as np

from biodance.lab.markers.sets import MarkerSet, landmark
from biodance.records import Array, Markers, Mask

_ASIDE = 0.02
"""m by which a left marker must lie to the right of its right partner, or a front one behind its back one."""
_ENDS = (("FHD", "BHD"), ("ASI", "PSI"), ("TOE", "HEE"))
"""Stems of labels in front and behind of the same bone."""
_ACROSS = ("asis", "psis", "acromion", "knee_lateral")
"""Landmarks of both sides, and (`_AHEAD`) of front and back, that point to the right of the body: each is one vote, so
that one exchanged pair does not turn it.
"""
_AHEAD = (("jugular_notch", "c7"), ("xiphoid", "t10"))


def rightwards(markers: Markers, marker_set: MarkerSet) -> Array:
    """Return the horizontal unit vector (T, 3) to the right of the body; NaN where pelvis and trunk do not show it."""

    def at(place: str) -> Array:
        found = landmark(markers, marker_set, place)
        return np.full((markers.time.size, 3), np.nan) if found is None else found

    across = [at(f"right_{place}") - at(f"left_{place}") for place in _ACROSS]
    ahead = [
        (at("right_asis") + at("left_asis")) / 2 - at("mid_psis"),
        *(at(front) - at(back) for front, back in _AHEAD),
    ]
    # What points ahead votes by its right: ahead x up.
    votes = np.stack([*across, *(np.cross(way, [0.0, 0.0, 1.0]) for way in ahead)]) * [1.0, 1.0, 0.0]
    # Unit vectors on both sides: every pair of landmarks has one vote, whatever its length.
    return _unit(np.nansum(_unit(votes), axis=0))


def partner(name: str) -> str:
    """Return the label of the same place on the other side; "" for a midline marker."""
    other = {"L": "R", "R": "L", "l": "r", "r": "l"}.get(name[:1], "")
    return other + name[1:] if other else ""


def sides(names: tuple[str, ...]) -> list[tuple[str, str]]:
    """Return the labels of the left and right markers that belong together; the case of the side's letter is free."""
    spelt = {name[:1].upper() + name[1:]: name for name in names}
    left = [name for name in spelt if name.startswith("L")]
    return [(spelt[name], spelt[partner(name)]) for name in left if partner(name) in spelt]


def lies_beyond(markers: Markers, pair: tuple[str, str], way: Array) -> Mask:
    """Return (T,) where the first marker of a ``pair`` lies `_ASIDE` farther along ``way`` (T, 3) than the second."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sum((markers[pair[0]] - markers[pair[1]]) * way, axis=1) > _ASIDE)


def crossed_sides(markers: Markers, right: Array) -> tuple[tuple[str, str], ...]:
    """Return the pairs of left and right markers that lie on each other's side in the median over the trial."""
    return tuple(pair for pair in sides(markers.names) if _mostly(markers, pair, right))


def crossed_ends(markers: Markers, right: Array) -> tuple[tuple[str, str], ...]:
    """Return the pairs of a front and a back marker of one side (`_ENDS`) of which the back one lies in front in the
    median over the trial.
    """
    ahead = np.cross([0.0, 0.0, 1.0], right)
    pairs = [(side + back, side + front) for side in "LR" for front, back in _ENDS]
    return tuple(pair for pair in pairs if pair[0] in markers and pair[1] in markers and _mostly(markers, pair, ahead))


def _mostly(markers: Markers, pair: tuple[str, str], way: Array) -> bool:
    return middle(np.sum((markers[pair[0]] - markers[pair[1]]) * way, axis=1)) > _ASIDE


def middle(values: Array) -> float:
    """Return the median of what is known of ``values``; NaN without any."""
    seen = values[np.isfinite(values)]
    return float(np.median(seen)) if seen.size else float("nan")


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(length > 0, vectors / length, np.nan))

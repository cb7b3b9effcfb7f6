"""Which side of the body a marker lies on, and which of two lies in front, judged by pelvis and trunk: feet step and
arms swing, and cross the middle. Of the two markers of a wrist no distance tells it, since a wrist bends and they lie
alike: the finger's marker sits on the back of the hand, thumbs do not point backwards, both arms hang alike.
"""

from collections.abc import Iterable

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


_OPPOSITE = -0.4
"""Cosine between one wrist and the mirrored other one from which on they contradict each other (19 real trials: -0.65
and less where exchanged, 0.25 and more elsewhere)."""
_BACKWARDS = -0.5
"""Share of a wrist that points backwards, thumb behind, while the person moves: nobody walks so."""
_RATHER_BACKWARDS = -0.2
"""The same where the finger's marker lies on the palm's side, too."""
BACK_OF_HAND = 0.2
"""Sine of the angle by which a finger's marker lies on the back of the hand, from which on it tells the sides of the
wrist (24 real trials of one laboratory: 0.26 to 0.73, exchanged -0.27 to -0.53; two others 0.00 to 0.29)."""
_AS_FAR = 0.2
"""Sine by which a mirror image may differ: a wrist that is bent by 12 degrees more (25 sessions of an independent
laboratory: 0.16 at most between static trial and dances)."""
_FAR_AWAY = 1.0
"""m between first and last frame that a person walks at least."""
_PARTS = ("ELB", "WRA", "WRB", "FIN")


def turned_wrists(markers: Markers, worn: MarkerSet, others: Iterable[Markers]) -> tuple[tuple[str, str], ...]:
    """Return the wrists whose thumb-side marker (WRA) and other one (WRB) carry each other's names; arms must hang.

    What speaks for it: they lie the other way round than at the mirrored other wrist; while the person travels, the
    thumb's side points backwards; the finger's marker lies on the palm's side, but not in all of the ``others`` of the
    same person, or with the thumb rather backwards. One on the back of the hand speaks against it.
    """
    wrong = _contradicting(markers, worn)
    for side in "LR":
        back = middle(back_of_hand(markers, side))
        if back < -BACK_OF_HAND:
            if any(_believes_in_backs(one, worn, side) for one in (markers, *others)):
                wrong.add(side)
        elif back > BACK_OF_HAND:
            wrong.discard(side)
    return tuple((f"{side}WRA", f"{side}WRB") for side in sorted(wrong))


def _believes_in_backs(markers: Markers, worn: MarkerSet, side: str) -> bool:
    """Return whether a trial shows the back of the hand, or somebody who travels with the thumb rather behind."""
    back = middle(back_of_hand(markers, side))
    bars = _bars(markers, worn) if back < -BACK_OF_HAND and travels(markers) else {}
    return back > BACK_OF_HAND or (side in bars and bool(bars[side][0] < _RATHER_BACKWARDS))


def travels(markers: Markers) -> bool:
    """Return whether the person goes from one place to another: only then, and in a static trial, do both arms hang
    alike.
    """
    if not (markers.time.size and markers.seen.any(axis=1).all()):
        return False
    first, last = np.nanmean(markers.xyz[[0, -1], :, :2], axis=1)
    return bool(np.linalg.norm(last - first) > _FAR_AWAY)


def mirrored(back: Array, before: float) -> Mask:
    """Return where a finger's marker lies towards the palm (``back`` (T,) of `back_of_hand`) as far as it lay towards
    the back of the hand ``before``, in the static trial.
    """
    with np.errstate(invalid="ignore"):
        return np.asarray((back < -BACK_OF_HAND) & (before > BACK_OF_HAND) & (np.abs(back + before) < _AS_FAR))


def back_of_hand(markers: Markers, side: str) -> Array:
    """Return (T,) the sine by which the finger's marker of a ``side`` ("L", "R") lies towards the back of the hand from
    the plane of forearm and wrist; negative towards the palm; NaN where it is not seen.
    """
    if any(side + part not in markers for part in _PARTS):
        return np.full(markers.time.size, np.nan)
    elbow, thumb, other, finger = (markers[side + part] for part in _PARTS)
    wrist = (thumb + other) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        # Unit vectors: their triple product is the sine of the angle out of the plane of forearm and wrist.
        along, bar, hand = (_unit(vector) for vector in (wrist - elbow, thumb - other, finger - wrist))
    # The left hand is a mirror image.
    sign = 1.0 if side == "R" else -1.0
    return np.asarray(sign * np.einsum("ti,ti->t", np.cross(along, bar), hand))


def _contradicting(markers: Markers, worn: MarkerSet) -> set[str]:
    """Return the sides whose bar points backwards, else the more backward one of two that are no mirror images."""
    bars = _bars(markers, worn)
    wrong = {side for side, bar in bars.items() if bar[0] < _BACKWARDS} if travels(markers) else set[str]()
    # A mirrored bar has the same components ahead, outwards, up: cosine between them.
    if bars and bars["L"] @ bars["R"] < _OPPOSITE and not wrong:
        wrong = {min(bars, key=lambda side: float(bars[side][:2].sum()))}
    return wrong


def _bars(markers: Markers, worn: MarkerSet) -> dict[str, Array]:
    """Return by side the median direction (3,) ahead, outwards, up from WRB to WRA; nothing where one is not seen."""
    if any(f"{side}{name}" not in markers for side in "LR" for name in ("WRA", "WRB")):
        return {}
    right = rightwards(markers, worn)
    ahead = np.cross([0.0, 0.0, 1.0], right)
    out = {}
    for side, sign in (("L", -1.0), ("R", 1.0)):
        with np.errstate(invalid="ignore", divide="ignore"):
            bar = _unit(markers[f"{side}WRA"] - markers[f"{side}WRB"])
        parts = (np.sum(bar * ahead, axis=1), sign * np.sum(bar * right, axis=1), bar[:, 2])
        out[side] = np.array([middle(part) for part in parts])
    return out if np.isfinite([*out.values()]).all() else {}

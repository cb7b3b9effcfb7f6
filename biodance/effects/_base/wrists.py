"""Which wrists carry thumb-side and other marker the wrong way round, told by the markers alone: the finger's marker
sits on the back of the hand, thumbs do not point backwards, both arms hang alike.
"""

from collections.abc import Iterable

import numpy as np

from biodance.records import Array, Markers

_OPPOSITE = -0.4
"""Cosine between one wrist and the mirrored other one from which on they contradict each other (19 real trials: -0.65
and less where exchanged, 0.25 and more elsewhere)."""
_BACKWARDS = -0.5
"""Share of a wrist that points backwards, thumb behind, while the person moves: nobody walks so."""
_RATHER_BACKWARDS = -0.2
"""The same where the finger's marker lies on the palm's side, too."""
_BACK_OF_HAND = 0.2
"""Sine of the angle by which a finger's marker lies on the back of the hand, from which on it tells the sides of the
wrist (24 real trials of one laboratory: 0.26 to 0.73, exchanged -0.27 to -0.53; two others 0.00 to 0.29)."""
_AS_FAR = 0.2
"""Sine by which a mirror image may differ: a wrist that is bent by 12 degrees more (25 sessions of an independent
laboratory: 0.16 at most between static trial and dances)."""
_FAR_AWAY = 1.0
"""m between first and last frame that a person walks at least."""
_PARTS = ("ELB", "WRA", "WRB", "FIN")


def turned_wrists(markers: Markers, others: Iterable[Markers]) -> tuple[tuple[str, str], ...]:
    """Return the wrists whose thumb-side marker (WRA) and other one (WRB) carry each other's names; arms must hang.

    What speaks for it: they lie the other way round than at the mirrored other wrist; while the person travels, the
    thumb's side points backwards; the finger's marker lies on the palm's side, but not in all of the ``others`` of the
    same person, or with the thumb rather backwards. One on the back of the hand speaks against it.
    """
    wrong = _contradicting(markers)
    for side in "LR":
        if shows_palm(markers, side):
            if any(back_of_hand(one, side) > _BACK_OF_HAND or _palm_behind(one, side) for one in (markers, *others)):
                wrong.add(side)
        elif shows_back(markers, side):
            wrong.discard(side)
    return tuple((f"{side}WRA", f"{side}WRB") for side in sorted(wrong))


def travels(markers: Markers) -> bool:
    """Return whether the person goes from one place to another: only then, and in a static trial, do both arms hang
    alike.
    """
    if not (markers.time.size and markers.seen.any(axis=1).all()):
        return False
    first, last = np.nanmean(markers.xyz[[0, -1], :, :2], axis=1)
    return bool(np.linalg.norm(last - first) > _FAR_AWAY)


def _palm_behind(markers: Markers, side: str) -> bool:
    """Return whether somebody who travels shows the palm with the thumb rather behind: nobody does."""
    bars = _bars(markers) if shows_palm(markers, side) and travels(markers) else {}
    return side in bars and bool(bars[side][0] < _RATHER_BACKWARDS)


def shows_palm(markers: Markers, side: str) -> bool:
    """Return whether the finger's marker of a ``side`` lies clearly towards the palm."""
    return back_of_hand(markers, side) < -_BACK_OF_HAND


def shows_back(markers: Markers, side: str) -> bool:
    """Return whether the finger's marker of a ``side`` lies clearly on the back of the hand."""
    return back_of_hand(markers, side) > _BACK_OF_HAND


def mirrors(markers: Markers, static: Markers, side: str) -> bool:
    """Return whether the finger's marker of a ``side`` lies towards the palm as far as it lies towards the back of the
    hand in the ``static`` trial.
    """
    here, there = back_of_hand(markers, side), back_of_hand(static, side)
    return shows_palm(markers, side) and shows_back(static, side) and abs(here + there) < _AS_FAR


def back_of_hand(markers: Markers, side: str) -> float:
    """Return the sine by which the finger's marker of a ``side`` ("L", "R") lies towards the back of the hand from the
    plane of forearm and wrist, median of the trial; negative towards the palm; NaN where it is not seen.
    """
    if any(side + part not in markers for part in _PARTS):
        return float("nan")
    elbow, thumb, other, finger = (markers[side + part] for part in _PARTS)
    wrist = (thumb + other) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        along, bar, hand = (_unit(vector) for vector in (wrist - elbow, thumb - other, finger - wrist))
    sign = 1.0 if side == "R" else -1.0
    return sign * middle(np.einsum("ti,ti->t", np.cross(along, bar), hand))


def _contradicting(markers: Markers) -> set[str]:
    """Return the sides whose bar points backwards, else the more backward one of two that are no mirror images."""
    bars = _bars(markers)
    wrong = {side for side, bar in bars.items() if bar[0] < _BACKWARDS} if travels(markers) else set[str]()
    if bars and bars["L"] @ bars["R"] < _OPPOSITE and not wrong:
        wrong = {min(bars, key=lambda side: float(bars[side][:2].sum()))}
    return wrong


def _bars(markers: Markers) -> dict[str, Array]:
    """Return by side the median direction (3,) ahead, outwards, up from WRB to WRA; nothing where one is not seen."""
    if any(f"{side}{name}" not in markers for side in "LR" for name in ("WRA", "WRB")):
        return {}
    to_right = rightwards(markers)
    ahead = np.cross([0.0, 0.0, 1.0], to_right)
    out = {}
    for side, sign in (("L", -1.0), ("R", 1.0)):
        with np.errstate(invalid="ignore", divide="ignore"):
            bar = _unit(markers[f"{side}WRA"] - markers[f"{side}WRB"])
        parts = (np.sum(bar * ahead, axis=1), sign * np.sum(bar * to_right, axis=1), bar[:, 2])
        out[side] = np.array([middle(part) for part in parts])
    return out if np.isfinite([*out.values()]).all() else {}


def partner(name: str) -> str:
    """Return the label of the same place on the other side; "" for a midline marker."""
    other = {"L": "R", "R": "L", "l": "r", "r": "l"}.get(name[:1], "")
    return other + name[1:] if other else ""


def sides(markers: Markers) -> list[tuple[str, str]]:
    """Return the labels of the left and right markers that belong together."""
    return [(name, partner(name)) for name in markers.names if name[:1] in "Ll" and partner(name) in markers]


def rightwards(markers: Markers) -> Array:
    """Return the horizontal unit vector (T, 3) to the right of the body, from all left to all right markers."""
    apart = np.stack([markers[right] - markers[left] for left, right in sides(markers)]) * [1.0, 1.0, 0.0]
    total = np.nansum(apart, axis=0)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(length > 0, total / length, np.nan))


def middle(values: Array) -> float:
    """Return the median of what is known of ``values``; NaN without any."""
    seen = values[np.isfinite(values)]
    return float(np.median(seen)) if seen.size else float("nan")


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

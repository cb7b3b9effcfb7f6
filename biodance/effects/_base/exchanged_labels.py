"""Which markers of a trial carry each other's names, told by the markers alone: sides of the body, distances within
a rigid group, wrists.
"""

from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np

from biodance.effects._base.wrists import middle, mirrors, rightwards, shows_palm, sides, travels, turned_wrists
from biodance.lab.markers.sets import MarkerSet, read_marker_set
from biodance.records import Array, Markers, Trial

Pair = tuple[str, str]
"""Two labels in alphabetical order."""
_FEWEST = 5
"""Pairs of left and right markers that tell which side is which."""
_ASIDE = 0.02
"""m by which a left marker must lie to the right of its right partner, in the median over the trial."""
_ENDS = (("FHD", "BHD"), ("ASI", "PSI"), ("TOE", "HEE"))
"""Stems of labels in front and behind of the same bone."""
_SPAN = 3.5
"""m between the outermost markers: more than a person's, arms and legs stretched."""
_SPANNED = 0.05
"""Share of frames with markers farther apart than `_SPAN` from which on a trial says nothing of names."""
_MISFIT = 0.003
"""m: distances within a rigid group that differ so much (RMS) between static and trial are not those of one group."""
_ARM = ("ELB", "FIN")
"""Markers whose distance from those of the wrist changes least with the posture."""
_BETTER = 0.4
"""Share of the misfit that the right names leave at most, and share of what the next best names leave."""


def exchanged_pairs(
    trial: Trial, static: Trial | None, known: frozenset[Pair], others: Iterable[Markers] = ()
) -> frozenset[Pair]:
    """Return the pairs of markers that carry each other's names in a trial.

    ``static`` of the same person (None, or the trial itself: what the trial says alone), ``known`` the pairs that are
    exchanged in it: distances only tell whether a trial has other names than the static. ``others`` of the same person
    in which both arms hang.
    """
    markers = trial.markers
    if markers is None or not _on_a_person(markers, trial.marker_set):
        return frozenset()
    alone = {*crossed_sides(markers), *crossed_ends(markers)}
    if arms_hang(trial):
        alone |= {*turned_wrists(markers, others)}
    if static is None or static.markers is None or static is trial:
        return frozenset(alone)
    if not arms_hang(trial):
        alone |= {(f"{side}WRA", f"{side}WRB") for side in "LR" if mirrors(markers, static.markers, side)}
    if not trial.marker_set:
        return frozenset(alone)
    alone = {pair for pair in alone if pair in known or not _farther(markers, static.markers, pair)}
    marker_set = read_marker_set(trial.marker_set)
    for group in rigid_groups(markers, marker_set):
        swaps = other_names(markers, static.markers, group)
        if swaps is None:
            continue
        here = {pair for pair in known | alone if set(pair) <= set(group)}
        relative = frozenset(swaps)
        alone = (alone - here) | (relative ^ {pair for pair in known if set(pair) <= set(group)})
    return frozenset(alone)


def _on_a_person(markers: Markers, name: str) -> bool:
    """Return whether the markers of the set of this ``name`` (of all, without one) lie no farther apart than those on a
    person, but for a few frames.
    """
    worn = set(read_marker_set(name).match(markers.names).values()) if name else set(markers.names)
    xyz = markers.xyz[:, [label in worn for label in markers.names]]
    xyz = xyz[np.isfinite(xyz).any(axis=(1, 2))]
    span = np.nanmax(xyz, axis=1, initial=-np.inf) - np.nanmin(xyz, axis=1, initial=np.inf)
    return bool(np.mean(span.max(axis=1, initial=0.0) > _SPAN) <= _SPANNED) if len(xyz) else False


def arms_hang(trial: Trial) -> bool:
    """Return whether both arms hang in a trial: while somebody stands for the static trial, or walks."""
    return trial.markers is not None and (trial.role == "static" or travels(trial.markers))


def crossed_sides(markers: Markers) -> tuple[Pair, ...]:
    """Return the pairs of left and right markers that lie on each other's side of the body in the median over the
    trial, against the majority of pairs.
    """
    pairs = sides(markers)
    if len(pairs) < _FEWEST:
        return ()
    apart = np.stack([markers[right] - markers[left] for left, right in pairs])
    to_right = rightwards(markers)
    with np.errstate(invalid="ignore"):
        side = np.einsum("ptk,tk->pt", apart, to_right)
    return tuple(_sorted(pair) for pair, one in zip(pairs, side, strict=True) if middle(one) < -_ASIDE)


def crossed_ends(markers: Markers) -> tuple[Pair, ...]:
    """Return the pairs of a front and a back marker of one side (`_ENDS`) of which the front one lies behind the back
    one in the median over the trial.
    """
    if len(sides(markers)) < _FEWEST:
        return ()
    ahead = np.cross([0.0, 0.0, 1.0], rightwards(markers))
    pairs = [(side + front, side + back) for side in "LR" for front, back in _ENDS]
    there = [pair for pair in pairs if pair[0] in markers and pair[1] in markers]
    lead = [middle(np.sum((markers[front] - markers[back]) * ahead, axis=1)) for front, back in there]
    return tuple(_sorted(pair) for pair, one in zip(there, lead, strict=True) if one < -_ASIDE)


def _farther(markers: Markers, static: Markers, pair: Pair) -> bool:
    """Return whether exchanging the two markers of one wrist takes them away from where the static trial has them
    beside elbow and finger: then the hand was turned, not the names. Some millimetres, which say less than a
    finger's marker on the palm.
    """
    side = pair[0][:1]
    if pair != (side + "WRA", side + "WRB") or shows_palm(markers, side):
        return False
    beside = [side + name for name in _ARM if side + name in markers.names and side + name in static.names]
    if not beside or any(name not in static.names for name in pair):
        return False
    was, here = (_distances(one, (*pair, *beside))[:2, 2:] for one in (static, markers))
    return bool(np.square(here[::-1] - was).sum() > np.square(here - was).sum())


def rigid_groups(markers: Markers, marker_set: MarkerSet) -> Iterator[tuple[str, ...]]:
    """Yield the labels in the file of at least four markers that sit on the same bone: those of the head, of the
    pelvis.
    """
    match = marker_set.match(markers.names)
    heads = {
        label for name in ("head_front", "head_back") for way in marker_set.landmarks.get(name, ()) for label in way
    }
    pelvis = {marker.label for marker in marker_set.markers if marker.segment == "pelvis"}
    for group in (heads, pelvis):
        names = tuple(match[label] for label in marker_set.labels if label in group and label in match)
        if len(names) >= 4:
            yield names


def other_names(markers: Markers, static: Markers, group: tuple[str, ...]) -> tuple[Pair, ...] | None:
    """Return the exchanges (one or two pairs) under which the distances within a ``group`` are those of the static
    trial; () where they are already, None where it cannot be told.
    """
    if any(name not in static for name in group):
        return None
    here, there = (_distances(one, group) for one in (markers, static))
    left = {}
    for swaps in _exchanges(group):
        order = [group.index(_renamed(name, swaps)) for name in group]
        left[swaps] = float(np.sqrt(np.mean((here[np.ix_(order, order)] - there) ** 2)))
    best, *others = sorted(left, key=lambda swaps: left[swaps])
    if not np.isfinite(left[()]):
        return None
    if left[()] < _MISFIT:
        return () if left[()] <= left[best] + 1e-4 or best == () else None
    sure = left[best] < _BETTER * left[()] and left[best] < _BETTER * left[others[0]]
    return best if sure else None


def _exchanges(group: tuple[str, ...]) -> Iterator[tuple[Pair, ...]]:
    pairs = [_sorted(pair) for pair in combinations(group, 2)]
    yield ()
    yield from ((pair,) for pair in pairs)
    yield from ((one, two) for one, two in combinations(pairs, 2) if not set(one) & set(two))


def _renamed(name: str, swaps: tuple[Pair, ...]) -> str:
    for one, two in swaps:
        if name in (one, two):
            return two if name == one else one
    return name


def _distances(markers: Markers, group: tuple[str, ...]) -> Array:
    """Return the median distances (n, n) m between the markers of a group."""
    points = np.stack([markers[name] for name in group])
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return np.array([[middle(one) for one in row] for row in apart])


def _sorted(pair: Pair) -> Pair:
    return (min(pair), max(pair))

"""Which markers of a trial carry each other's names, and when: rigid distances to the static trial decide; what they
cannot tell (left or right, front or back, thumb or not), pelvis, trunk and finger say, unless a rigid distance
contradicts.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations

import numpy as np

from biodance.effects._base.body_sides import beyond, crossed_ends, crossed_sides, middle, rightwards, sides
from biodance.effects._base.rigid_groups import Pair, RigidGroup, rigid_groups
from biodance.effects._base.wrists import BACK_OF_HAND, back_of_hand, mirrored, travels, turned_wrists
from biodance.lab.markers.sets import MarkerSet, read_marker_set, recognise
from biodance.records import Array, Markers, Mask, Trial, runs

Spans = tuple[tuple[int, int], ...]
"""Frames (start, stop), stop excluded."""
_SPAN = 3.5
"""m between the outermost markers: more than a person's, arms and legs stretched."""
_SPANNED = 0.05
"""Share of frames with markers farther apart than `_SPAN` from which on a trial says nothing of names."""
_MISFIT = 0.003
"""m: distances to the static shape (RMS of a group) up to which nothing is wrong: a head band keeps it within 1, a foot
within 3, a shank with its knee within 5 mm (54 real trials)."""
_NOISE = 0.004
"""m: standard deviation of a distance on one segment between static trial and movement; a name that makes a group worse
by more is contradicted.
"""
_BETTER = 0.16
"""Share of the squared misfit that the right names leave at most, and share of what the next best names leave (54 real
trials: 0.00 to 0.06 where names are exchanged, 0.3 and more elsewhere)."""
_SOME = 60
"""Worst frames, and as many spread over the trial, in which all names are tried."""
_FEWEST = 4
"""Frames of an exchange in a part of a trial; less is a spike."""
_HOLE = 0.1
"""s: shorter pauses of an exchange belong to it."""
_WHOLE = 0.9
"""Share of the frames from which on an exchange is one of the whole trial."""
_NEAR = 3
"""Frames about the end of a span within which the two markers must change places."""
_ROUNDS = 6


def exchanged_labels(
    trial: Trial, static: Markers | None, known: Iterable[Pair] = (), others: Iterable[Markers] = ()
) -> dict[Pair, Spans]:
    """Return the pairs of markers that carry each other's names in a trial, and in which frames.

    ``static`` markers of the same person under their right names (None: what the trial says alone), ``known`` the pairs
    that had been exchanged in it; ``others`` of the same person in which both arms hang.
    """
    markers, worn = trial.markers, set_of(trial)
    if markers is None or worn is None:
        return {}
    markers = markers.select(worn.match(markers.names).values())
    if not _on_a_person(markers):
        return {}
    groups = rigid_groups(markers, static, worn) if static is not None else ()
    found = dict(_by_shape(markers, groups))
    rest = renamed_markers(markers, found)
    right = rightwards(rest, worn)
    seen = {_sorted(pair) for pair in (*crossed_sides(rest, right), *crossed_ends(rest, right))}
    hangs = arms_hang(trial)
    if hangs:
        seen |= {*turned_wrists(rest, worn, others)}
    else:  # nothing tells a wrist in any posture, unless the finger's marker lies clearly on one side
        seen |= {pair for pair in known if _is_wrist(pair) and not _tells(rest, pair)}
    whole = _uncontradicted(rest, static, worn, seen)
    parts = {pair: spans for pair, spans in _in_parts(rest, static, right, worn) if pair not in whole}
    return found | parts | dict.fromkeys(whole, ((0, markers.time.size),))


def set_of(trial: Trial) -> MarkerSet | None:
    """Return the marker set of a trial, by its labels where none was chosen: other points are no markers."""
    if trial.markers is None:
        return None
    return read_marker_set(trial.marker_set) if trial.marker_set else recognise(trial.markers.names)


def arms_hang(trial: Trial) -> bool:
    """Return whether both arms hang in a trial: while somebody stands for the static trial, or walks."""
    return trial.markers is not None and (trial.role == "static" or travels(trial.markers))


def renamed_markers(markers: Markers, found: Mapping[Pair, Spans]) -> Markers:
    """Return the markers with the two of each pair ``found`` exchanged in its frames."""
    if not found:
        return markers
    xyz = markers.xyz.copy()
    for pair, spans in found.items():
        columns = [markers.names.index(name) for name in pair]
        for start, stop in spans:
            xyz[start:stop, columns] = xyz[start:stop, columns[::-1]]
    xyz.setflags(write=False)  # the record keeps it without a copy
    return Markers(markers.names, markers.time, xyz)


def _on_a_person(markers: Markers) -> bool:
    """Return whether the markers lie no farther apart than those on a person, but for a few frames."""
    xyz = markers.xyz[np.isfinite(markers.xyz).any(axis=(1, 2))]
    if not len(xyz):
        return False
    span = np.nanmax(xyz, axis=1, initial=-np.inf) - np.nanmin(xyz, axis=1, initial=np.inf)
    return bool(np.mean(span.max(axis=1, initial=0.0) > _SPAN) <= _SPANNED)


def _by_shape(markers: Markers, groups: tuple[RigidGroup, ...]) -> Iterator[tuple[Pair, Spans]]:
    """Yield the pairs under whose exchange the distances within rigid ``groups`` are those of the static trial, and
    when: the exchange that explains most first, then what is left.
    """
    for _ in range(_ROUNDS):
        pairs = _best_exchange(markers, groups)
        wrong, told, _ = _explained(markers, groups, pairs, np.arange(markers.time.size))
        spans = _spans(markers, pairs, wrong, told)
        if not spans:
            return
        yield from ((pair, spans) for pair in pairs)
        markers = renamed_markers(markers, dict.fromkeys(pairs, spans))


def _best_exchange(markers: Markers, groups: tuple[RigidGroup, ...]) -> tuple[Pair, ...]:
    """Return the pairs that explain most if exchanged together, () where none do, or others explain it as well."""
    named = {one: one.misfit(markers, {}, np.arange(markers.time.size)) for one in groups}
    wrong = [one for one in groups if np.sum(named[one] > len(one.labels) * _MISFIT**2) >= _FEWEST]
    if not wrong:
        return ()
    worst = np.argsort(np.max([np.nan_to_num(named[one]) for one in wrong], axis=0))[-_SOME:]
    frames = np.union1d(worst, np.linspace(0, markers.time.size - 1, _SOME).astype(int))
    gains = {}
    for pairs in _candidates(markers, groups, wrong):
        better, _, gain = _explained(markers, groups, pairs, frames)
        if better.sum() >= _FEWEST:
            gains[pairs] = float(gain[better].sum() - 2 * len(pairs) * _NOISE**2 * better.sum())
    best = max(gains, key=gains.__getitem__, default=())
    others = [pairs for pairs in gains if not set(best) <= set(pairs)]
    return best if best and _alone(markers, groups, best, others, frames) else ()


def _alone(
    markers: Markers, groups: tuple[RigidGroup, ...], best: tuple[Pair, ...], others: list[tuple[Pair, ...]], frames: Array
) -> bool:
    """Return whether no other names bring the groups that the ``best`` exchange touches nearly as near."""
    better, _, _ = _explained(markers, groups, best, frames)
    touched = [one for one in groups if set(_other_names(best)) & set(one.labels)]

    def left(pairs: tuple[Pair, ...]) -> float:
        return float(np.nansum([one.misfit(markers, _other_names(pairs), frames[better]) for one in touched]))

    return all(left(best) < _BETTER * left(pairs) for pairs in others)


def _candidates(
    markers: Markers, groups: tuple[RigidGroup, ...], wrong: list[RigidGroup]
) -> Iterator[tuple[Pair, ...]]:
    """Yield what may be exchanged so that groups that look ``wrong`` are right: one or two pairs of one group, one, two
    or all left and right partners of a group.
    """
    partners = [_sorted(pair) for pair in sides(markers.names)]
    seen = set()
    for group in wrong:
        within = [_sorted(pair) for pair in combinations(group.labels, 2)]
        across = [pair for pair in partners if set(pair) & set(group.labels) and pair not in within]
        doubles = [(a, b) for some in (within, across) for a, b in combinations(some, 2) if not set(a) & set(b)]
        for pairs in (*((pair,) for pair in (*within, *across)), *doubles, tuple(across)):
            if pairs and (key := frozenset(pairs)) not in seen:
                seen.add(key)
                yield pairs


def _explained(
    markers: Markers, groups: tuple[RigidGroup, ...], pairs: tuple[Pair, ...], frames: Array
) -> tuple[Mask, Mask, Array]:
    """Return in which of the ``frames`` the groups that ``pairs`` touch fit clearly better with these exchanged (n,),
    where that can be told (n,), and by how many m² (n,).
    """
    other = _other_names(pairs)
    touched = [one for one in groups if other.keys() & set(one.labels)]
    named = np.sum([one.misfit(markers, {}, frames) for one in touched], axis=0)
    right = np.sum([one.misfit(markers, other, frames) for one in touched], axis=0)
    told = np.isfinite(named) & np.isfinite(right)
    with np.errstate(invalid="ignore"):
        better = (right < _BETTER * named) & (named > sum(len(one.labels) for one in touched) * _MISFIT**2)
    return better, told, np.where(told, named - right, 0.0)


def _other_names(pairs: Iterable[Pair]) -> dict[str, str]:
    """Return label -> label for pairs that are exchanged."""
    return {one: other for pair in pairs for one, other in (pair, pair[::-1])}


def _spans(markers: Markers, pairs: Iterable[Pair], wrong: Mask, told: Mask) -> Spans:
    """Return the frames of an exchange: all where it is ``wrong`` (T,) in nearly all frames that tell, else the runs at
    whose ends the markers change places.
    """
    if not wrong.any():
        return ()
    if wrong.sum() >= _WHOLE * told.sum():
        return ((0, wrong.size),)
    joined = wrong.copy()
    for start, stop in runs(~wrong):
        short = stop - start <= _HOLE * markers.rate or not told[start:stop].any()
        joined[start:stop] = short and start > 0 and stop < wrong.size
    changes = _changes(markers, pairs)
    found = []
    for start, stop in runs(joined):
        ends = (_changed_at(changes, start), _changed_at(changes, stop))
        if wrong[start:stop].sum() >= _FEWEST and ends[0] is not None and ends[1] is not None and ends[0] < ends[1]:
            found.append((ends[0], ends[1]))
    return tuple(found)


def _changes(markers: Markers, pairs: Iterable[Pair]) -> Array:
    """Return (T + 1,) 1 where markers move less from one frame to the next if they change their names between the two,
    0 where they move more, NaN where that is not seen, as before the first and behind the last frame.
    """
    ways = np.zeros(markers.time.size + 1)
    ways[[0, -1]] = np.nan
    for one, other in ((markers[a], markers[b]) for a, b in pairs):
        straight = np.linalg.norm(np.diff(one, axis=0), axis=1) + np.linalg.norm(np.diff(other, axis=0), axis=1)
        crossing = np.linalg.norm(other[1:] - one[:-1], axis=1) + np.linalg.norm(one[1:] - other[:-1], axis=1)
        ways[1:-1] += straight - crossing
    return np.where(np.isnan(ways), np.nan, np.where(ways > 0, 1.0, 0.0))


def _changed_at(changes: Array, end: int) -> int | None:
    """Return the frame near the ``end`` of a span at which the markers change places, the end itself where that is not
    seen; None where they do not.
    """
    first = max(end - _NEAR, 0)
    near = changes[first : end + _NEAR + 1]
    there = np.flatnonzero(near == 1)
    if there.size:
        return first + int(there[np.argmin(np.abs(first + there - end))])
    return end if np.isnan(near).any() else None


def _in_parts(
    markers: Markers, static: Markers | None, right: Array, worn: MarkerSet
) -> Iterator[tuple[Pair, Spans]]:
    """Yield the pairs that are exchanged where no rigid distance tells it, and when: left and right of the pelvis, the
    two markers of a wrist by the side of the finger's marker in the static trial.
    """
    match = worn.match(markers.names)
    pelvis = {match[one.label] for one in worn.markers if one.segment == "pelvis" and one.label in match}
    seen = [
        (_sorted(pair), beyond(markers, pair, right), np.isfinite((markers[pair[0]] - markers[pair[1]]) * right).all(axis=1))
        for pair in sides(markers.names)
        if set(pair) <= pelvis
    ]
    for side in "LR" if static is not None else "":
        back, before = back_of_hand(markers, side), middle(back_of_hand(static, side))
        seen.append(((f"{side}WRA", f"{side}WRB"), mirrored(back, before), np.isfinite(back)))
    for pair, wrong, told in seen:
        if spans := _spans(markers, [pair], wrong, told):
            yield pair, spans


def _is_wrist(pair: Pair) -> bool:
    return pair in {(f"{side}WRA", f"{side}WRB") for side in "LR"}


def _tells(markers: Markers, pair: Pair) -> bool:
    """Return whether a finger's marker lies clearly on one side of the wrist of a ``pair``."""
    return bool(abs(middle(back_of_hand(markers, pair[0][:1]))) > BACK_OF_HAND)


def _uncontradicted(markers: Markers, static: Markers | None, worn: MarkerSet, seen: set[Pair]) -> set[Pair]:
    """Return those of the pairs ``seen`` whose exchange makes no rigid group worse than noise: against the static
    trial, else against its own median shape.
    """
    left = {pair for pair in seen if set(pair) <= set(markers.names)}
    frames = np.unique(np.linspace(0, markers.time.size - 1, 2 * _SOME).astype(int))
    while left:
        exchanged = renamed_markers(markers, dict.fromkeys(left, ((0, markers.time.size),)))
        before, after = (rigid_groups(one, static or one, worn) for one in (markers, exchanged))
        worse = set()
        for was, now in zip(before, after, strict=True):
            apart = middle(now.misfit(exchanged, {}, frames)) - middle(was.misfit(markers, {}, frames))
            worse |= set(was.labels) if apart > len(was.labels) * _NOISE**2 else set()
        torn = {pair for pair in left if set(pair) & worse}
        if not torn:
            break
        left -= torn
    return left


def _sorted(pair: Pair) -> Pair:
    return (min(pair), max(pair))

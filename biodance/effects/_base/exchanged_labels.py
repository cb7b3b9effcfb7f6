"""Which markers of a trial carry each other's names, and when: in the whole trial, or from one change of places to the
next. Rigid distances to the static trial decide; what they cannot tell (left or right, front or back, thumb or not),
pelvis, trunk and finger say, unless a rigid distance contradicts.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from biodance.effects._base.body_sides import (
    BACK_OF_HAND,
    back_of_hand,
    crossed_ends,
    crossed_sides,
    lies_beyond,
    middle,
    mirrored,
    rightwards,
    sides,
    travels,
    turned_wrists,
)
from biodance.effects._base.rigid_groups import RigidGroup, marking, rigid_groups
from biodance.lab.markers.sets import MarkerSet, read_marker_set, recognise
from biodance.records import Array, Index, Markers, Mask, Trial, runs

Pair = tuple[str, str]
"""Two labels in alphabetical order."""
Spans = tuple[tuple[int, int], ...]
"""Frames (start, stop), stop excluded."""
LEAST_EXCHANGED = 4
"""Frames of an exchange in a part of a trial; less is a spike."""
_HOLE = 0.1
"""s: shorter pauses of an exchange belong to it."""
_WHOLE = 0.9
"""Share of the frames from which on an exchange is one of the whole trial."""
_NEAR = 3
"""Frames about the end of a span within which the two markers must change places."""
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
    found = dict(_by_shape(markers, static, worn)) if static is not None else {}
    rest = renamed_markers(markers, found)
    right = rightwards(rest, worn)
    whole = _uncontradicted(rest, static, worn, {*crossed_sides(rest, right), *crossed_ends(rest, right)})
    rest = renamed_markers(rest, whole)
    wrists = _wrists(rest, static, worn, others, None if arms_hang(trial) else known)
    rest = renamed_markers(rest, wrists)
    parts = dict(_by_shape(rest, rest, worn)) | dict(_on_other_side(rest, right, worn))
    return parts | wrists | whole | found


def _wrists(
    markers: Markers, static: Markers | None, worn: MarkerSet, others: Iterable[Markers], follow: Iterable[Pair] | None
) -> dict[Pair, Spans]:
    """Return the wrists whose two markers carry each other's names, and when: as hanging arms show it, or where they do
    anything (``follow`` the pairs exchanged in the static trial, None while they hang) the finger's marker; where
    that lies on neither side, as in the static trial.
    """
    if follow is None:
        seen = {*turned_wrists(markers, worn, others)}
    else:
        # Where a finger's marker lies clearly on one side of the wrist, it decides alone.
        unsure = [side for side in "LR" if not abs(middle(back_of_hand(markers, side))) > BACK_OF_HAND]
        seen = {(f"{side}WRA", f"{side}WRB") for side in unsure} & {*follow}
    whole = _uncontradicted(markers, static, worn, seen)
    parts: dict[Pair, Spans] = {}
    for reference in (static, markers) if static is not None else (markers,):
        parts |= {pair: spans for pair, spans in _turned_hands(markers, reference) if pair not in {*whole, *parts}}
    return whole | parts


def set_of(trial: Trial) -> MarkerSet | None:
    """Return the marker set of a trial, by its labels where none was chosen: other points are no markers."""
    if trial.markers is None:
        return None
    return read_marker_set(trial.marker_set) if trial.marker_set else recognise(trial.markers.names)


def arms_hang(trial: Trial) -> bool:
    """Return whether both arms hang in a trial: while somebody stands for the static trial, or walks."""
    return trial.markers is not None and (trial.role == "static" or travels(trial.markers))


def _on_a_person(markers: Markers) -> bool:
    """Return whether the markers lie no farther apart than those on a person, but for a few frames."""
    xyz = markers.xyz[np.isfinite(markers.xyz).any(axis=(1, 2))]
    if not len(xyz):
        return False
    span = np.nanmax(xyz, axis=1, initial=-np.inf) - np.nanmin(xyz, axis=1, initial=np.inf)
    return bool(np.mean(span.max(axis=1, initial=0.0) > _SPAN) <= _SPANNED)


def _by_shape(markers: Markers, reference: Markers, worn: MarkerSet) -> Iterator[tuple[Pair, Spans]]:
    """Yield the pairs whose exchange gives rigid groups the shape of a ``reference``, and when; the best first."""
    groups = rigid_groups(markers, reference, worn)
    for _ in range(6):
        pairs, spans = _best_exchange(markers, groups)
        if not pairs:
            return
        yield from ((pair, spans) for pair in pairs)
        markers = renamed_markers(markers, dict.fromkeys(pairs, spans))


def _best_exchange(markers: Markers, groups: tuple[RigidGroup, ...]) -> tuple[tuple[Pair, ...], Spans]:
    """Return the pairs that explain most if exchanged together, and when; () where others do nearly as well."""
    every = _misfits(markers, np.arange(markers.time.size))
    named = {one: every(one, {}) for one in groups}
    # A misfit is a sum of squares: n markers at an RMS of `_MISFIT`.
    wrong = [one for one in groups if np.sum(named[one] > len(one.labels) * _MISFIT**2) >= LEAST_EXCHANGED]
    if not wrong:
        return (), ()
    worst = np.argsort(np.max([np.nan_to_num(named[one]) for one in wrong], axis=0))[-_SOME:]
    frames = np.union1d(worst, np.linspace(0, markers.time.size - 1, _SOME).astype(int))
    some, xyz, gains = _misfits(markers, frames), markers.xyz[frames], {}
    apart = np.linalg.norm(xyz[:, :, None] - xyz[:, None], axis=3)
    for pairs in _candidates(markers, groups, wrong):
        if not _may_explain(some, apart, markers.names, groups, pairs):
            continue
        better, _, gain = _explained(some, groups, pairs)
        if better.sum() >= LEAST_EXCHANGED:
            # Each exchanged pair must earn what noise alone may give.
            gains[pairs] = float(gain[better].sum() - 2 * len(pairs) * _NOISE**2 * better.sum())
    possible = {}
    for pairs in sorted(gains, key=lambda pairs: -gains[pairs]):
        better, told, _ = _explained(every, groups, pairs)
        if spans := exchange_spans(markers, pairs, better, told):
            possible[pairs] = spans
    if not possible:
        return (), ()
    best, *others = possible
    # Exchanges that contain the best one do not contradict it.
    alone = all(_better(markers, groups, best, other) for other in others if not set(best) <= set(other))
    return (best, possible[best]) if alone else ((), ())


def _better(markers: Markers, groups: tuple[RigidGroup, ...], best: tuple[Pair, ...], other: tuple[Pair, ...]) -> bool:
    """Return whether the ``best`` exchange leaves clearly less of the groups that either touches than an ``other``."""
    frames = np.linspace(0, markers.time.size - 1, 4 * _SOME).astype(int)
    better, _, _ = _explained(_misfits(markers, frames), groups, best)
    labels = {*_other_names(best), *_other_names(other)}
    touched = [one for one in groups if labels & set(one.labels)]
    left = [
        float(np.nansum([one.misfit(markers, _other_names(pairs), frames[better]) for one in touched]))
        for pairs in (best, other)
    ]
    return left[0] < _BETTER * left[1]


def _candidates(
    markers: Markers, groups: tuple[RigidGroup, ...], wrong: list[RigidGroup]
) -> Iterator[tuple[Pair, ...]]:
    """Yield what may be exchanged so that groups that look ``wrong`` are right: pairs within, beside and across."""
    partners = [alphabetical(pair) for pair in sides(markers.names)]
    seen = set()
    for group in wrong:
        own = set(group.labels)
        within = [alphabetical(pair) for pair in combinations(group.labels, 2)]
        beside = {label for one in groups if own & set(one.labels) for label in one.labels} - own
        past = [alphabetical((a, b)) for a in group.labels for b in sorted(beside)]
        across = [pair for pair in partners if set(pair) & own and pair not in within]
        doubles = [(a, b) for some in (within, across) for a, b in combinations(some, 2) if not set(a) & set(b)]
        for pairs in (*((pair,) for pair in (*within, *past, *across)), *doubles, tuple(across)):
            if pairs and (key := frozenset(pairs)) not in seen:
                seen.add(key)
                yield pairs


_Misfit = Callable[[RigidGroup, Mapping[str, str]], Array]


def _misfits(markers: Markers, frames: Index) -> _Misfit:
    """Return `RigidGroup.misfit` in some ``frames``, computed once for every order of a group's labels."""
    known: dict[tuple[RigidGroup, tuple[str, ...]], Array] = {}

    def misfit(group: RigidGroup, other: Mapping[str, str]) -> Array:
        key = group, tuple(other.get(label, label) for label in group.labels)
        if key not in known:
            known[key] = group.misfit(markers, other, frames)
        return known[key]

    return misfit


def _may_explain(
    misfit: _Misfit, apart: Array, names: Sequence[str], groups: tuple[RigidGroup, ...], pairs: tuple[Pair, ...]
) -> bool:
    """Return whether distances ``apart`` (n, M, M) m alone let groups fit clearly better with ``pairs`` exchanged."""
    other = _other_names(pairs)
    touched = [one for one in groups if other.keys() & set(one.labels)]
    named = np.sum([misfit(one, {}) for one in touched], axis=0)
    with np.errstate(invalid="ignore"):
        least = np.sum([one.least_misfit(apart, one.columns(names, other)) for one in touched], axis=0)
        return bool(np.sum(least < _BETTER * named) >= LEAST_EXCHANGED)


def _explained(misfit: _Misfit, groups: tuple[RigidGroup, ...], pairs: tuple[Pair, ...]) -> tuple[Mask, Mask, Array]:
    """Return where (n,) groups fit clearly better with ``pairs`` exchanged, where that is known, and by how many m²."""
    other = _other_names(pairs)
    touched = [one for one in groups if other.keys() & set(one.labels)]
    named = np.sum([misfit(one, {}) for one in touched], axis=0)
    right = np.sum([misfit(one, other) for one in touched], axis=0)
    told = np.isfinite(named) & np.isfinite(right)
    with np.errstate(invalid="ignore"):
        better = (right < _BETTER * named) & (named > sum(len(one.labels) for one in touched) * _MISFIT**2)
    return better, told, np.where(told, named - right, 0.0)


def _other_names(pairs: Iterable[Pair]) -> dict[str, str]:
    """Return label -> label for pairs that are exchanged."""
    return {one: other for pair in pairs for one, other in (pair, pair[::-1])}


def _on_other_side(markers: Markers, right: Array, worn: MarkerSet) -> Iterator[tuple[Pair, Spans]]:
    """Yield the pairs on pelvis and shoulders that lie on each other's side in a part of a trial, and when."""
    places = [f"{side}_{place}" for side in ("left", "right") for place in ("asis", "psis", "acromion")]
    match, there = worn.match(markers.names), {label for place in places for label in marking(worn, [place])}
    rigid = {match[label] for label in there if label in match}
    for pair in (pair for pair in sides(markers.names) if set(pair) <= rigid):
        told = np.asarray(np.isfinite((markers[pair[0]] - markers[pair[1]]) * right).all(axis=1))
        if spans := exchange_spans(markers, [pair], lies_beyond(markers, pair, right), told):
            yield alphabetical(pair), spans


def _turned_hands(markers: Markers, reference: Markers) -> Iterator[tuple[Pair, Spans]]:
    """Yield the wrists whose finger's marker is `mirrored` from where a ``reference`` has it, and when."""
    for side in "LR":
        pair, back = (f"{side}WRA", f"{side}WRB"), back_of_hand(markers, side)
        turned = mirrored(back, middle(back_of_hand(reference, side)))
        if turned.any() and (spans := exchange_spans(markers, [pair], turned, np.isfinite(back))):
            yield pair, spans


def _uncontradicted(
    markers: Markers, static: Markers | None, worn: MarkerSet, seen: Iterable[Pair]
) -> dict[Pair, Spans]:
    """Return the pairs ``seen`` whose exchange in the whole trial makes no rigid group worse than noise."""
    whole: Spans = ((0, markers.time.size),)
    left = {alphabetical(pair): whole for pair in seen if set(pair) <= set(markers.names)}
    frames = np.unique(np.linspace(0, markers.time.size - 1, 2 * _SOME).astype(int))
    while left:
        exchanged = renamed_markers(markers, left)
        before, after = (rigid_groups(one, static or one, worn) for one in (markers, exchanged))
        worse = set()
        for was, now in zip(before, after, strict=True):
            apart = middle(now.misfit(exchanged, {}, frames)) - middle(was.misfit(markers, {}, frames))
            # Sums of squares, too: n markers, `_NOISE` each.
            worse |= set(was.labels) if apart > len(was.labels) * _NOISE**2 else set()
        torn = [pair for pair in left if set(pair) & worse]
        if not torn:
            break
        left = {pair: spans for pair, spans in left.items() if pair not in torn}
    return left


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


def exchange_spans(markers: Markers, pairs: Iterable[Pair], wrong: Mask, told: Mask) -> Spans:
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
        if (
            wrong[start:stop].sum() >= LEAST_EXCHANGED
            and ends[0] is not None
            and ends[1] is not None
            and ends[0] < ends[1]
        ):
            found.append((ends[0], ends[1]))
    return tuple(found)


def _changes(markers: Markers, pairs: Iterable[Pair]) -> Array:
    """Return (T + 1,) 1 where markers go less if they change their names there, 0 where more, NaN where unseen."""
    ways = np.zeros(markers.time.size + 1)
    ways[[0, -1]] = np.nan
    for one, other in ((markers[a], markers[b]) for a, b in pairs):
        straight = np.linalg.norm(np.diff(one, axis=0), axis=1) + np.linalg.norm(np.diff(other, axis=0), axis=1)
        # Way of both markers under their names less that under exchanged ones: positive where exchange is shorter.
        crossing = np.linalg.norm(other[1:] - one[:-1], axis=1) + np.linalg.norm(one[1:] - other[:-1], axis=1)
        ways[1:-1] += straight - crossing
    return np.where(np.isnan(ways), np.nan, np.where(ways > 0, 1.0, 0.0))


def _changed_at(changes: Array, end: int) -> int | None:
    """Return the frame near an ``end`` at which markers change places; the end where unseen; None without."""
    first = max(end - _NEAR, 0)
    near = changes[first : end + _NEAR + 1]
    there = np.flatnonzero(near == 1)
    if there.size:
        return first + int(there[np.argmin(np.abs(first + there - end))])
    return end if np.isnan(near).any() else None


def alphabetical(pair: Pair) -> Pair:
    """Return a pair with its labels in alphabetical order."""
    return (min(pair), max(pair))

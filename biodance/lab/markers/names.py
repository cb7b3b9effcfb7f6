"""What a marker's label says: which landmarks or segments, on which side, it may be. r.ASIS, RASI, R_IAS and RightAsis
are one thing.

The spellings are data: ``anthropometry/marker_names.toml``.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import permutations, product
from typing import TypeVar

from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.spelling import Spelled, plain_labels, readings, readings_of
from biodance.library import locate, read_toml
from biodance.records import SIDES

_MIDLINE = frozenset(name for name in LANDMARKS if not name.startswith(("right_", "left_")))
_WHOLE = {"head_front", "head_back"}
"""Landmarks of the midline that are the mean of a right and a left marker."""
_JOINTS = ("hip", "knee", "ankle")
"""Joints whose bare names stand on both sides in every skeleton of video: HALPE, COCO, OpenPose, BlazePose."""
_SKIN = ("asis", "psis", "knee_medial", "ankle_medial")
"""Ends of landmarks that only a marker has: a trochanter may be called hip beside them."""
_PARTS = re.compile(r"\d+(?:st|nd|rd|th)|\d+|[a-z]+")
"""A number, as an ordinal or not, or a word, within a token."""
_WAYS = 24
"""Ways to cut the tokens of a label into words, beyond which the label says nothing."""
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Meaning:
    """One thing that a label may mean: ``place`` a landmark or segment with its side; ``rank`` 0 for the most usual
    spelling of it.
    """

    place: str
    rank: int


@dataclass(frozen=True)
class _Vocabulary:
    pairs: tuple[tuple[str, str], ...]
    noise: frozenset[str]
    landmarks: Mapping[str, tuple[tuple[str, int], ...]]
    segments: Mapping[str, str]
    words: Mapping[str, tuple[str, ...]]
    composed: Mapping[frozenset[str], tuple[str, ...]]


@cache
def _vocabulary() -> _Vocabulary:
    table = read_toml(locate("anthropometry", "marker_names"))
    kinds = table["regions"] | table["qualities"]
    return _Vocabulary(
        pairs=tuple((right, left) for right, left in table["sides"]["pairs"]),
        noise=frozenset(table["noise"]["words"]),
        landmarks=_gathered(
            (word, (mark, rank)) for mark, some in table["landmarks"].items() for rank, word in enumerate(some)
        ),
        segments={word: segment for segment, some in table["segments"].items() for word in some},
        words=_gathered((word, kind) for kind, some in kinds.items() for word in some),
        composed=_gathered((frozenset(way.split()), mark) for mark, some in table["composed"].items() for way in some),
    )


def _gathered(pairs: Iterable[tuple[_Key, _Value]]) -> dict[_Key, tuple[_Value, ...]]:
    """Return every key with all that stands beside it, in order."""
    found: dict[_Key, tuple[_Value, ...]] = {}
    for key, value in pairs:
        found[key] = (*found.get(key, ()), value)
    return found


def meanings(label: str) -> tuple[Meaning, ...]:
    """Return what a label may mean, the most usual first; nothing where no spelling is known."""
    words = _vocabulary()
    return _meanings(readings(label, words.pairs, words.noise))


def meanings_of(labels: Iterable[str], *, sides: Iterable[tuple[str, str]] = ()) -> dict[str, tuple[Meaning, ...]]:
    """Return label -> what it may mean, the most usual first, read as the whole set of labels is written; labels that
    mean nothing are left out. ``sides`` are words (right, left) that this set uses, beside those that are known.
    """
    return {label: found for label, ways in _read(tuple(labels), tuple(sides)).items() if (found := _meanings(ways))}


def sides_exchanged(sides: Iterable[tuple[str, str]]) -> bool:
    """Return whether words (right, left) are known ones the other way round: the sides are, too."""
    return any((left, right) in _vocabulary().pairs for right, left in sides)


def sides_of(labels: Iterable[str]) -> dict[str, str]:
    """Return label -> "right" or "left", for the labels that say one as the whole set of labels is written."""
    sides = {label: {one.side for one in ways if one.side} for label, ways in _read(tuple(labels)).items()}
    return {label: next(iter(found)) for label, found in sides.items() if len(found) == 1}


def joints_from_video(labels: Iterable[str]) -> tuple[str, ...]:
    """Return the labels, without the subject's name, that name hips, knees and ankles by the bare name of the joint on
    both sides, as software that estimates joints from video does; none where any of the six is missing, or where others
    name a spine of the pelvis or a medial side.
    """
    labels = tuple(labels)
    if any(one.place.endswith(_SKIN) for ways in meanings_of(labels).values() for one in ways[:1]):
        return ()
    said = {label: (one.side, "".join(one.rest)) for label, ways in _read(labels).items() for one in ways if one.side}
    plain, by_word = plain_labels(labels), {word: label for label, word in said.items()}
    wanted = [(side, joint) for joint in _JOINTS for side in SIDES]
    return tuple(plain[by_word[one]] for one in wanted) if by_word.keys() >= set(wanted) else ()


@lru_cache(maxsize=8)
def _read(labels: tuple[str, ...], sides: tuple[tuple[str, str], ...] = ()) -> Mapping[str, tuple[Spelled, ...]]:
    """Return label -> its readings as the whole set of labels is written."""
    words = _vocabulary()
    return readings_of(labels, tuple(dict.fromkeys((*sides, *words.pairs))), words.noise)


def _meanings(ways: Iterable[Spelled]) -> tuple[Meaning, ...]:
    found: dict[str, int] = {}
    for way in ways:
        for place, rank in _places(way.rest, way.side):
            found[place] = min(found.get(place, 10**6), rank + way.cost)
    return tuple(sorted((Meaning(place, rank) for place, rank in found.items()), key=lambda one: one.rank))


def _places(rest: tuple[str, ...], side: str) -> list[tuple[str, int]]:
    """Return the places of one reading: a landmark whose spelling the tokens make in some order, else a segment; a
    number behind a name may count its markers.
    """
    found = _spelled(rest, side)
    stem = (*rest[:-1], rest[-1].rstrip("0123456789"))
    if not found and stem != rest and any(stem):
        found = [(place, rank + 70) for place, rank in _spelled(tuple(filter(None, stem)), side)]
    return found


def _spelled(rest: tuple[str, ...], side: str) -> list[tuple[str, int]]:
    words = _vocabulary()
    joined = ["".join(order) for order in permutations(rest)] if len(rest) <= 3 else ["".join(rest)]
    found = []
    for spelling in joined:
        for landmark, rank in words.landmarks.get(spelling, ()):
            if landmark in _WHOLE or (landmark in _MIDLINE and not side):
                found.append((landmark, rank))
            elif landmark not in _MIDLINE and side:
                found.append((f"{side}_{landmark}", rank))
    named = bool(found)
    for spelling in joined:
        stem = spelling.rstrip("0123456789")
        sided = words.segments.get(stem if side else spelling) or words.segments.get(spelling if side else stem)
        middle = sided in ("pelvis", "trunk_head")
        if sided and (side or (middle and len(spelling) > 1)):
            found.append((sided if middle else f"{side}_{sided}", 500))
    part = next((words.segments[token] for token in rest if len(token) > 2 and token in words.segments), "")
    if part and side and not found:
        found.append((part if part in ("pelvis", "trunk_head") else f"{side}_{part}", 600))
    if side and not named:
        found += [(f"{side}_{landmark}", rank) for landmark, rank in _composed(rest)]
    return found


def _composed(rest: tuple[str, ...]) -> list[tuple[str, int]]:
    """Return landmark and rank for tokens that name a region and a quality of it, whole or in short: KneeLat, lat_kn,
    EpiFemInt. Words that say nothing may stand among them, but no remainder within a token.
    """
    words, kinds_of = _vocabulary(), _vocabulary().words
    parted = [part for token in rest for part in ([token] if token in kinds_of else _PARTS.findall(token))]
    known = [part for part in parted if part in kinds_of or part not in words.segments]  # a word is not cut
    cuts = [cut for token in known if (cut := _cuts(token))]
    found = []
    for way in product(*cuts) if cuts and sum(map(len, cuts)) <= _WAYS else ():
        parts = [part for cut in way for part in cut]
        if sum(map(len, parts)) < 2:
            continue
        for kinds in product(*(kinds_of[part] for part in parts)):
            short = sum(len(part) < 3 for part in parts)
            for landmark in words.composed.get(frozenset(kinds), ()):
                found.append((landmark, 100 + 30 * short + 10 * (len(parted) - len(cuts))))
    return found


def _cuts(token: str) -> list[tuple[str, ...]]:
    """Return the ways to cut a token into known words."""
    if not token:
        return [()]
    ends = [end for end in range(1, len(token) + 1) if token[:end] in _vocabulary().words]
    return [(token[:end], *rest) for end in ends for rest in _cuts(token[end:])]

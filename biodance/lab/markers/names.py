"""What a marker's label says: which landmarks or segments, on which side, it may be. r.ASIS, RASI, R_IAS and RightAsis
are one thing.

The spellings are data: ``anthropometry/marker_names.toml``.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import permutations

from biodance.lab.markers.set_file import LANDMARKS
from biodance.lab.markers.spelling import Reading, readings, readings_of
from biodance.library import locate, read_toml

_MIDLINE = frozenset(name for name in LANDMARKS if not name.startswith(("right_", "left_")))
_WHOLE = {"head_front", "head_back"}
"""Landmarks of the midline that are the mean of a right and a left marker."""


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
    words: Mapping[str, str]
    composed: Mapping[frozenset[str], str]


@cache
def _vocabulary() -> _Vocabulary:
    table = read_toml(locate("anthropometry", "marker_names"))
    spelled: dict[str, list[tuple[str, int]]] = {}
    for landmark, spellings in table["landmarks"].items():
        for rank, spelling in enumerate(spellings):
            spelled.setdefault(spelling, []).append((landmark, rank))
    segments = {word: segment for segment, words in table["segments"].items() for word in words}
    pairs = tuple((right, left) for right, left in table["sides"]["pairs"])
    landmarks = {word: tuple(found) for word, found in spelled.items()}
    single = {
        word: kind for group in ("regions", "qualities") for kind, words in table[group].items() for word in words
    }
    composed = {frozenset(way.split()): landmark for landmark, ways in table["composed"].items() for way in ways}
    return _Vocabulary(pairs, frozenset(table["noise"]["words"]), landmarks, segments, single, composed)


def meanings(label: str) -> tuple[Meaning, ...]:
    """Return what a label may mean, the most usual first; nothing where no spelling is known."""
    words = _vocabulary()
    return _of(words, readings(label, words.pairs, words.noise))


def meanings_of(labels: Iterable[str]) -> dict[str, tuple[Meaning, ...]]:
    """Return label -> what it may mean, the most usual first, read as the whole set of labels is written; labels that
    mean nothing are left out.
    """
    words = _vocabulary()
    every = readings_of(labels, words.pairs, words.noise)
    return {label: found for label, ways in every.items() if (found := _of(words, ways))}


def _of(words: _Vocabulary, ways: Iterable[Reading]) -> tuple[Meaning, ...]:
    found: dict[str, int] = {}
    for way in ways:
        for place, rank in _places(words, way.rest, way.side):
            found[place] = min(found.get(place, 10**6), rank + way.cost)
    return tuple(sorted((Meaning(place, rank) for place, rank in found.items()), key=lambda one: one.rank))


def _places(words: _Vocabulary, rest: tuple[str, ...], side: str) -> list[tuple[str, int]]:
    """Return the places of one reading: a landmark whose spelling the tokens make in some order, else a segment."""
    joined = ["".join(order) for order in permutations(rest)] if len(rest) <= 3 else ["".join(rest)]
    found = []
    for spelling in joined:
        for landmark, rank in words.landmarks.get(spelling, ()):
            if landmark in _WHOLE or (landmark in _MIDLINE and not side):
                found.append((landmark, rank))
            elif landmark not in _MIDLINE and side:
                found.append((f"{side}_{landmark}", rank))
    if found:
        return found
    split = [part for token in rest for part in re.split(r"(?<=[a-z])(?=\d)|(?<=\d)(?=[a-z])", token)]
    kinds = frozenset(words.words[part] for part in split if part in words.words)
    if side and kinds in words.composed:
        return [(f"{side}_{words.composed[kinds]}", 100)]
    for spelling in joined:
        segment = words.segments.get(re.sub(r"\d+$", "", spelling)) or words.segments.get(spelling)
        middle = segment in ("pelvis", "trunk_head")
        if segment and (side or middle):
            return [(segment if middle else f"{side}_{segment}", 500)]
    return []

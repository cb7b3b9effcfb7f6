"""What a marker's label says: which landmarks or segments, on which side, it may be. r.ASIS, RASI, R_IAS and RightAsis
are one thing. The spellings are data: ``anthropometry/marker_names.toml``.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import islice, permutations, product

from biodance.lab.markers.sets import LANDMARKS
from biodance.library import locate, read_toml
from biodance.records import SIDES, grouped

_SHARED = 0.8
"""Share of the labels that begin alike before the beginning is taken for the subject's name."""
_PAIRS = 2  # Pairs of mirror images that make a way to say the side one of this set
_UNLABELLED = re.compile(r"^(\*\s*\d*|u\d+|(un(label|name|known|ident)|uname|uncertain|traj).*)$", re.IGNORECASE)
_COMPUTED = re.compile(
    r"[hkaesw]_?jc\d?$|cent(re|er|ro)\w*$|jointcent|(?<![a-z])com$|mid_?p(oi)?nt|virtual|"
    r"mid_?(asis?|hip|pelvis|knee|ankle|shoulder|trunk)$",
    re.IGNORECASE,
)
"""Points that software computes from markers: joint centres, middles, centres of mass."""


@dataclass(frozen=True)
class _Spelled:
    """One way to read a label: ``side`` "right", "left" or ""; ``rest`` the tokens without it; ``cost`` of reading it
    so; ``way`` how the side was said: where, and with which pair of words.
    """

    side: str
    rest: tuple[str, ...]
    cost: int = 0
    way: tuple[str, str, str] = ("", "", "")


def plain_labels(labels: Iterable[str]) -> dict[str, str]:
    """Return label -> label without the subject's name: without what stands before a colon, and without a beginning
    and an ending that nearly all labels share. Labels of unlabelled and of computed points are left out.
    """
    given = {label: label.rpartition(":")[2].strip() for label in labels}
    # the four points that are the axes of a bone end so
    bones = {
        name[:-1]
        for name in given.values()
        if not name[-2:-1].isdigit()
        and any({name[:-1] + end for end in ends} <= set(given.values()) for ends in ("0123", "OALP"))
    }
    given = {label: name for label, name in given.items() if name and not _is_no_marker(name, bones)}
    shared = _beginning(list(given.values()))
    given = {label: name.removeprefix(shared) or name for label, name in given.items()}
    # the last word after a separator (_study, _pt) that nearly all names end with
    ends = Counter(found[0] for name in given.values() if (found := re.search(r"(?<=.)[\W_][^\W\d_]+$", name)))
    ending = next((end for end, times in ends.items() if times >= max(_SHARED * len(given), 4)), "")
    return {label: name.removesuffix(ending) or name for label, name in given.items()}


def _is_no_marker(name: str, bones: set[str]) -> bool:
    """Return whether a label names no marker: an unlabelled point, one that software computes, an axis of a bone."""
    return bool(_UNLABELLED.match(name) or _COMPUTED.search(name)) or (name[:-1] in bones and name[-1:] in "0123OALP")


def _beginning(names: Sequence[str]) -> str:
    """Return what nearly all names begin with: signs and a separator, letters, a number, a small letter."""
    counts = Counter(name[:end] for name in names for end in range(1, len(name)))
    often = [start for start, times in counts.items() if times >= max(_SHARED * len(names), 4)]
    capital = sum(name[1:2].isupper() for name in names) >= _SHARED * len(names)
    end = re.compile(r".*(.[\W_]|\d\d)|\D{3,}" + ("|[a-z]" if capital else ""), re.DOTALL)
    return max((start for start in often if end.fullmatch(start)), key=len, default="")


def _tokens_of(label: str) -> tuple[str, ...]:
    """Return the words of a label in small letters without accents, split at separators and capitals."""
    letters = {"ß": "ss", "ø": "o", "æ": "ae", "œ": "oe", "ł": "l"}
    spoken = "".join(letters.get(sign, sign) for sign in label)
    flat = "".join(sign for sign in unicodedata.normalize("NFKD", spoken) if not unicodedata.combining(sign))
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", flat)
    return tuple(token for token in re.split(r"[^a-z0-9]+", spaced.lower()) if token)


def readings(label: str, pairs: Iterable[tuple[str, str]], noise: frozenset[str]) -> list[_Spelled]:
    """Return the ways to take a side from one label, with ``pairs`` (right, left); ``noise`` says nothing."""
    tokens = _tokens_of(label)
    kept = tuple(token for token in tokens if token not in noise) or tokens
    whole = {given: "".join(given) for given in (kept, tokens)}
    out = [_Spelled("", given) for given in whole]
    for right, left in pairs:
        for word, side in ((right, "right"), (left, "left")):
            for given, text in whole.items():
                out += _sided(given, word, side, (right, left)) if word in text else ()
    return [one for one in dict.fromkeys(out) if any(one.rest)]


def _sided(given: tuple[str, ...], word: str, side: str, pair: tuple[str, str]) -> list[_Spelled]:
    """Return the readings of tokens in which ``word`` says the side: as a token, at the beginning or at the end."""
    usual = 0 if pair in (("r", "l"), ("right", "left")) else 3
    told = 0 if len(word) > 1 else usual
    whole, count = "".join(given), len(given)
    out = []
    for i, token in enumerate(given):
        if token == word and count > 1:
            where = "first" if i == 0 else "last" if i == count - 1 else "within"
            out.append(_Spelled(side, given[:i] + given[i + 1 :], told, (where, *pair)))
    if given[0] != word and given[0].startswith(word):
        rest = (given[0][len(word) :], *given[1:])
        out += [_Spelled(side, one, usual, ("first", *pair)) for one in dict.fromkeys((rest, ("".join(rest),)))]
    if given[-1] != word and given[-1].endswith(word):
        rest = (*given[:-1], given[-1][: -len(word)])
        out += [_Spelled(side, one, usual + 1, ("last", *pair)) for one in dict.fromkeys((rest, ("".join(rest),)))]
    elif count > 1 and whole.endswith(word) and not given[-1].endswith(word):
        out.append(_Spelled(side, (whole[: -len(word)],), usual + 1, ("last", *pair)))
    return out


def side_words(mirrored: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the pairs of words (right, left) by which the labels of mirror images (right, left) differ, the most usual
    first: what this laboratory says for right and left, in whatever language.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for right, left in mirrored:
        counts.update(set(_differences(right, left)))
    return [pair for pair, times in counts.most_common(4) if times > _PAIRS]


def _differences(one: str, other: str) -> list[tuple[str, str]]:
    """Return by what two labels differ: the shortest remainders, and the whole words that hold them."""
    words = [(a, b) for a, b in zip(_tokens_of(one), _tokens_of(other), strict=False) if a != b]
    whole = words if len(words) == 1 else []
    one, other = one.lower(), other.lower()
    # From the first sign that differs to the last.
    start = next((k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
    rest = one[start:], other[start:]
    end = next((k for k, (a, b) in enumerate(zip(rest[0][::-1], rest[1][::-1], strict=False)) if a != b), 0)
    short = rest[0][: len(rest[0]) - end], rest[1][: len(rest[1]) - end]
    return [pair for pair in (short, *whole) if all(part.isalnum() for part in pair)]


def _mirrored(every: Mapping[str, Iterable[_Spelled]]) -> dict[tuple[str, str, str], set[str]]:
    """Return way to say the side -> labels that have a mirror image when read so."""
    sides: dict[tuple[tuple[str, str, str], str], dict[str, set[str]]] = {}
    for label, found in every.items():
        for one in found:
            if one.side:
                sides.setdefault((one.way, " ".join(one.rest)), {}).setdefault(one.side, set()).add(label)
    out: dict[tuple[str, str, str], set[str]] = {}
    for (way, _), on in sides.items():
        if len(on) == 2:
            out.setdefault(way, set()).update(*on.values())
    return out


_MIDLINE = frozenset(name for name in LANDMARKS if not name.startswith(("right_", "left_")))
_UNPAIRED = ("pelvis", "trunk_head")
"""Segments that have no side."""


@dataclass(frozen=True)
class Meaning:
    """One thing that a label may mean: ``place`` a landmark or segment with its side; ``rank`` 0 = most usual."""

    place: str
    rank: int


@dataclass(frozen=True)
class _Vocabulary:
    pairs: tuple[tuple[str, str], ...]
    noise: frozenset[str]
    landmarks: Mapping[str, Sequence[tuple[str, int]]]
    segments: Mapping[str, str]
    words: Mapping[str, Sequence[str]]
    composed: Mapping[frozenset[str], Sequence[str]]


@cache
def _vocabulary() -> _Vocabulary:
    table = read_toml(locate("anthropometry", "marker_names"))
    kinds = table["regions"] | table["qualities"]
    return _Vocabulary(
        pairs=tuple((right, left) for right, left in table["sides"]["pairs"]),
        noise=frozenset(table["noise"]["words"]),
        landmarks=grouped(
            (word, (mark, rank)) for mark, some in table["landmarks"].items() for rank, word in enumerate(some)
        ),
        segments={word: segment for segment, some in table["segments"].items() for word in some},
        words=grouped((word, kind) for kind, some in kinds.items() for word in some),
        composed=grouped((frozenset(way.split()), mark) for mark, some in table["composed"].items() for way in some),
    )


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
    # Only a marker marks these: a trochanter may be called hip beside them.
    on_the_skin = ("asis", "psis", "knee_medial", "ankle_medial")
    if any(one.place.endswith(on_the_skin) for ways in meanings_of(labels).values() for one in ways[:1]):
        return ()
    said = {label: (one.side, "".join(one.rest)) for label, ways in _read(labels).items() for one in ways if one.side}
    plain, by_word = plain_labels(labels), {word: label for label, word in said.items()}
    # Bare names that stand on both sides in every skeleton of video: HALPE, COCO, OpenPose, BlazePose.
    wanted = [(side, joint) for joint in ("hip", "knee", "ankle") for side in SIDES]
    return tuple(plain[by_word[one]] for one in wanted) if by_word.keys() >= set(wanted) else ()


@lru_cache(maxsize=8)
def _read(labels: tuple[str, ...], sides: tuple[tuple[str, str], ...] = ()) -> Mapping[str, tuple[_Spelled, ...]]:
    """Return label -> its readings as the whole set of labels is written."""
    words = _vocabulary()
    pairs = tuple(dict.fromkeys((*sides, *words.pairs)))
    every = {label: readings(name, pairs, words.noise) for label, name in plain_labels(labels).items()}
    out: dict[str, tuple[_Spelled, ...]] = {}
    ways: list[tuple[str, str, str]] = []
    while True:  # the way to write sides that makes most mirror images first
        left = {label: found for label, found in every.items() if label not in out}
        mirrored = _mirrored(left)
        if not mirrored:
            break
        way = max(mirrored, key=lambda one: (len(mirrored[one]), one[0] == "first", len(one[1])))
        if len(mirrored[way]) < 2 * _PAIRS and ways:
            break
        ways.append(way)
        out |= {label: tuple(one for one in every[label] if one.way == way) for label in mirrored[way]}
    for label in every.keys() - out.keys():
        out[label] = tuple(one for one in every[label] if not one.side or not ways or one.way in ways)
    return {label: out[label] for label in every}


def _meanings(ways: Iterable[_Spelled]) -> tuple[Meaning, ...]:
    found: dict[str, int] = {}
    for way in ways:
        # As it is spelled; where that says nothing, without the number behind it.
        stem = tuple(filter(None, (*way.rest[:-1], way.rest[-1].rstrip("0123456789"))))
        places, more = _spelled(way.rest, way.side), 0
        if not places and stem and stem != way.rest:
            places, more = _spelled(stem, way.side), 70
        for place, rank in places:
            found[place] = min(found.get(place, 10**6), rank + more + way.cost)
    return tuple(sorted((Meaning(place, rank) for place, rank in found.items()), key=lambda one: one.rank))


def _spelled(rest: tuple[str, ...], side: str) -> list[tuple[str, int]]:
    """Return places and ranks: landmarks spelled whole, then segments; with a side, also a segment that one token
    names, and landmarks composed of a region and a quality.
    """
    words = _vocabulary()
    joined = ["".join(order) for order in permutations(rest)] if len(rest) <= 3 else ["".join(rest)]
    spelled = [one for spelling in joined for one in words.landmarks.get(spelling, ())]
    # a landmark on the midline has no side, unless it is the mean of both; every other one has one
    landmarks = [
        (landmark if landmark in _MIDLINE else f"{side}_{landmark}", rank)
        for landmark, rank in spelled
        if landmark in ("head_front", "head_back") or bool(side) != (landmark in _MIDLINE)
    ]
    found = landmarks + [(place, 500) for spelling in joined if (place := _segment_spelled(spelling, side))]
    if side and not found:
        parts = (words.segments[token] for token in rest if len(token) > 2 and token in words.segments)
        found = [(_segment_on(side, part), 600) for part in islice(parts, 1)]
    if side and not landmarks:
        found += [(f"{side}_{landmark}", rank) for landmark, rank in _composed(rest)]
    return found


def _segment_on(side: str, segment: str) -> str:
    return segment if segment in _UNPAIRED else f"{side}_{segment}"


def _segment_spelled(spelling: str, side: str) -> str:
    """Return the segment that a spelling names, with or without the number behind it; "" if none, or if its side is
    not known.
    """
    segments, stem = _vocabulary().segments, spelling.rstrip("0123456789")
    first, second = (stem, spelling) if side else (spelling, stem)
    segment = segments.get(first) or segments.get(second) or ""
    known = side or (segment in _UNPAIRED and len(spelling) > 1)
    return _segment_on(side, segment) if segment and known else ""


def _composed(rest: tuple[str, ...]) -> list[tuple[str, int]]:
    """Return landmark and rank for tokens that name a region and a quality of it: KneeLat, lat_kn, EpiFemInt."""
    words, kinds_of = _vocabulary(), _vocabulary().words
    # Numbers, as ordinals or not, and words within a token.
    number_or_word = re.compile(r"\d+(?:st|nd|rd|th)|\d+|[a-z]+")
    parted = [part for token in rest for part in ([token] if token in kinds_of else number_or_word.findall(token))]
    known = [part for part in parted if part in kinds_of or part not in words.segments]  # a word is not cut
    cuts = [cut for token in known if (cut := _cuts(token))]
    found = []
    # A label that can be cut in more than 24 ways says nothing.
    for way in product(*cuts) if cuts and sum(map(len, cuts)) <= 24 else ():
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
    # Each known beginning, and all ways to cut what is behind it.
    ends = [end for end in range(1, len(token) + 1) if token[:end] in _vocabulary().words]
    return [(token[:end], *rest) for end in ends for rest in _cuts(token[end:])]

"""How one laboratory writes its labels, learned from all of them together: what all share (a subject's name), and where
and how they say the side. RKNE and LKNE, KNEE-dx and KNEE-sx, CLD and CLG are pairs of mirror images, and only in their
own set.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

_SHARED = 0.8
"""Share of the labels that begin alike before the beginning is taken for the subject's name."""
_PAIRS = 2
"""Pairs of mirror images that make a way to say the side one of this set."""
_UNLABELLED = re.compile(r"^(\*\s*\d*|u\d+|(un(label|name|known|ident)|uname|uncertain|traj).*)$", re.IGNORECASE)
_COMPUTED = re.compile(
    r"[hkaesw]_?jc\d?$|cent(re|er|ro)\w*$|jointcent|(?<![a-z])com$|mid_?p(oi)?nt|virtual|"
    r"mid_?(asis?|hip|pelvis|knee|ankle|shoulder|trunk)$",
    re.IGNORECASE,
)
"""Points that software computes from markers: joint centres, middles, centres of mass."""
_AXES = ({"0", "1", "2", "3"}, {"O", "A", "L", "P"})
"""Last signs of the four points that are the axes of a bone."""
_SPOKEN = {"ß": "ss", "ø": "o", "æ": "ae", "œ": "oe", "ł": "l"}


@dataclass(frozen=True)
class Spelled:
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
    bones = {
        name[:-1]
        for name in given.values()
        if not name[-2:-1].isdigit() and any({name[:-1] + end for end in ends} <= set(given.values()) for ends in _AXES)
    }
    given = {label: name for label, name in given.items() if name and not _is_no_marker(name, bones)}
    shared = _beginning(list(given.values()))
    given = {label: name.removeprefix(shared) or name for label, name in given.items()}
    ending = _ending(list(given.values()))
    return {label: name.removesuffix(ending) or name for label, name in given.items()}


def _is_no_marker(name: str, bones: set[str]) -> bool:
    """Return whether a label names no marker: an unlabelled point, one that software computes, an axis of a bone."""
    return bool(_UNLABELLED.match(name) or _COMPUTED.search(name)) or (name[:-1] in bones and name[-1:] in "0123OALP")


def _beginning(names: Sequence[str]) -> str:
    """Return what nearly all names begin with: some signs and a separator, three letters, a number of two digits, or a
    small letter before a capital.
    """
    counts = Counter(name[:end] for name in names for end in range(1, len(name)))
    often = [start for start, times in counts.items() if times >= max(_SHARED * len(names), 4)]
    capital = sum(name[1:2].isupper() for name in names) >= _SHARED * len(names)
    end = re.compile(r".*(.[\W_]|\d\d)|\D{3,}" + ("|[a-z]" if capital else ""), re.DOTALL)
    return max((start for start in often if end.fullmatch(start)), key=len, default="")


def _ending(names: Sequence[str]) -> str:
    """Return the last word after a separator (_study, _pt) that nearly all names end with."""
    ends = Counter(found[0] for name in names if (found := re.search(r"(?<=.)[\W_][^\W\d_]+$", name)))
    often = [end for end, times in ends.items() if times >= max(_SHARED * len(names), 4)]
    return often[0] if often else ""


def tokens_of(label: str) -> tuple[str, ...]:
    """Return the words of a label in small letters without accents: split at separators and where a word begins with a
    capital.
    """
    spoken = "".join(_SPOKEN.get(sign, sign) for sign in label)
    flat = "".join(sign for sign in unicodedata.normalize("NFKD", spoken) if not unicodedata.combining(sign))
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", flat)
    return tuple(token for token in re.split(r"[^a-z0-9]+", spaced.lower()) if token)


def readings(label: str, pairs: Iterable[tuple[str, str]], noise: frozenset[str]) -> list[Spelled]:
    """Return the ways to take a side from one label, with the words of ``pairs`` (right, left); ``noise`` are words
    that say nothing.
    """
    tokens = tokens_of(label)
    kept = tuple(token for token in tokens if token not in noise) or tokens
    out = [Spelled("", given) for given in dict.fromkeys((kept, tokens))]
    for right, left in pairs:
        for word, side in ((right, "right"), (left, "left")):
            for given in dict.fromkeys((kept, tokens)):
                out += _sided(given, word, side, (right, left))
    return [one for one in dict.fromkeys(out) if any(one.rest)]


def _sided(given: tuple[str, ...], word: str, side: str, pair: tuple[str, str]) -> list[Spelled]:
    """Return the readings of tokens in which ``word`` says the side: as a token, at the beginning or at the end."""
    usual = 0 if pair in (("r", "l"), ("right", "left")) else 3
    told = 0 if len(word) > 1 else usual
    whole, count = "".join(given), len(given)
    out = []
    for i, token in enumerate(given):
        if token == word and count > 1:
            where = "first" if i == 0 else "last" if i == count - 1 else "within"
            out.append(Spelled(side, given[:i] + given[i + 1 :], told, (where, *pair)))
    if given[0] != word and given[0].startswith(word):
        rest = (given[0][len(word) :], *given[1:])
        out += [Spelled(side, one, usual, ("first", *pair)) for one in dict.fromkeys((rest, ("".join(rest),)))]
    if given[-1] != word and given[-1].endswith(word):
        rest = (*given[:-1], given[-1][: -len(word)])
        out += [Spelled(side, one, usual + 1, ("last", *pair)) for one in dict.fromkeys((rest, ("".join(rest),)))]
    elif count > 1 and whole.endswith(word) and not given[-1].endswith(word):
        out.append(Spelled(side, (whole[: -len(word)],), usual + 1, ("last", *pair)))
    return out


def readings_of(
    labels: Iterable[str], pairs: Sequence[tuple[str, str]], noise: frozenset[str]
) -> dict[str, tuple[Spelled, ...]]:
    """Return label -> its readings as this set writes its sides: the way that makes most pairs of mirror images first,
    then among the other labels the next. A label with a mirror image is read in no other way.
    """
    every = {label: readings(name, pairs, noise) for label, name in plain_labels(labels).items()}
    out: dict[str, tuple[Spelled, ...]] = {}
    ways: list[tuple[str, str, str]] = []
    while True:
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
        own = tuple(one for one in every[label] if not one.side or not ways or one.way in ways)
        out[label] = own
    return {label: out[label] for label in every}


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
    words = [(a, b) for a, b in zip(tokens_of(one), tokens_of(other), strict=False) if a != b]
    whole = words if len(words) == 1 else []
    one, other = one.lower(), other.lower()
    start = next((k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
    rest = one[start:], other[start:]
    end = next((k for k, (a, b) in enumerate(zip(rest[0][::-1], rest[1][::-1], strict=False)) if a != b), 0)
    short = rest[0][: len(rest[0]) - end], rest[1][: len(rest[1]) - end]
    return [pair for pair in (short, *whole) if all(part.isalnum() for part in pair)]


def _mirrored(every: Mapping[str, Iterable[Spelled]]) -> dict[tuple[str, str, str], set[str]]:
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

"""A finding as a person is told of it, in the words of its cause (`Checked.words`): the fact with its size, what to do,
and a name for it where it is only one of several.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.display import digits, listed, shown_unit, spaced
from biodance.identification.knowledge import SIGMAS

_SHORT = 8
"""Words of advice that fit into a headline."""
_LISTED = "See what stands below."


@dataclass(frozen=True)
class SpokenFinding:
    """A finding as a person is told of it: the ``fact`` without its interval and with it, and what to ``do``."""

    plain: str
    fact: str
    do: str


def spoken(finding: Finding, others: Sequence[Finding] = ()) -> SpokenFinding:
    """Return a finding in words; ``others`` of the same effect without a size of their own are told together."""
    words, size = finding.cause.words, _size(finding.parameters)
    if words is None:
        name = spaced(finding.effect)
        at = f" at {place_in_words(finding.target)}" if finding.target else ""
        do = finding.advice.split(". ")[0].rstrip(".")
        fact = f"a {name} was found{at}{f', {size.value}' if size.value else ''}"
        return SpokenFinding(fact, f"{fact}{size.between}", f"{do}." if 0 < len(do.split()) <= _SHORT else _LISTED)
    whole, _, channel = finding.target.rpartition(":")
    first, _, other = channel.partition("->")
    of = listed(finding.trials) or place_in_words(finding.target)
    pairs = listed([one.target.replace("/", " and ") or "something" for one in (finding, *others)])
    shown = {
        "it": place_in_words(finding.target.partition("->")[0]) or "something",
        "plate": place_in_words(whole) if whole else "the plate",
        "axis": first,
        "other": other,
        "forces": f"the forces of {of} are" if of else "the forces are",
        "pairs": pairs,
        "factor": f" by a factor of {digits(finding.parameters[0].value, 2)}" if finding.parameters else "",
        "size": size.value or "somewhat",
        "more": words.more[int(size.negative)],
    }
    where = f" in {listed(finding.trials)}" if finding.trials and "{forces}" not in words.fact else ""
    plain, fact = (words.fact.format(**shown, between=between) + where for between in ("", size.between))
    return SpokenFinding(plain, fact, words.do)


def names_markers(finding: Finding) -> bool:
    """Return whether findings of this effect are told by their markers, several together."""
    return finding.cause.words is not None and "{pairs}" in finding.cause.words.fact


def alternatives(finding: Finding) -> list[str]:
    """Return what else a finding may be, each once, in plain words: another place of the same cause, or another
    cause.
    """
    named = [_alternative(alias, alias.effect == finding.effect) for alias in finding.set[1:]]
    return list(filter(None, dict.fromkeys(named)))


def place_in_words(target: str) -> str:
    """Return where a cause is, in words: ``Fz of plate 2``, ``left forearm``, ``RKNE``."""
    plate, _, channel = target.rpartition(":")
    if re.fullmatch(r"plate\d+", channel):
        plate, channel = channel, ""
    if plate:
        name = re.sub(r"(\D)(\d)", r"\1 \2", plate, count=1)
        return f"{channel} of {name}" if channel else name
    return (
        channel.replace("forearm_hand", "forearm")
        .replace("trunk_head", "trunk")
        .replace("_", " ")
        .replace("/", " and ")
    )


class _Size(NamedTuple):
    value: str = ""
    between: str = ""
    negative: bool = False


def _size(parameters: Sequence[Estimate]) -> _Size:
    """Return the size of a cause and its 95 % interval in words, without sign: that of its first parameter, or the
    length of a vector.
    """
    if not parameters:
        return _Size()
    first = parameters[0]
    factor, unit = shown_unit(first.unit)
    if first.name.endswith("_x"):
        values, sds = np.array([(p.value, p.sd) for p in parameters[:3]]).T
        value = float(np.linalg.norm(values))
        reach = SIGMAS * float(np.linalg.norm(values * sds)) / value if value else float("nan")
        low, high = value - reach, value + reach
    else:
        (low, high), value = first.interval, first.value
    if value < 0:
        low, high = -high, -low
    told = f"{digits(factor * abs(value), 2)} {unit}".strip()
    if not np.isfinite([low, high]).all():
        return _Size(told, "", value < 0)
    return _Size(told, f" ({digits(factor * max(low, 0.0), 2)} to {digits(factor * high, 2)})", value < 0)


def _alternative(alias: Alias, same: bool) -> str:
    """Return a look-alike in words, by its place where it is the same cause elsewhere."""
    if same:
        whole, _, channel = alias.target.rpartition(":")
        return place_in_words(whole if whole and channel in "xyz" else alias.target)
    known = alias.cause.words
    return known.alternative if known else f"a {spaced(alias.effect)}"

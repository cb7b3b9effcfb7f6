"""Findings and reasons in words, the same wherever they are told: the one room in which a `Reason` becomes a sentence.

`in_words` names a finding with its places and sizes; `spoken` tells it in the words of its cause (`Checked.words`): the
fact with its size, what to do, and a name for it where it is only one of several (`alternatives`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from biodance.diagnosis.consequence import LIMIT
from biodance.diagnosis.diagnosis import Diagnosis, Estimate, Finding
from biodance.diagnosis.reasons import Reason
from biodance.display import cause_in_words, digits, listed, shown_unit, spaced
from biodance.effects.added_mass import AddedMass
from biodance.identification.added_mass import LoadSearch
from biodance.identification.knowledge import SIGMAS

LOAD = AddedMass.name


def in_words(finding: Finding) -> str:
    """Return a cause with its place, or all places that it may be at, and its size: ``plate gain Fz (gain 6 ± 0.2 %)``;
    a size that is hardly known is said to be (`Estimate.known`). A load is told by its mass; where its centre lies
    is said beside its segment.
    """
    name = f"{cause_in_words(finding.effect, finding.target)}{_elsewhere(finding)}"
    name += f" in {listed(finding.trials)}" if finding.trials else ""
    told = finding.parameters[:1] if finding.effect == LOAD else finding.parameters
    known = [p.known for p in finding.parameters if p.sd == p.sd]
    if not known:
        return name
    signs = finding.cause.words.signs if finding.cause.words else ("", "")
    sure = signs[told[0].value < 0] if any(known) else "its size is hardly known"
    sizes = []  # each parameter with its 95 % interval: gain 6 ± 0.4 %
    for size in told:
        factor, unit = shown_unit(size.unit)
        value, reach = digits(factor * size.value, 2), digits(SIGMAS * factor * size.sd, 1)
        sizes.append(f"{spaced(size.name)} {value} ± {reach} {unit}".strip())
    return f"{name} ({', '.join(sizes)}{sure and f'; {sure}'})"


def _elsewhere(finding: Finding) -> str:
    """Return where else the same cause may be, to go on its place with."""
    places = [cause_in_words("", alias.target) for alias in finding.set[1:] if alias.effect == finding.effect]
    return f" or {listed(places)}" if any(places) else ""


def cause_of(checked: str, findings: Sequence[Finding]) -> str:
    """Return the first finding that may explain a check of that name; "" for none."""
    found = next((one for one in findings if checked.startswith(one.cause.explains)), None)
    return f"{cause_in_words(found.effect, found.target)}{_elsewhere(found)}" if found else ""


def explained(cause: str) -> str:
    """Return the sentence that points from a check or a doubt to a cause (`cause_of`) that was found."""
    return f"{first_upper(cause)}, which was found, may explain it."


def first_upper(text: str) -> str:
    """Return ``text`` with a capital first letter and nothing else changed."""
    return text[:1].upper() + text[1:]


_LISTED = "See what stands below."


@dataclass(frozen=True)
class SpokenFinding:
    """A finding as a person is told of it: the ``fact`` without its interval and with it, and what to ``do``."""

    plain: str
    fact: str
    do: str


def spoken(finding: Finding, others: Sequence[Finding] = (), *, proven: bool = False) -> SpokenFinding:
    """Return a finding in words; ``others`` of the same effect without a size of their own are told together. Only a
    correction that is ``proven`` is offered.
    """
    words, size = finding.cause.words, _size(finding.parameters)
    if words is None:
        name = spaced(finding.effect)
        at = f" at {place_in_words(finding.target)}" if finding.target else ""
        do = finding.advice.split(". ")[0].rstrip(".")
        fact = f"a {name} was found{at}{f', {size.value}' if size.value else ''}"
        # Advice of at most eight words fits into a headline.
        return SpokenFinding(fact, f"{fact}{size.between}", f"{do}." if 0 < len(do.split()) <= 8 else _LISTED)
    whole, _, channel = finding.target.rpartition(":")
    first, _, other = channel.partition("->")
    of = listed(finding.trials) or place_in_words(finding.target)
    pairs = listed([one.target.replace("/", " and ") or "something" for one in (finding, *others)])
    shown = {
        "it": place_in_words(words.called(finding.target).partition("->")[0]) or "something",
        "opposite": "right" if finding.target.startswith("left") else "left",
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
    return SpokenFinding(plain, fact, words.do.format(accept=", or accept the correction" if proven else ""))


def names_markers(finding: Finding) -> bool:
    """Return whether findings of this effect are told by their markers, several together."""
    return finding.cause.words is not None and "{pairs}" in finding.cause.words.fact


def alternatives(finding: Finding) -> list[str]:
    """Return what else a finding may be, each once, in plain words: the same cause elsewhere, or another cause."""
    named = []
    for alias in finding.set[1:]:
        if alias.effect == finding.effect:
            whole, _, channel = alias.target.rpartition(":")
            place = place_in_words(whole if whole and channel in "xyz" else alias.target)
            named.append(place.replace("->", " into "))
        else:
            known = alias.cause.words
            named.append(known.alternative if known else f"a {spaced(alias.effect)}")
    return list(filter(None, dict.fromkeys(named)))


def place_in_words(target: str) -> str:
    """Return where a cause is, in words: ``Fz of plate 2``, ``left forearm``, ``RKNE``."""
    plate, _, channel = target.rpartition(":")
    if re.fullmatch(r"plate\d+", channel):
        plate, channel = channel, ""
    if plate:
        name = re.sub(r"(\D)(\d)", r"\1 \2", plate, count=1)
        return f"{channel} of {name}" if channel else name
    plain = channel.replace("forearm_hand", "forearm").replace("trunk_head", "trunk")
    return plain.replace("_", " ").replace("/", " and ")


class _Size(NamedTuple):
    value: str = ""
    between: str = ""
    negative: bool = False


def _size(parameters: Sequence[Estimate]) -> _Size:
    """Return size and 95 % interval in words, without sign: of the first parameter, or of a vector's length."""
    if not parameters:
        return _Size()
    first = parameters[0]
    factor, unit = shown_unit(first.unit)
    if first.name.endswith("_x"):
        values, sds = np.array([(p.value, p.sd) for p in parameters[:3]]).T
        value = float(np.linalg.norm(values))
        # sd of |v| to first order: |v| = sqrt(v'v), so d|v| = v'dv / |v|
        reach = SIGMAS * float(np.linalg.norm(values * sds)) / value if value else float("nan")
        low, high = value - reach, value + reach
    else:
        (low, high), value = first.interval, first.value
    if value < 0:
        low, high = -high, -low
    told = f"{digits(factor * abs(value), 2)} {unit}".strip()
    between = f" ({digits(factor * max(low, 0.0), 2)} to {digits(factor * high, 2)})"
    return _Size(told, between if np.isfinite([low, high]).all() else "", value < 0)


_SENTENCES = {
    Reason.UNUSUAL_BODY: (
        "What the plates measured fits only a body that is more unlike the table than people are: the person may be, a "
        "joint may lie elsewhere than the markers say, or a load that nobody noted, a gain or a wrong declared mass "
        "hides in it."
    ),
    Reason.OUTSIDE_TOLERANCES: (
        "What the plates measured fits only if something that is small in every laboratory is many times as large "
        "here, and none of the causes looked for is it."
    ),
    Reason.ONLY_STANDING: (
        "Only quiet standing could be compared with the whole body: sway, soft tissue and a plate's zero look alike "
        "there, so this comparison names no cause that has a size. A few squats on the plates tell them apart."
    ),
    Reason.NOT_COMPARED: "No movement could be compared with a body.",
    Reason.MOVEMENT_NOT_JUDGED: "None of the movement could be judged, and standing still tells little.",
    Reason.PERSON_UNKNOWN: "Mass or stature is not known, so there is no body.",
    Reason.BODY_NOT_SCALED: "The body comes from stature alone, so its forces are too unsure to name a cause.",
    Reason.BODY_DOUBTFUL: "The forces fit this body, but {about}.",
    Reason.LIMIT_BROKEN: "No cause was found for what is outside its limit: {about}.",
    Reason.UNDESCRIBED_JOINTS: "The body moves at joints ({about}) for which nobody has learned yet what is usual.",
    Reason.TOLERANCES_DO_NOT_HOLD: "Its markers move more on the body than where tolerances were learned.",
    Reason.CONTRADICTED: "What the forces resemble rests on one step, or kept data, or force and trunk contradict it.",
    Reason.NOT_SURE: "That something is wrong is more probable than not, and no cause of it is sure.",
}


def reason_notes(one: Diagnosis) -> tuple[str, ...]:
    """Return why a diagnosis says no more, and what it only resembles, as sentences for the reader."""
    notes = [
        _left(one) if reason is Reason.FORCES_LEFT else _SENTENCES[reason].format(about=listed(about))
        for reason, about in one.why.items()
    ]
    if one.resembles:
        notes.append(f"It resembles {' and '.join(map(in_words, one.resembles))}, which is not enough.")
    return tuple(notes)


def _left(one: Diagnosis) -> str:
    """Return where what is left is largest, with its size."""
    row = next((row for row in one.adequacy if row.matters and row.z > LIMIT), None)
    if row is None:
        return "What is left of the forces is unlike sessions without fault."
    return (
        f"{row.channel} at {row.band_hz[0]:g} to {row.band_hz[1]:g} Hz is {row.size:.2g} {row.unit} off "
        f"({row.z:.1f} standard deviations of sessions without fault), most in {row.trial} around {row.second:.1f} s."
    )


_ADVICE = "Compare with an unloaded session of the same person (--reference)."


def say_load(search: LoadSearch) -> str:
    """Return what the search found in words: how heavy, where, how sure, or why that cannot be told."""
    if search.doubts:
        return f"Whether the subject carries a load cannot be told: {' '.join(search.doubts)}"
    return {"found": _found, "none": _none, "cannot tell": _unclear}[search.status](search)


def _found(search: LoadSearch) -> str:
    best = search.best
    x, y, z = (f"{1000 * value:.0f}" for value in best.place)
    several = len(search.segments) > 1
    if_there = f" if it is on the {spaced(best.segment)}" if several else ""
    other = f" (there the {spaced(search.lies_on)} is nearer)" if search.lies_on not in ("", best.segment) else ""
    apart = " The segments are known together, not apart: what the plates measured fits a load on each." * several
    return (
        f"Beyond {search.reference} the subject carries {size_and_segments(search)}. Its centre{if_there} is {x}, "
        f"{y}, {z} mm from that segment's proximal joint centre, along its x (forward), y (up) and z "
        f"(right){other}.{apart}"
    )


def size_and_segments(search: LoadSearch) -> str:
    """Return how heavy the load is, which segments may carry it and how sure that is, the same words wherever it is
    told.
    """
    low, high = search.best.interval
    none = f"{search.p_no_load:.3f}" if search.p_no_load >= 0.001 else "below 0.001"
    return (
        f"{search.best.mass:.2f} kg on the {_segments(search)} (95 % interval {low:.2f} to {high:.2f} kg; probability "
        f"of no load {none})"
    )


def _segments(search: LoadSearch) -> str:
    """Return the segments that may carry the load, most probable first; beyond three the others are counted."""
    first, *others = map(spaced, search.segments)
    if not others:
        return first
    if len(others) > 2:
        others = [*others[:2], f"one of {len(others) - 2} more"]
    share = search.best.probability / max(1.0 - search.p_no_load, search.best.probability)
    return " or ".join([", ".join([f"{first} ({100 * share:.0f} % probable)", *others[:-1]]), others[-1]])


def _none(search: LoadSearch) -> str:
    sizes = sorted((one.smallest, spaced(one.segment)) for one in search.suspects)
    seen = [f"{size:.1f} kg ({where})" for size, where in sizes if np.isfinite(size)]
    hidden = [where for size, where in sizes if not np.isfinite(size)]
    parts = [" to ".join(dict.fromkeys([seen[0], seen[-1]]))] if seen else []
    parts += [f"none of any size on {listed(hidden)}"] if hidden else []
    return (
        f"No load is found beyond {search.reference} (probability of no load {search.p_no_load:.2f}). The smallest "
        f"that this session would find in half of the cases: {'; '.join(parts)}."
    )


def _unclear(search: LoadSearch) -> str:
    advice = "" if search.reference != "the table" else f" {_ADVICE}"
    least = search.best.smallest
    finds = f"{least:.1f} kg there in half of the cases" if np.isfinite(least) else "none there, of any size"
    return (
        f"Whether the subject carries a load beyond {search.reference} cannot be told. If so, it would be "
        f"{size_and_segments(search)}; this session finds {finds}.{advice}"
    )

"""What each cause is called when a person is told of it: the fact with its size, what to do, and a name for it where it
is only one of several.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.display import digits, shown_unit
from biodance.identification.knowledge import SIGMAS
from biodance.pipeline.finding_words import listed


class CauseWords(NamedTuple):
    """How a cause is told: the ``fact`` about {it} with its {size} and the interval {between}, {more} where it is
    positive; what to ``do``; its name as an ``alternative``; the two words of {more}.
    """

    fact: str
    do: str
    alternative: str
    more: tuple[str, str] = ("", "")


_ACCEPT = "or accept the correction."
_PLATE = f"Measure its corners, {_ACCEPT}"
_CALIBRATE = f"Calibrate the plate, {_ACCEPT}"
_RECORD = "Correct it, and run this again."
_MUCH = ("much", "little")
SPOKEN: dict[str, CauseWords] = {
    "time_delay": CauseWords(
        "{forces} {size} {more}{between}", f"Shift the forces, {_ACCEPT}", "a delay", ("late", "early")
    ),
    "clock_drift": CauseWords(
        "the clocks of cameras and plates drift {size}{between} apart", f"Use one clock, {_ACCEPT}", "a drifting clock"
    ),
    "filter_mismatch": CauseWords(
        "markers and forces were filtered differently, at {size}{between}", "Filter both alike.", "another filter"
    ),
    "plate_position": CauseWords(
        "{plate} lies {size}{between} along {axis} from where the file says", _PLATE, "a plate elsewhere"
    ),
    "plate_rotation": CauseWords("{plate} is turned {size}{between} about {axis}", _PLATE, "a turned plate"),
    "plate_gain": CauseWords("{it} reads {size} too {more}{between}", _CALIBRATE, "a wrong gain", _MUCH),
    "plate_offset": CauseWords(
        "{it} reads {size} too {more}{between} all the time", f"Zero the plate, {_ACCEPT}", "a wrong zero", _MUCH
    ),
    "plate_drift": CauseWords(
        "{it} drifts by {size}{between} over the session", f"Zero the plate before each trial, {_ACCEPT}", "a drift"
    ),
    "plate_crosstalk": CauseWords("{size}{between} of {it} leaks into {other}", _CALIBRATE, "a cross-talk"),
    "plate_hysteresis": CauseWords(
        "{it} comes back late after a load, by {size}{between}", f"Have the plate repaired, {_ACCEPT}", "a slow plate"
    ),
    "body_mass": CauseWords(
        "the person weighs {size} {more} than declared{between}",
        f"Weigh again, {_ACCEPT}",
        "a wrong body mass",
        ("more", "less"),
    ),
    "added_mass": CauseWords(
        "the {it} carries {size}{between} that nobody declared", "Take it off, or declare it.", "a load"
    ),
    "labels_swapped": CauseWords("{pairs} carry each other's names", f"Exchange them, {_ACCEPT}", "exchanged labels"),
    "marker_misplaced": CauseWords(
        "marker {it} sits {size}{between} from its place", "Put it back, or leave it out.", "a moved marker"
    ),
    "joint_centre": CauseWords(
        "the {it} lies {size}{between} from where the static trial puts it",
        "Check the markers beside it.",
        "a joint elsewhere",
    ),
    "segment_length": CauseWords(
        "the {it} is {size} {more}{between} than its markers say",
        "Measure it.",
        "a wrong length",
        ("longer", "shorter"),
    ),
    "trunk_joint": CauseWords(
        "the trunk bends {size}{between} where the model is stiff", "Accept it.", "a bending trunk"
    ),
    "head_joint": CauseWords("the head turns {size}{between} where the model is stiff", "Accept it.", "a turning head"),
    "shoulder_girdle": CauseWords("the shoulders move {size}{between} on the trunk", "Accept it.", "moving shoulders"),
    "wobbling_mass": CauseWords("{size}{between} of soft tissue swing at the {it}", "Accept it.", "soft tissue"),
    "sloshing_load": CauseWords(
        "a load of {size}{between} sloshes at the {it}", "Take it off, or declare it.", "a sloshing load"
    ),
    "external_contact": CauseWords(
        "something that no plate measures pushes the {it} with {size}{between}",
        "Record again, touching nothing.",
        "a touch",
    ),
    "body_weight_support": CauseWords(
        "something that no plate measures carries {size}{between} at the {it}", "Record again without it.", "a support"
    ),
    "unmeasured_contact": CauseWords(
        "something that no plate measures carries the {it}", "Record again without it.", "a support"
    ),
    "lab_tilt": CauseWords(
        "the laboratory is tilted {size}{between} about {it}", f"Calibrate the cameras, {_ACCEPT}", "a tilted floor"
    ),
    "unit_error": CauseWords("a unit is mistaken{factor}", _RECORD, "a mistaken unit"),
    "axis_error": CauseWords("the sign or order of {it} is wrong", _RECORD, "a wrong axis"),
    "clipping": CauseWords(
        "{it} is cut off at its largest values", "Choose a larger range, and record again.", "a cut-off channel"
    ),
    "mains_hum": CauseWords("the mains hum in {it}, {size}", "Ground the amplifier, and record again.", "hum"),
    "frame_rate": CauseWords("the cameras' frames are not those that the file declares", _RECORD, "a wrong frame rate"),
    "plates_exchanged": CauseWords("{it} carry each other's signals", f"Exchange them, {_ACCEPT}", "exchanged plates"),
    "unrelated_forces": CauseWords(
        "{forces} not those of the movement", "Look whether they are another trial's.", "unrelated forces"
    ),
    "dead_plate": CauseWords("{it} measures nothing", "Leave it out, or record again.", "a dead plate"),
    "toe_landmark": CauseWords(
        "the toe markers sit {size}{between} from the line of the foot",
        "Check where they sit.",
        "a toe marker elsewhere",
    ),
    "frozen_markers": CauseWords(
        "{pairs} stood still to the last bit for a while", "Leave gaps open instead.", "frozen markers"
    ),
    "marker_spikes": CauseWords("some frames of {pairs} lie far off their way", "Fill these frames again.", "spikes"),
    "padding": CauseWords("the forces begin or end with copies of one value", "Cut them off.", "padding"),
    "unequal_limbs": CauseWords(
        "the legs have unequal masses by {size}", "Say in session.toml what is worn.", "unequal legs"
    ),
}
"""By effect. One from outside the package is told by its name and its own advice."""
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
    words, size = SPOKEN.get(finding.effect), _size(finding.parameters)
    if words is None:
        name = finding.effect.replace("_", " ")
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


def names_markers(effect: str) -> bool:
    """Return whether findings of an effect are told by their markers, several together."""
    return effect in SPOKEN and "{pairs}" in SPOKEN[effect].fact


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
    known = SPOKEN.get(alias.effect)
    return known.alternative if known else f"a {alias.effect.replace('_', ' ')}"

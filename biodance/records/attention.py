"""What a person must see first, and what a verdict rests on or leaves out, the same wherever it is shown."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Literal

import numpy as np

from biodance.records.arrays import Mask, grouped


class LeftOut(StrEnum):
    """Why frames are not compared with a body, in the order of the gates: a frame counts at the first."""

    CARRIED_ELSEWHERE = "carried_elsewhere"
    """A chair, a rail or a hand carries a part of the person."""
    NO_LOAD = "no_load"
    """No plate is loaded, and nobody flies."""
    FORCE_UNKNOWN = "force_unknown"
    """A plate's force is not known."""
    FOOT_UNSEEN = "foot_unseen"
    """A foot was not seen."""
    FOOT_BESIDE = "foot_beside"
    """A foot may touch the ground beside the plates, or stand partly beside one."""
    NO_FOOT_ON_PLATE = "no_foot_on_plate"
    """A plate is loaded though no foot is over it."""
    SILENT_PLATE = "silent_plate"
    """A foot rests on a plate that reads nothing."""
    POSTURE_OPEN = "posture_open"
    """The markers do not fix the posture, or only what was filled into their gaps does."""
    AT_AN_END = "at_an_end"
    """Beside an end of the recording the low-pass makes up the acceleration."""
    FORCES_DIFFER = "forces_differ"
    """Plates and motion differ by more than a wrong body or soft tissue can make of this movement."""
    SHORT_RUN = "short_run"
    """What is left without a break is too short to tell of slow errors."""


def seconds_left_out(reasons: Mapping[LeftOut, Mask], rate: float) -> dict[LeftOut, float]:
    """Return how many seconds each of the ``reasons`` (T,) takes out at ``rate`` Hz, each frame at the first."""
    found: dict[LeftOut, float] = {}
    before = np.zeros((), dtype=bool)
    for reason in (one for one in LeftOut if one in reasons):
        new = reasons[reason] & ~before
        before = reasons[reason] | before
        if new.any():
            found[reason] = float(new.sum() / rate)
    return found


Level = Literal["fail", "warn", "note"]
LEVELS: tuple[Level, ...] = ("fail", "warn", "note")
"""Strongest first."""
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")  # What may differ between two sentences of one wording
LIMIT_TOLD = ", should be "
"""Between the value of a check and its limit, in a sentence about it."""
OTHER_PEOPLE = "another person"
"""What a sentence on the file of another person is about."""


class NotUsed(str):
    """A note on what was typed and the recordings contradict, so that it was not used."""


class WrongWeight(str):
    """A warning that the plates do not carry the declared weight."""


class AnotherPerson(str):
    """Why a file is refused that declares another person than the static trial's."""


class Doubt(str):
    """A note that needs a person: the ``fact``, what to do ``then``, the segments, joints and markers that it is
    ``about``, and whether it is ``mended``: nothing that is made of the recordings rests on it.
    """

    fact: str
    then: str
    about: tuple[str, ...]
    mended: bool

    def __new__(cls, fact: str, then: str = "", *, about: tuple[str, ...] = (), mended: bool = False) -> "Doubt":
        """Return the note: a warning of the fact, then what to do."""
        made = super().__new__(cls, " ".join(filter(None, (f"Warning: {fact}.", then))))
        made.fact, made.then, made.about, made.mended = fact, then, about, mended
        return made

    @property
    def level(self) -> Level:
        """How loudly it is said."""
        return "note" if self.mended else "warn"

    @property
    def said(self) -> str:
        """The note without the word that marks it."""
        return self.removeprefix("Warning: ")

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return self.fact, self.then


@dataclass(frozen=True)
class Attention:
    """A sentence with its ``level``, ``trial`` ("" = the session), and effect, check or step it is ``about``."""

    level: Level
    text: str
    trial: str = ""
    about: str = ""


@dataclass(frozen=True)
class Judged:
    """One trial (or refused file) and for how many ``seconds`` a verdict rests on it; ``why_not`` it does not, and
    whether it was ``missed``: it should have been judged and could not; ``left_out`` s that each reason took out of
    the comparison with a body.
    """

    trial: str
    seconds: float
    why_not: str = ""
    missed: bool = False
    left_out: Mapping[LeftOut, float] = field(default_factory=dict)

    @property
    def left_out_s(self) -> float:
        """For how many seconds the trial could not be compared with a body, all reasons together."""
        return sum(self.left_out.values(), 0.0)


def strongest_first(sentences: Iterable[Attention]) -> tuple[Attention, ...]:
    """Return the sentences by level, each once, in their order otherwise."""
    return tuple(sorted(dict.fromkeys(sentences), key=lambda one: LEVELS.index(one.level)))


def without_path(reason: str, file: str) -> str:
    """Return a refusal without the path of the ``file`` in front, where the file is named beside it anyway."""
    path, colon, rest = reason.partition(": ")
    return rest if colon and path.endswith(file) else reason


def told_together(found: Iterable[Attention]) -> tuple[Attention, ...]:
    """Return the sentences with those of one check and limit, or of one wording, put into one."""
    return tuple(_together(rows) for rows in grouped((_wording(one), one) for one in found).values())


def _wording(one: Attention) -> tuple[str, str, str]:
    """Return what sentences that are told together have in common."""
    said = one.text.partition(LIMIT_TOLD)[2] or _NUMBER.sub("#", one.text)
    return (one.level, one.about, said) if one.trial else ("", "", one.text)


def _together(rows: list[Attention]) -> Attention:
    """Return one sentence for all trials of ``rows``."""
    if len(rows) == 1:
        return rows[0]
    if LIMIT_TOLD not in rows[0].text:
        trials = list(dict.fromkeys(one.trial for one in rows[1:] if one.trial != rows[0].trial))
        return replace(rows[0], text=f"{rows[0].text} Likewise: {', '.join(trials)}." if trials else rows[0].text)
    found = [(one.trial, one.text.partition(LIMIT_TOLD)[0]) for one in rows]
    # Up to four trials of one check are told one by one.
    values = _range(found) if len(rows) > 4 else ""
    values = values or ", ".join(f"{trial} {value}" for trial, value in found)
    return replace(rows[0], text=f"{values}{LIMIT_TOLD}{rows[0].text.partition(LIMIT_TOLD)[2]}", trial="")


def _range(found: list[tuple[str, str]]) -> str:
    """Return the smallest and largest of values (trial, ``5.6 % of weight``) with their trials; or ""."""
    parts = [(trial, *value.partition(" ")) for trial, value in found]
    try:
        low, high = (choose(parts, key=lambda part: float(part[1])) for choose in (min, max))
    except ValueError:
        return ""
    units = {part[3] for part in parts}
    if len(units) > 1:
        return ""
    return f"{len(found)} trials, {low[1]} ({low[0]}) to {high[1]} {high[3]} ({high[0]})"

"""What a person must see first, and what a verdict rests on: the same records on page, terminal and in JSON."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from biodance.records.left_out import LeftOut

Level = Literal["fail", "warn", "note"]
LEVELS: tuple[Level, ...] = ("fail", "warn", "note")
"""Strongest first."""
WARNING = "Warning: "
"""Beginning of a note that needs a person."""
_FEW = 4
"""Trials of one check that are told one by one."""
LIMIT_TOLD = ", should be "
"""Between the value of a check and its limit, in a sentence about it."""


@dataclass(frozen=True)
class Attention:
    """One plain sentence that needs a person: its ``level``, the ``trial`` ("" for the session) and what it is
    ``about`` (an effect of the family, a check, a step).
    """

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
    """Return the sentences with those of one check and limit put into one that names its trials, each in its order:
    five lines that differ in a number say less than one.
    """
    alike: dict[tuple[str, str, str], list[Attention]] = {}
    for one in found:
        said = one.text.partition(LIMIT_TOLD)[2]
        alike.setdefault((one.level, one.about, said) if said and one.trial else ("", one.trial, one.text), []).append(
            one
        )
    return tuple(_together(rows) for rows in alike.values())


def _together(rows: list[Attention]) -> Attention:
    """Return one sentence for all trials of ``rows``."""
    if len(rows) == 1:
        return rows[0]
    found = [(one.trial, one.text.partition(LIMIT_TOLD)[0]) for one in rows]
    values = _range(found) if len(rows) > _FEW else ""
    values = values or ", ".join(f"{trial} {value}" for trial, value in found)
    return replace(rows[0], text=f"{values}{LIMIT_TOLD}{rows[0].text.partition(LIMIT_TOLD)[2]}", trial="")


def _range(found: list[tuple[str, str]]) -> str:
    """Return the smallest and the largest of many values (trial, ``5.6 % of weight``) with their trials; "" where they
    are no numbers of one unit.
    """
    parts = [(trial, *value.partition(" ")) for trial, value in found]
    try:
        low, high = (choose(parts, key=lambda part: float(part[1])) for choose in (min, max))
    except ValueError:
        return ""
    units = {part[3] for part in parts}
    if len(units) > 1:
        return ""
    return f"{len(found)} trials, {low[1]} ({low[0]}) to {high[1]} {high[3]} ({high[0]})"

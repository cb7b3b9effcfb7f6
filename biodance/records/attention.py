"""What a person must see first, and what a verdict rests on: the same records on page, terminal and in JSON."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Level = Literal["fail", "warn", "note"]
LEVELS: tuple[Level, ...] = ("fail", "warn", "note")
"""Strongest first."""
WARNING = "Warning: "
"""Beginning of a note that needs a person."""


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
    whether it was ``missed``: it should have been judged and could not.
    """

    trial: str
    seconds: float
    why_not: str = ""
    missed: bool = False


def strongest_first(sentences: Iterable[Attention]) -> tuple[Attention, ...]:
    """Return the sentences by level, each once, in their order otherwise."""
    return tuple(sorted(dict.fromkeys(sentences), key=lambda one: LEVELS.index(one.level)))


def without_path(reason: str, file: str) -> str:
    """Return a refusal without the path of the ``file`` in front, where the file is named beside it anyway."""
    path, colon, rest = reason.partition(": ")
    return rest if colon and path.endswith(file) else reason

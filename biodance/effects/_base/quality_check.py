"""Checks that run before any statistics: a cause that a look at the recording settles is named here, and never
fitted.
"""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from biodance.effects._base.case import Case
from biodance.records import Session


@dataclass(frozen=True)
class QualityCheck:
    """One check: ``check`` what was looked at, ``ok``, ``text`` one plain sentence of what was seen; where it is not
    well the cause: ``effect`` and ``target`` as in the family, and the ``size`` of its ``quantity`` in ``unit`` (NaN =
    no number); ``advice`` how the effect is mended (filled in by `check_quality`); ``mended`` where it was taken out
    before anything was judged, so that the rest can be.
    """

    check: str
    ok: bool
    text: str
    effect: str = ""
    target: str = ""
    size: float = float("nan")
    quantity: str = "size"
    unit: str = ""
    advice: str = ""
    mended: bool = False


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the checks look at: the ``session`` as read, and the tracked ``cases`` (none where no body could be
    scaled).
    """

    session: Session
    cases: tuple[Case, ...] = ()


class DiscreteEffect(ABC):
    """One cause that is there or not; the checks that find it are its ``check``, and a file without it is refused
    when it is found.
    """

    name: ClassVar[str] = ""
    separated_by: ClassVar[str] = ""
    """The movement or measurement that settles it, in words for the analyst."""
    advice: ClassVar[str] = ""
    """How it is mended."""

    @classmethod
    @abstractmethod
    def check(cls, recorded: Recorded) -> tuple[QualityCheck, ...]:
        """Return the checks that could be made on the recording."""


def unit_of(target: str) -> str:
    """Return the unit of the channel that a target names last: N or N·m."""
    return "N·m" if target.rpartition(":")[2].startswith("M") else "N"


Found = tuple[str, str, str]
"""Target, the sentence, and the number in it ("" for none)."""


def reader_decisions(session: Session, patterns: dict[str, str]) -> tuple[Found, ...]:
    """Return each different decision of a session once: ``patterns`` are regular expressions by what they speak of
    (``corners``); a group in the expression is the number. The target is the plate's name and what, or only what.
    """
    found: dict[tuple[str, str], Found] = {}
    for trial in session.trials:
        said = [("", sentence) for sentence in (*trial.history, *trial.warnings)]
        said += [(plate.name, sentence) for plate in trial.plates for sentence in plate.decisions]
        for where, sentence in said:
            for what, pattern in patterns.items():
                match = re.search(pattern, sentence)
                if match:
                    place = where or _plate(sentence)
                    target = f"{place}:{what}" if place else what
                    found.setdefault((target, match[0]), (target, sentence, match[1] if match.groups() else ""))
    return tuple(found.values())


def overruled_files(session: Session, patterns: dict[str, str], *, check: str, effect: str) -> tuple[QualityCheck, ...]:
    """Return a failed ``check`` for each target, or each size of it, on which the reader decided against the files,
    with ``effect`` as its cause; of several trials, which name their own numbers, the first tells.
    """
    first: dict[tuple[str, str], str] = {}
    for target, sentence, number in reader_decisions(session, patterns):
        first.setdefault((target, number), sentence)
    return tuple(
        QualityCheck(check, False, sentence, effect, target, float(number) if number else float("nan"))
        for (target, number), sentence in first.items()
    )


def _plate(sentence: str) -> str:
    match = re.match(r"Plate (\d+)", sentence)
    return f"plate{match[1]}" if match else ""

"""What the reader of the files had to decide against what they say, found again in its sentences."""

import re

from biodance.effects._base.gate import Gate
from biodance.records import Session

Found = tuple[str, str, str]
"""Target, the sentence, and the number in it ("" for none)."""


def decided(session: Session, patterns: dict[str, str]) -> tuple[Found, ...]:
    """Return each different decision of a session once: ``patterns`` are regular expressions by what they speak of (``corners``); a group
    in the expression is the number. The target is the plate's name and what, or only what.
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


def overruled(session: Session, patterns: dict[str, str], *, check: str, effect: str) -> tuple[Gate, ...]:
    """Return a failed ``check`` for each different decision that the reader took against the files, with ``effect`` as its cause."""
    return tuple(
        Gate(check, False, sentence, effect, target, float(number) if number else float("nan"))
        for target, sentence, number in decided(session, patterns)
    )


def _plate(sentence: str) -> str:
    match = re.match(r"Plate (\d+)", sentence)
    return f"plate{match[1]}" if match else ""

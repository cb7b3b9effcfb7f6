"""How numbers and sentences are put before a person."""

import math
from typing import Any

from biodance.display import SHOWN_UNITS
from biodance.records.attention import Attention

_ABSURD = 1000.0
"""Typical sizes above which a size from which something is seen means never."""


def format_number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres; templates choose the ``digits``: ``value|mm(0)``."""
    return format_number(None if value is None else 1000 * value, digits)


def sized(value: float, unit: str) -> str:
    """Return a number with its unit as a person says it: 0.02 m is 20 mm."""
    factor, name, digits = SHOWN_UNITS.get(unit, (1.0, unit, 2))
    if value == float("inf"):
        return "no size"
    return f"{format_number(factor * value, digits)} {name}".strip()


def named(effect: str, target: str) -> str:
    """Return a cause with its place as words: ``added mass, left forearm hand``."""
    plain = effect.replace("_", " ")
    return f"{plain}, {target.replace('_', ' ').replace('->', ' into ')}" if target else plain


def sizes_in_words(parameters: dict[str, dict[str, Any]]) -> str:
    """Return the parameters of a finding (its JSON) with their standard deviations; three axes as one vector."""
    vectors = {name: row for name, row in parameters.items() if isinstance(row["value"], list)}
    rows = {name: row for name, row in parameters.items() if name.rpartition("_")[0] not in vectors}
    return ", ".join(f"{name.replace('_', ' ')} {_size_in_words(row)}" for name, row in rows.items())


def _size_in_words(row: dict[str, Any]) -> str:
    """Return a value, or three, with their standard deviations and unit: ``−19, −186, −28 ± 41, 75, 40 mm``."""
    parts = [row[key] if isinstance(row[key], list) else [row[key]] for key in ("value", "sd")]
    factor, unit, digits = SHOWN_UNITS.get(row["unit"], (1.0, row["unit"], 2))
    said = [", ".join(format_number(factor * x, digits) for x in part if x is not None) for part in parts]
    return f"{' ± '.join(filter(None, said))} {unit}".strip()


def size_seen(row: dict[str, Any], key: str) -> str:
    """Return a size of a cause, ``limit``, ``told_from`` or ``typical``, as a person says it: 12 mm, or never."""
    value = row[key]
    if value is None or not value < _ABSURD * row["typical"]:
        return "never"
    return sized(value, row["unit"])


def trial_and_subject(one: Attention) -> str:
    """Return where a sentence belongs, to stand before it: file, check and trial, step, or trial."""
    about = one.about.replace("_", " ")
    if one.trial and about in ("", "file"):
        return one.trial if about else f"Trial {one.trial}"
    place = f", {one.trial}" if one.trial else ""
    return f"{about[:1].upper()}{about[1:]}{place}" or "Session"

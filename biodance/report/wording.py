"""How numbers and sentences are put before a person."""

import math
from typing import Any

from biodance.records.attention import Attention

_SHOWN = {"m": (1000.0, "mm", 0), "rad": (57.29578, "°", 1), "s": (1000.0, "ms", 1), "1": (100.0, "%", 1)}
"""Unit of a parameter: factor, unit and digits that are shown."""
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
    factor, name, digits = _SHOWN.get(unit, (1.0, unit, 2))
    if value == float("inf"):
        return "no size"
    return f"{format_number(factor * value, digits)} {name}".strip()


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

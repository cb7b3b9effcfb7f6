"""How numbers and sentences are put before a person."""

import math

from biodance.records.attention import Attention


def format_number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres; templates choose the ``digits``: ``value|mm(0)``."""
    return format_number(None if value is None else 1000 * value, digits)


def trial_and_subject(one: Attention) -> str:
    """Return where a sentence belongs, to stand before it: file, check and trial, step, or trial."""
    about = one.about.replace("_", " ")
    if one.trial:
        return one.trial if about == "file" else f"{about}, {one.trial}" if about else f"Trial {one.trial}"
    return f"{about[:1].upper()}{about[1:]}" or "Session"

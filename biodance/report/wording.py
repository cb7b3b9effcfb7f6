"""How numbers and sentences are put before a person."""

import math


def number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres."""
    return number(None if value is None else 1000 * value, digits)


def without_path(reason: str, file: str) -> str:
    """Return a refusal without the path of the ``file`` in front, where the file is named beside it anyway."""
    path, colon, rest = reason.partition(": ")
    return rest if colon and path.endswith(file) else reason

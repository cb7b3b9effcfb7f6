"""How numbers and sentences are put before a person, and what must be looked at first."""

import math

from biodance.pipeline.results import SessionResult


def format_number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres."""
    return format_number(None if value is None else 1000 * value, digits)


def without_path(reason: str, file: str) -> str:
    """Return a refusal without the path of the ``file`` in front, where the file is named beside it anyway."""
    path, colon, rest = reason.partition(": ")
    return rest if colon and path.endswith(file) else reason


def attention(result: SessionResult) -> list[tuple[str, str]]:
    """Return (where, sentence) of every file refused, step refused, fit that failed, warning, and check outside its
    limit.
    """
    found = [(file, without_path(why, file)) for file, why in result.session.refused.items()]
    found += [("Session", step.text) for step in result.steps if step.status != "done"]
    found += [(f"Identification, {what}", f"Not solved. {cause}") for what, cause in result.failures.items()]
    found += [("Body", text.removeprefix("Warning: ")) for text in result.doubts]
    for trial in result.trials:
        name = trial.trial.name
        found += [(f"Trial {name}", text.removeprefix(f"Trial {name}: ")) for text in trial.reasons]
    outside = [check for check in result.all_checks if not check.inside]
    return found + [
        (f"{check.what}, {check.where}", f"{check.value}, should be {check.limit}. {check.advice}") for check in outside
    ]

"""Values of a TOML file that somebody wrote by hand, each refused by its name where it is not legal."""

import math
from pathlib import Path
from typing import Any

from biodance.errors import BiodanceError


def sentences(path: Path, raw: dict[str, Any]) -> tuple[str, ...]:
    """Return what a TOML file says under ``care``; BiodanceError if it is no list of sentences."""
    found = raw.get("care", [])
    if not isinstance(found, list) or not all(isinstance(one, str) and one.strip() for one in found):
        raise BiodanceError(f'{path}: care = {found!r}; expected sentences in a list, as ["A helper stands beside."].')
    return tuple(found)


def finite_number(path: Path, where: str, value: object) -> float:
    """Return ``value`` as a float; BiodanceError names ``where`` it is if it is no finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BiodanceError(f"{path}: {where} = {value!r}; expected a finite number.")
    return float(value)


def table(path: Path, raw: dict[str, Any], key: str, *, of: str = "") -> dict[str, Any]:
    """Return a table of a TOML file, empty if it is missing; BiodanceError if it is something else."""
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise BiodanceError(f"{path}: [{of}{key}] must be a table, found {value!r}.")
    return value

"""Read the protocol of a dance from TOML and check it. The shipped ones are in ``protocols/dances``.

    name = "short"
    description = "what it is for, one sentence"
    move_s = 2.0                 seconds from posture to posture
    hold_s = 1.5                 seconds of standing still in each
    forward_m = 0.2              how far the right foot stands in front in "right_forward"
    share_of_support = 0.6       short for the share under [limits.balance]
    budget_s = 115               the postures that inform most per second are danced until the time is used up; without it: all
    simplicity = 0.0             the performer's term: 0 = excitation only; 1 = a simple dance is worth as much as an exciting one
    other_weight = 1.0           emphasis of the segments that [weights] does not name
    ranges = "comfortable"       what joints may use: what is reached without effort, or "anatomical": all that a healthy joint allows

    [postures]                   how many postures on which feet, in the order of the dance
    parallel = 15                both feet side by side
    right_forward = 15           right foot in front
    single_right = 15            on the right leg
    single_left = 15             on the left leg
    seated = 20                  on a stool

    [limits.friction]            numbers of the limits, each named as its file in biodance/dance/limits
    mu = 0.4

    [weights]                    emphasis of segments, on top of their masses
    trunk_head = 2.0

Only [postures] is needed; everything else has the value of the paper or none.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from biodance.dance.limits import Limit, limits_with
from biodance.dance.plan import Plan
from biodance.errors import BiodanceError, UnknownName
from biodance.library import locate, read_toml

NUMBERS = {
    "move_s": "move",
    "hold_s": "hold",
    "forward_m": "forward",
    "budget_s": "budget",
    "simplicity": "simplicity",
    "other_weight": "other_weight",
}
"""Key of the file: field of the Plan."""
SHORT = {"share_of_support": ("balance", "share")}
"""Key of the file: limit and its number."""
KEYS = ("name", "description", "postures", "limits", "weights", "ranges", *NUMBERS, *SHORT)


def read_plan(name_or_path: str | Path) -> Plan:
    """Return a shipped protocol by name ("full", "short", "chair", "one_segment"), or one of the user's by the path of its TOML file.

    Raises
    ------
    UnknownName
        No shipped protocol has this name; a key of the file or a stance does not exist.
    BiodanceError
        The file cannot be read, or a value is not legal; the message names file, key, value and what would be legal.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = locate("protocols/dances", str(name_or_path))
    raw = read_toml(path)
    for key in raw:
        if key not in KEYS:
            raise UnknownName.of(f"key of {path}", key, KEYS)
    words = {"ranges": str(raw["ranges"])} if "ranges" in raw else {}
    fields: dict[str, Any] = words | {field: number(path, key, raw[key]) for key, field in NUMBERS.items() if key in raw}
    counts = table(path, raw, "postures")
    for stance, count in counts.items():
        if not isinstance(count, int) or isinstance(count, bool):
            raise BiodanceError(f"{path}: postures.{stance} = {count!r}; expected a whole number of postures.")
    weights = {name: number(path, f"weights.{name}", value) for name, value in table(path, raw, "weights").items()}
    plan = Plan(str(raw.get("name", path.stem)), str(raw.get("description", "")), tuple(counts.items()), weights=tuple(weights.items()))
    return replace(plan, limits=_limits(path, raw), **fields)


def _limits(path: Path, raw: dict[str, Any]) -> tuple[Limit, ...]:
    """Return all limits with the numbers that the file gives them."""
    given = table(path, raw, "limits")
    found = {
        name: {key: number(path, f"limits.{name}.{key}", value) for key, value in table(path, given, name, of="limits.").items()}
        for name in given
    }
    for short, (name, key) in SHORT.items():
        if short in raw and key in found.get(name, {}):
            raise BiodanceError(f"{path}: {short} and limits.{name}.{key} say the same; keep one of them.")
        if short in raw:
            found.setdefault(name, {})[key] = number(path, short, raw[short])
    return limits_with(found, where=str(path))


def number(path: Path, where: str, value: object) -> float:
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

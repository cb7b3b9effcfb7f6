"""A cause in the words of its own file: what it is, how it shows, what looks like it; and sizes in units that a person uses."""

import sys
from dataclasses import dataclass

from biodance.diagnose.diagnosis import Estimate
from biodance.effects import discrete_effects, effects
from biodance.report.wording import number

SHOWN = {"m": (1000.0, "mm", 0), "rad": (57.29578, "°", 1), "s": (1000.0, "ms", 1), "1": (100.0, "%", 1)}
"""Unit of a parameter: factor, unit and digits that are shown."""


@dataclass(frozen=True)
class Words:
    """What a cause is, its signature, its look-alikes and what separates them, each a few sentences."""

    what: str
    signature: str
    alike: str
    separated: str


def words_of(effect: str) -> Words:
    """Return the words of an effect; empty ones for a cause that has no file (any more)."""
    kind = {**effects(), **discrete_effects()}.get(effect)
    text = " ".join(((sys.modules[kind.__module__].__doc__ if kind else "") or "").split())
    what, _, rest = text.partition("Signature:")
    signature, _, rest = rest.partition("Look-alikes:")
    alike, _, separated = rest.partition("Separated by")
    return Words(what.strip(), first_upper(signature.strip()), first_upper(alike.strip()), first_upper(separated.strip()))


def first_upper(text: str) -> str:
    """Return ``text`` with a capital first letter and nothing else changed."""
    return text[:1].upper() + text[1:]


def named(effect: str, target: str) -> str:
    """Return a cause with its place as words: ``added mass, left forearm hand``."""
    plain = effect.replace("_", " ")
    return f"{plain}, {target.replace('_', ' ').replace('->', ' into ')}" if target else plain


def sized(value: float, unit: str) -> str:
    """Return a number with its unit as a person says it: 0.02 m is 20 mm."""
    factor, name, digits = SHOWN.get(unit, (1.0, unit, 2))
    if value == float("inf"):
        return "no size"
    return f"{number(factor * value, digits)} {name}".strip()


def estimated(one: Estimate) -> str:
    """Return a parameter with its 95 % interval."""
    if one.sd != one.sd:
        return sized(one.value, one.unit)
    low, high = one.interval
    return f"{sized(one.value, one.unit)} (95 % interval {sized(low, one.unit)} to {sized(high, one.unit)})"

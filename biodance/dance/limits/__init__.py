"""FAMILY: one constraint of a dance per file, found automatically; others come as objects or by the entry points ``biodance.limits``.

A member is a frozen dataclass that derives from `Limit`, given as ``LIMIT`` by its file: its numbers are fields (``[limits.friction]
mu = 0.4`` in a protocol), ``margins`` is for the optimiser, ``check`` judges the finished motion by other code. Design, verification,
refusal and report go through the family and know no name; `tests/test_dance_limits.py` holds every member to its contract.
"""

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace

from biodance.dance.limits._checked import NOTHING, CheckedMotion, Remaining
from biodance.dance.limits._limit import FAR, Limit, Margins, bounded, unconcerned
from biodance.discovery import Family
from biodance.errors import BiodanceError, UnknownName

__all__ = [
    "FAR",
    "NOTHING",
    "CheckedMotion",
    "Limit",
    "Margins",
    "Remaining",
    "bounded",
    "family",
    "joined",
    "limits_with",
    "unconcerned",
]


def missing(candidate: object) -> tuple[str, ...]:
    """Return what an object or class lacks to be a limit."""
    kind = candidate if isinstance(candidate, type) else type(candidate)
    if not issubclass(kind, Limit):
        return ("the base class Limit",)
    lacks = [name for name in ("name", "unit", "scale") if not hasattr(kind, name)]
    return (*lacks, *(sorted(getattr(kind, "__abstractmethods__", ())) if inspect.isabstract(kind) else ()))


FAMILY: Family[Limit | type[Limit]] = Family("limit of a dance", "biodance.limits", __name__, "LIMIT", missing, lambda kind: kind.name)


def family() -> tuple[Limit, ...]:
    """Return all limits of the folder and of other packages with their usual numbers, by name.

    Raises
    ------
    BiodanceError
        A file of the folder or an entry point is no limit; the sentence says which and what to do.
    """
    return joined(FAMILY.members().values(), ())


def joined(limits: Iterable[Limit | type[Limit]], more: Iterable[Limit | type[Limit]]) -> tuple[Limit, ...]:
    """Return ``limits`` and ``more``, objects or classes, by name; where a name is in both, the one of ``more``.

    Raises
    ------
    BiodanceError
        One of ``more`` is no limit.
    """
    found: dict[str, Limit] = {}
    for one in (*limits, *more):
        if lacks := missing(one):
            raise BiodanceError(f"{one!r}: lacks {', '.join(lacks)}, so it is no limit of a dance. See biodance.dance.limits.Limit.")
        found[one.name] = one() if isinstance(one, type) else one
    return tuple(found[name] for name in sorted(found))


def limits_with(numbers: Mapping[str, Mapping[str, float]], *, where: str) -> tuple[Limit, ...]:
    """Return the family with other ``numbers`` (limit -> field -> value), found ``where``.

    Raises
    ------
    UnknownName
        There is no such limit, or it has no such number; the message lists the legal ones.
    BiodanceError
        A number is outside its legal range.
    """
    usual = {limit.name: limit for limit in family()}
    for name, given in numbers.items():
        if name not in usual:
            raise UnknownName.of(f"limit in {where}", name, tuple(usual))
        legal = tuple(one.name for one in fields(usual[name]))
        for key in given:
            if key not in legal:
                raise UnknownName.of(f"number of limits.{name} in {where}", key, legal)
    return tuple(replace(limit, **numbers.get(name, {})) for name, limit in usual.items())

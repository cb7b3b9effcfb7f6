"""FAMILY: one candidate cause of disagreement per file, found automatically: to extend the model, add one file.

The virtual lab injects effects, the diagnosis fits them. The name of an effect is the name of its file. Most causes have columns and are
fitted (``effects``); those that a look at the recording settles before any statistics are checks (``discrete_effects``).
"""

import importlib
import inspect
import pkgutil
from collections.abc import Iterable
from types import MappingProxyType
from typing import TypeVar

from biodance.effects.effect import Effect
from biodance.effects.gate import DiscreteEffect
from biodance.errors import BiodanceError, UnknownName

Kind = TypeVar("Kind")

CONTRACT = ("case", "effect", "gate", "geometry", "missing_joint", "moved_matter", "oscillator", "posture_answer", "reader_words")
"""Modules of this folder that are not effects."""


def effects(chosen: Iterable[str] | None = None) -> MappingProxyType[str, type[Effect]]:
    """Return the effects of this folder that have columns, by name; only the ``chosen`` ones if given (UnknownName for others)."""
    return _selection({name: kind for name, kind in _family().items() if issubclass(kind, Effect)}, chosen)


def discrete_effects(chosen: Iterable[str] | None = None) -> MappingProxyType[str, type[DiscreteEffect]]:
    """Return the effects of this folder that a check finds, by name; only the ``chosen`` ones if given (UnknownName for others)."""
    return _selection({name: kind for name, kind in _family().items() if issubclass(kind, DiscreteEffect)}, chosen)


def effect(name: str) -> type[Effect]:
    """Return one effect that has columns; UnknownName lists all of them."""
    return effects((name,))[name]


def _family() -> dict[str, type[Effect] | type[DiscreteEffect]]:
    """Return what every file of this folder describes, by name."""
    return {name: _described(name) for name in (info.name for info in pkgutil.iter_modules(__path__)) if name not in CONTRACT}


def _described(name: str) -> type[Effect] | type[DiscreteEffect]:
    """Return the effect that a file of this folder describes; BiodanceError where it leaves out what its author must write."""
    kind: type[Effect] | type[DiscreteEffect] = importlib.import_module(f"{__name__}.{name}").EFFECT
    if inspect.isabstract(kind):
        missing = ", ".join(sorted(getattr(kind, "__abstractmethods__", ())))
        raise BiodanceError(f"biodance/effects/{name}.py: {kind.__name__} lacks {missing}. Write it as {kind.mro()[1].__name__} describes.")
    return kind


def _selection(family: dict[str, type[Kind]], chosen: Iterable[str] | None) -> MappingProxyType[str, type[Kind]]:
    """Return the members named, in the family's order; all for None."""
    if chosen is None:
        return MappingProxyType(family)
    names = tuple(chosen)
    for name in names:
        if name not in family:
            raise UnknownName.of("effect", name, tuple(family))
    return MappingProxyType({name: kind for name, kind in family.items() if name in names})

"""FAMILY: one candidate cause of disagreement per file, found automatically: to extend the model, add one file.

The virtual lab injects effects, the diagnosis fits them. The name of an effect is the name of its file.
"""

import importlib
import pkgutil
from types import MappingProxyType

from biodance.effects.effect import Effect
from biodance.errors import UnknownName

CONTRACT = ("case", "effect")
"""Modules of this folder that are not effects."""


def effects() -> MappingProxyType[str, type[Effect]]:
    """Return all effects of this folder by name."""
    found = {}
    for info in pkgutil.iter_modules(__path__):
        if info.name not in CONTRACT:
            found[info.name] = importlib.import_module(f"{__name__}.{info.name}").EFFECT
    return MappingProxyType(found)


def effect(name: str) -> type[Effect]:
    """Return one effect; UnknownName lists all of them."""
    family = effects()
    if name not in family:
        raise UnknownName.of("effect", name, tuple(family))
    return family[name]

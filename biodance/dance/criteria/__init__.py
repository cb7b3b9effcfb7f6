"""FAMILY: one excitation criterion per file, found automatically.

A criterion judges the information G = R'R = W'W (p, p) of the whitened regressor over the SIP, accumulated over a whole movement and
given as its triangle R (or any rows with the same G). It has a ``NAME`` and one function ``evaluate(triangle, target)``, which returns
(value, gradient) with ``gradient`` (p, p) symmetric, dJ = <gradient, dG>; smaller is better. So every criterion works for every body,
posture set and trajectory, and its derivative with respect to a motion is the chain rule through W.
"""

import importlib
import pkgutil
from collections.abc import Callable
from types import MappingProxyType

from biodance.dance.target import Target
from biodance.errors import UnknownName
from biodance.records import Array

Criterion = Callable[[Array, Target], tuple[float, Array]]


def criteria() -> MappingProxyType[str, Criterion]:
    """Return all criteria of this folder by name."""
    modules = [importlib.import_module(f"{__name__}.{info.name}") for info in pkgutil.iter_modules(__path__)]
    return MappingProxyType({module.NAME: module.evaluate for module in modules})


def criterion(name: str) -> Criterion:
    """Return one criterion; UnknownName lists the legal ones."""
    family = criteria()
    if name not in family:
        raise UnknownName.of("excitation criterion", name, tuple(family))
    return family[name]

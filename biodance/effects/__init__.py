"""FAMILY: one candidate cause of disagreement per file, found automatically: to extend the model, add one file.

The diagnosis fits these causes. The virtual lab makes its faults by OTHER code
(``virtual_lab/recording_faults.py``, ``causes.py``): what is hidden is not made by the formula that finds it.
The name of an effect is the name of its file, which gives it as ``EFFECT``; the contract is `Effect` for causes that
have columns and are fitted, `DiscreteEffect` for those that a look at the recording settles before any statistics.
Other packages join by the entry points ``biodance.effects``, objects as arguments of ``diagnose``.
"""

import inspect
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from biodance.discovery import Chosen, Family
from biodance.effects._base.case import Case
from biodance.effects._base.effect import UNLIKE, Care, ChannelEffect, Effect, NamedCause, Parameter, Transient
from biodance.effects._base.installed_plate import InstalledPlate
from biodance.effects._base.missing_joint import MissingJoint
from biodance.effects._base.quality_check import (
    Checked,
    DiscreteEffect,
    QualityCheck,
    Quantity,
    Recorded,
    unit_at,
    unit_of,
)
from biodance.effects._base.words import About, CauseWords, CheckKind, SessionEntry
from biodance.errors import UnknownName
from biodance.spatial import wrench_about_origin, wrench_about_point

__all__ = [
    "UNLIKE",
    "About",
    "Care",
    "Case",
    "Cause",
    "CauseWords",
    "ChannelEffect",
    "CheckKind",
    "Checked",
    "DiscreteEffect",
    "Effect",
    "InstalledPlate",
    "MissingJoint",
    "NamedCause",
    "Parameter",
    "QualityCheck",
    "Quantity",
    "Recorded",
    "SessionEntry",
    "Transient",
    "causes",
    "check_quality",
    "discrete_effects",
    "effect",
    "effects",
    "known_cause",
    "unit_at",
    "unit_of",
    "wrench_about_origin",
    "wrench_about_point",
]

Cause = Effect | DiscreteEffect


def missing(candidate: object) -> tuple[str, ...]:
    """Return what an object or class lacks to be an effect."""
    kind = candidate if isinstance(candidate, type) else type(candidate)
    if not issubclass(kind, Effect | DiscreteEffect):
        return ("the base class Effect or DiscreteEffect",)
    lacks = ["a name"] if not kind.name else []
    lacks += sorted(getattr(kind, "__abstractmethods__", ())) if inspect.isabstract(kind) else []
    if issubclass(kind, Effect) and all(
        getattr(kind, name) is getattr(Effect, name) for name in ("columns", "transform", "added")
    ):
        lacks.append("columns or transform")
    return tuple(lacks)


FAMILY: Family[Cause | type[Cause]] = Family(
    "effect", "biodance.effects", __name__, "EFFECT", missing, lambda kind: kind.name
)


def causes(chosen: Chosen[Cause | type[Cause]] = None) -> Mapping[str, Cause]:
    """Return the effects of both kinds by name, without a target: all, or the ``chosen`` ones.

    Names choose from the family (UnknownName for others); objects and classes join what is chosen, the whole family
    where no name is given.
    """
    found = FAMILY.choose(chosen)
    return MappingProxyType({name: kind() if isinstance(kind, type) else kind for name, kind in found.items()})


def known_cause(name: str) -> Cause | Checked:
    """Return what is known of a cause by its name: its member of the family, or the defaults where it has no file."""
    return causes().get(name, Checked())


def effects(chosen: Chosen[Cause | type[Cause]] = None) -> Mapping[str, Effect]:
    """Return the effects that have columns among `causes`, by name."""
    return MappingProxyType({name: one for name, one in causes(chosen).items() if isinstance(one, Effect)})


def discrete_effects(chosen: Chosen[Cause | type[Cause]] = None) -> Mapping[str, DiscreteEffect]:
    """Return the effects that a check finds among `causes`, by name."""
    return MappingProxyType({name: one for name, one in causes(chosen).items() if isinstance(one, DiscreteEffect)})


def effect(name: str) -> Effect:
    """Return one effect that has columns; UnknownName lists all of them."""
    family = effects()
    if name not in family:
        raise UnknownName.of("effect", name, tuple(family))
    return family[name]


def check_quality(recorded: Recorded, *, chosen: Chosen[Cause | type[Cause]] = None) -> tuple[QualityCheck, ...]:
    """Return all checks of a session, those that are not well first; ``chosen`` limits or extends the effects
    (`causes`).
    """
    found = [
        replace(quality, advice=kind.advice)
        for kind in causes(chosen).values()
        for quality in recorded.once(kind.check)
    ]
    return tuple(sorted(found, key=lambda quality: quality.ok))

"""Fractions of the body mass that all tables and studies of living adults give a kind of segment."""

import functools
from collections.abc import Mapping

import numpy as np

from biodance.body.tables.choice import reference, studies
from biodance.body.tables.published import study_masses
from biodance.body.tables.reference import Reference, Sex
from biodance.records import Subject

WOMAN, MAN = Subject(65.0, 1.70, "F"), Subject(75.0, 1.75, "M")
LIVING = ("adult", "older")
_OWN_CUT = ("chen_2011", "ma_2011", "pavol_2002")


def published_fractions(kind: str, who: Subject) -> list[float]:
    """Return the fractions by all tables and studies of living adults of one sex; for the trunk only those that cut
    the pelvis themselves (Zatsiorsky's data are de Leva's; Winter's fractions count once, as the man's).
    """
    living = [
        name for name, group in studies(who.sex).items() if group in LIVING and name != "zatsiorsky_seluyanov_1979"
    ]
    own = [name for name in living if kind not in ("pelvis", "trunk_head") or name in _OWN_CUT]
    masses = _studied(who.sex)
    return [one.segments[kind].mass for one in published_people(who.sex)] + [masses[name][kind] for name in own]


@functools.cache
def published_people(sex: Sex) -> tuple[Reference, ...]:
    """Return the reference people of the published tables for one sex (Winter's counts once, as the man's)."""
    who = WOMAN if sex == "F" else MAN
    tables = ("de_leva_1996", "dumas_2018", *(("winter_2009",) if sex == "M" else ()))
    return tuple(reference(name, who) for name in tables)


@functools.cache
def _studied(sex: Sex) -> Mapping[str, dict[str, float]]:
    """Return the mass fractions of every kind of segment by study of living adults."""
    who = WOMAN if sex == "F" else MAN
    return {name: study_masses(name, who) for name, group in studies(sex).items() if group in LIVING}


def mean_fraction(kind: str, who: Subject) -> tuple[float, float]:
    """Return the mean of the published fractions and its standard error, relative."""
    found = published_fractions(kind, who)
    return float(np.mean(found)), float(np.std(found, ddof=1) / np.mean(found) / np.sqrt(len(found)))

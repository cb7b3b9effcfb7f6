"""Fractions of the body mass that all tables and studies of living adults give a kind of segment."""

import numpy as np

from biodance.body.tables.choice import reference, studies
from biodance.body.tables.published import study_masses
from biodance.records import Subject

WOMAN, MAN = Subject(65.0, 1.70, "F"), Subject(75.0, 1.75, "M")
LIVING = ("adult", "older")
_OWN_CUT = ("chen_2011", "ma_2011", "pavol_2002")


def published_fractions(kind: str, who: Subject) -> list[float]:
    """Return the fractions by all tables and studies of living adults of one sex; for the trunk only those that cut
    the pelvis themselves (Zatsiorsky's data are de Leva's; Winter's fractions count once, as the man's).
    """
    tables = ("de_leva_1996", "dumas_2018", *(("winter_2009",) if who.sex == "M" else ()))
    living = [
        name for name, group in studies(who.sex).items() if group in LIVING and name != "zatsiorsky_seluyanov_1979"
    ]
    own = [name for name in living if kind not in ("pelvis", "trunk_head") or name in _OWN_CUT]
    return [reference(name, who).segments[kind].mass for name in tables] + [
        study_masses(name, who)[kind] for name in own
    ]


def mean_fraction(kind: str, who: Subject) -> tuple[float, float]:
    """Return the mean of the published fractions and its standard error, relative."""
    found = published_fractions(kind, who)
    return float(np.mean(found)), float(np.std(found, ddof=1) / np.mean(found) / np.sqrt(len(found)))

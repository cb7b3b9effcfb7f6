"""How far a table can be from the person: standard deviations from the spread between tables and from published ones.

Two independent contributions, added as variances:

- between: the standard deviation over the tables. Masses: de Leva 1996, Dumas 2018, Winter 2009 and all studies of living adults in
  ``mass_studies.csv``; CoM and radii of gyration: women and men of de Leva 1996 and Dumas 2018, and Winter 2009.
- within: the printed standard deviations of the Zatsiorsky 2002 regressions, that is between men of the same mass and stature
  (no table prints any for women). A moment's spread counts for the radius as far as the mass's spread does not explain it.
"""

import functools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from biodance.body.de_leva import PARTS
from biodance.body.de_leva import lengths as reference_lengths
from biodance.body.inertia import Lump
from biodance.body.older_tables import regression, study_masses
from biodance.body.reference import Reference
from biodance.body.segment_tables import reference, studies
from biodance.records import Array, Subject

WOMAN, MAN = Subject(65.0, 1.70, "F"), Subject(75.0, 1.75, "M")
LIVING = ("adult", "older")
_AXES = ("sagittal", "longitudinal", "transverse")


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard deviations of one kind of segment.

    ``mass`` relative; ``com`` (3,) in units of the length; ``radii`` (3,) relative, of the radii of gyration about x, y, z;
    ``products`` (3,) of xy, xz, yz of the inertia per unit mass, in units of the length squared. The length is the segment's own; for
    pelvis and trunk_head it is mid hip to mid shoulder.
    """

    mass: float
    com: Array
    radii: Array
    products: Array


@functools.cache
def spread(kind: str) -> Spread:
    """Return the standard deviations of one kind of segment (pelvis, thigh, shank, foot, trunk_head, upper_arm, forearm_hand)."""
    tables = (*((name, who) for name in ("de_leva_1996", "dumas_2018") for who in (WOMAN, MAN)), ("winter_2009", MAN))
    people = [reference(*table) for table in tables]
    units = [_in_lengths(person, kind) for person in people]
    masses = [person.segments[kind].mass for person in people]
    masses += [study_masses(name, who)[kind] for who in (WOMAN, MAN) for name in _with_own(kind, who)]
    inner = _within(kind)
    tensor = np.array([unit.inertia for unit in units])
    return Spread(
        float(np.hypot(np.std(masses, ddof=1) / np.mean(masses), inner.mass)),
        np.hypot(_sd(unit.com for unit in units), inner.com),
        np.hypot(_sd(0.5 * np.log(np.diag(one)) for one in tensor), inner.radii),
        _sd(one[(0, 0, 1), (1, 2, 2)] for one in tensor),
    )


def _sd(values: Iterable[Array]) -> Array:
    return np.asarray(np.std(np.array(list(values)), axis=0, ddof=1))


def _with_own(kind: str, who: Subject) -> list[str]:
    """Return the studies of living adults; for the trunk only those that cut the pelvis themselves (Zatsiorsky's data are de Leva's)."""
    living = [name for name, group in studies(who.sex).items() if group in LIVING and name != "zatsiorsky_seluyanov_1979"]
    return [name for name in living if kind not in ("pelvis", "trunk_head") or name in ("chen_2011", "ma_2011", "pavol_2002")]


def _in_lengths(person: Reference, kind: str) -> Lump:
    """Return the segment in units of its length, CoM of the trunk from the mid hip; ``inertia`` per unit mass."""
    unit, length = person.segments[kind], person.lengths[kind]
    base = np.zeros(3)
    if kind in ("pelvis", "trunk_head"):
        length = person.lengths["trunk_head"]
        base[1] = person.lengths["pelvis"] if kind == "trunk_head" else 0.0
    return Lump(1.0, (unit.com + base) / length, unit.inertia / length**2)


def _within(kind: str) -> Spread:
    """Return the spread between men of one mass and stature; parts of a compound segment vary independently."""
    parts = PARTS[kind]
    mass, mass_sd = np.array([regression(part, "mass", "", MAN) for part in parts]).T
    share = mass / mass.sum()
    length = reference_lengths("M")["trunk_head" if kind == "pelvis" else kind]
    com = np.linalg.norm(share * [regression(part, "com", "longitudinal", MAN)[1] for part in parts]) / length
    along = np.array([com, 0.0, 0.0]) if kind == "foot" else np.array([0.0, com, 0.0])
    names = ("longitudinal", "sagittal", "transverse") if kind == "foot" else _AXES
    radii = np.array([share @ [_radius_sd(part, axis) for part in parts] for axis in names])
    return Spread(float(np.linalg.norm(mass_sd) / mass.sum()), along, radii, np.zeros(3))


def _radius_sd(part: str, axis: str) -> float:
    (moment, moment_sd), (mass, mass_sd) = regression(part, "inertia", axis, MAN), regression(part, "mass", "", MAN)
    return 0.5 * float(np.sqrt(max((moment_sd / moment) ** 2 - (mass_sd / mass) ** 2, 0.0)))

"""Choose a table of segment inertial parameters: a shipped one or a study by its name, a user's own by the path of
its .csv file.

A user's own (DXA, scan) is in the segments and frames of the model itself, complete or not. Segments are pelvis,
thigh, shank, foot, trunk_head, upper_arm and forearm_hand (right side; one of two); CoM and radii of gyration are in
the segment frame (x anterior, y up, z right, origin at the proximal joint, for the pelvis the middle of the hip
centres), radii about the CoM. Lengths are those of `Reference`. What it leaves out comes from another table at the
person's stature.
"""

from collections.abc import Callable, Mapping

import numpy as np

from biodance.body.inertia import RigidInertia, inertial_parameters, smallest_eigenvalues
from biodance.body.tables.anthropometry import COUNT, KINDS, Reference, normalised_person
from biodance.body.tables.de_leva import de_leva
from biodance.body.tables.published import dumas, study, winter, zatsiorsky
from biodance.body.tables.segment_data import FAMILY, SegmentTable, read_segment_table
from biodance.errors import BiodanceError, FileRefused, known_index
from biodance.records import Subject

_AXES = "xyz"
FULL = 0.02
"""How far the masses of a complete table may sum from the whole body, as a share."""


def completed(table: SegmentTable, subject: Subject, base: Reference) -> Reference:
    """Return the person of a table in the model's segments, with what it lacks from ``base``.

    Raises
    ------
    FileRefused
        A segment that the model does not have, no row for the person's sex, masses that are no whole body, or a segment
        that cannot exist.
    """
    known = {key[1] for key in table.numbers if key[2] == subject.sex}
    strange = sorted({key[1] for key in table.numbers} - set(KINDS))
    if strange:
        raise FileRefused(f"{table.name}: {strange[0]!r} is not a segment of the model. Legal: {', '.join(KINDS)}.")
    if not known:
        raise FileRefused(
            f"{table.name}: holds no row for sex {subject.sex}. Add rows, or write FM where they hold for both."
        )
    lengths = {kind: _length(table, kind, subject, base) for kind in KINDS}
    masses = _masses(table, subject, base)
    lumps = {kind: _lump(table, kind, subject, base, lengths[kind], masses[kind]) for kind in KINDS}
    for kind, lump in lumps.items():
        if smallest_eigenvalues(inertial_parameters(lump))[0] <= 0:
            raise FileRefused(
                f"{table.name}: no body has the radii of gyration given for {kind} (each moment at most the sum of "
                f"the others)."
            )
    return normalised_person(table.name, subject.stature, lengths, lumps)


def _length(table: SegmentTable, kind: str, subject: Subject, base: Reference) -> float:
    found = table.find(kind, "length", sex=subject.sex)
    if found is None:
        return base.lengths[kind] * subject.stature / base.stature
    return found.of(subject) * (subject.stature if found.unit == "stature" else 1.0)


def _masses(table: SegmentTable, subject: Subject, base: Reference) -> dict[str, float]:
    """Return the share of the body mass of one segment of each kind; those not given share what the others leave."""
    given = {kind: found for kind in KINDS if (found := table.find(kind, "mass", sex=subject.sex))}
    share = {kind: one.of(subject) / (subject.mass if one.unit == "kg" else 1.0) for kind, one in given.items()}
    total = sum(COUNT[kind] * value for kind, value in share.items())
    rest = {kind: base.segments[kind].mass for kind in KINDS if kind not in share}
    if (not rest and abs(total - 1) > FULL) or (rest and not 0 <= total < 1) or min(share.values(), default=1.0) <= 0:
        raise FileRefused(
            f"{table.name}: the masses given are {100 * total:.1f} % of the body (two of each limb), expected "
            f"{'less than 100' if rest else f'100 within {100 * FULL:.0f}'} %. Give the mass of one limb, in kg or as "
            f"share of the body."
        )
    left = (1 - total) / sum(COUNT[kind] * value for kind, value in rest.items()) if rest else 0.0
    return share | {kind: left * value for kind, value in rest.items()}


def _lump(
    table: SegmentTable, kind: str, subject: Subject, base: Reference, length: float, mass: float
) -> RigidInertia:
    """Return one segment: the base table's, stretched to ``length`` m, with the CoM and radii that the table gives."""
    stretch = length / base.lengths[kind]
    com, inertia = np.array(base.segments[kind].com) * stretch, np.array(base.segments[kind].inertia) * stretch**2
    wider = np.ones(3)
    for i, axis in enumerate(_AXES):
        if place := table.find(kind, "com", axis, sex=subject.sex):
            com[i] = place.of(subject) * (length if place.unit == "length" else 1.0)
        if radius := table.find(kind, "gyration", axis, sex=subject.sex):
            metres = radius.of(subject) * (length if radius.unit == "length" else 1.0)
            wider[i] = abs(metres) / np.sqrt(inertia[i, i])
    return RigidInertia(mass, com, mass * (inertia * np.outer(wider, wider)))  # correlations are kept


BASE = "de_leva_1996"
"""The table that completes a user's own, unless its .toml says otherwise (``completed_by``)."""
LAYOUTS: Mapping[str, Callable[[Subject], Reference]] = {
    "along_segments": de_leva,
    "full_tensors": dumas,
    "one_radius": winter,
    "regressions": zatsiorsky,
}
"""How the published tables give their segments; whoever cuts the body as the model does uses the layout "model"."""
STUDIES = "mass_studies"
NO_TABLES = ("uncertainty", STUDIES)


def studies(sex: str) -> dict[str, str]:
    """Return the studies of segment masses that hold for a sex, with their group: adult, older, child or cadaver."""
    return {study: group for (study, own), group in read_segment_table(STUDIES).groups.items() if own == sex}


def tables(sex: str | None = None) -> tuple[SegmentTable, ...]:
    """Return the tables known by name, the shipped ones first; only those that speak of ``sex`` if given."""
    found = (read_segment_table(name) for name in FAMILY.files() if name not in NO_TABLES)
    return tuple(table for table in found if sex is None or sex in table.sexes)


def table_names(sex: str) -> tuple[str, ...]:
    """Return all names that ``reference`` knows for a sex."""
    return (*(table.name for table in tables(sex)), *studies(sex))


def measured_whole() -> tuple[str, ...]:
    """Return the shipped tables of whole bodies for both sexes (``measured_whole`` in their .toml): one laid every CoM
    on the line between the joint centres, the other measured where it lies.
    """
    shipped = FAMILY.shipped()
    return tuple(table.name for table in tables() if table.name in shipped and table.provenance.get("measured_whole"))


def trunk_joint(table: str) -> str:
    """Return where a table cuts the trunk, in words."""
    if table in (*studies("F"), *studies("M")):
        return trunk_joint(STUDIES)
    found = read_segment_table(table).provenance
    return str(found.get("trunk_joint") or trunk_joint(found.get("completed_by", BASE)))


def reference(table: str, subject: Subject) -> Reference:
    """Return the reference person of one table: ``de_leva_1996``, ``dumas_2018``, ``winter_2009``, ``zatsiorsky_2002``
    (men), a study of segment masses, for example ``pavol_2002`` (older adults) or ``jensen_1986_12y``, or a user's own
    by its path.

    Raises
    ------
    UnknownName
        No such table for this sex; the message lists the legal ones.
    FileRefused
        A user's own table breaks a rule (`read_segment_table`, `completed`).
    """
    table = str(table)
    if table in studies(subject.sex):
        return study(table, subject)
    shipped = table in FAMILY.files() and table not in NO_TABLES and subject.sex in read_segment_table(table).sexes
    if not shipped and not table.endswith(FAMILY.suffix) and table != "zatsiorsky_2002":
        known_index(f"table of segment inertial parameters for sex {subject.sex}", table, table_names(subject.sex))
    own = read_segment_table(table)
    if own.layout == "model":
        return completed(own, subject, reference(str(own.provenance.get("completed_by", BASE)), subject))
    if own.layout not in LAYOUTS or LAYOUTS[own.layout](subject).table != table:
        raise BiodanceError(
            f"{table}: the layout {own.layout!r} is that of a published table. Write the rows in the segments of the "
            'model and layout = "model", or no layout.'
        )
    return LAYOUTS[own.layout](subject)

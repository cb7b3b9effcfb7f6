"""Choose a table of segment inertial parameters: a shipped one or a study by its name, a user's own by the path of
its .csv file.
"""

from collections.abc import Callable, Mapping

from biodance.body.tables.de_leva import de_leva
from biodance.body.tables.dumas import dumas
from biodance.body.tables.older import study, winter, zatsiorsky
from biodance.body.tables.own import completed
from biodance.body.tables.reference import Reference
from biodance.body.tables.segment_data import FAMILY, SegmentTable, read_segment_table
from biodance.errors import BiodanceError, UnknownName
from biodance.records import Subject

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
        A user's own table breaks a rule (`read_segment_table`, `own_table.completed`).
    """
    table = str(table)
    if table in studies(subject.sex):
        return study(table, subject)
    if not table.endswith(FAMILY.suffix) and table not in table_names(subject.sex) and table != "zatsiorsky_2002":
        raise UnknownName.of(
            f"table of segment inertial parameters for sex {subject.sex}", table, table_names(subject.sex)
        )
    found = read_segment_table(table)
    if found.layout == "model":
        return completed(found, subject, reference(str(found.provenance.get("completed_by", BASE)), subject))
    if found.layout not in LAYOUTS or LAYOUTS[found.layout](subject).table != table:
        raise BiodanceError(
            f"{table}: the layout {found.layout!r} is that of a published table. Write the rows in the segments of "
            f"the model and "
            'layout = "model", or no layout.'
        )
    return LAYOUTS[found.layout](subject)

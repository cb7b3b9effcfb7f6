"""Choose a table of segment inertial parameters by name."""

from collections.abc import Callable, Mapping

from biodance.body.de_leva import de_leva
from biodance.body.dumas import dumas
from biodance.body.older_tables import study, winter, zatsiorsky
from biodance.body.reference import Reference
from biodance.body.tables import read_table
from biodance.errors import UnknownName
from biodance.records import Subject

READERS: Mapping[str, Callable[[Subject], Reference]] = {
    "de_leva_1996": de_leva,
    "dumas_2018": dumas,
    "winter_2009": winter,
    "zatsiorsky_2002": zatsiorsky,
}


def studies(sex: str) -> dict[str, str]:
    """Return the studies of segment masses that hold for a sex, with their group: adult, older, child or cadaver."""
    return {row["study"]: row["group"] for row in read_table("segments", "mass_studies").rows if sex in row["sex"]}


def table_names(sex: str) -> tuple[str, ...]:
    """Return all names that ``reference`` knows for a sex."""
    return (*(name for name in READERS if name != "zatsiorsky_2002" or sex == "M"), *studies(sex))


def reference(table: str, subject: Subject) -> Reference:
    """Return the reference person of one table: ``de_leva_1996``, ``dumas_2018``, ``winter_2009``, ``zatsiorsky_2002`` (men) or a study of
    segment masses, for example ``pavol_2002`` (older adults) or ``jensen_1986_12y``.

    Raises
    ------
    UnknownName
        No such table for this sex; the message lists the legal ones.
    """
    if table in READERS:
        return READERS[table](subject)
    if table not in studies(subject.sex):
        raise UnknownName.of(f"table of segment inertial parameters for sex {subject.sex}", table, table_names(subject.sex))
    return study(table, subject)

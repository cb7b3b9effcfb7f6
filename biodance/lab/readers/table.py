"""Tables of markers and forces: CSV, TSV and Parquet as data sets publish them."""

from pathlib import Path

from biodance.lab.plates.told import Told
from biodance.lab.readers import head_text
from biodance.lab.tables.cells import clean_label, header_of, is_parquet
from biodance.lab.tables.columns import FEWEST_MARKERS, columns_in
from biodance.records import Role, Trial

NAME = "table of markers and forces"
EXTENSIONS = (".csv", ".tsv", ".parquet", ".txt")
PREFERENCE = 40
FOLLOWS_TOLD = True


def sniff(head: bytes) -> bool:
    """Return whether the head is that of a Parquet file, or has labels of a time and of three markers."""
    if is_parquet(head):
        return True
    header = header_of(head_text(head))
    if header is None:
        return False
    columns = columns_in([clean_label(cell)[0] for cell in header[2]])
    return columns.time is not None and len(columns.markers) >= FEWEST_MARKERS


def read(path: Path, *, role: Role, subject: str | None = None, told: Told | None = None) -> Trial:
    """Return the trial of a table (`biodance.lab.tables.read`)."""
    from biodance.lab.tables.read import read_marker_table

    return read_marker_table(path, role=role, told=told)

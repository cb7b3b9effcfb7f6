"""Files that stand whole or not at all; tables as CSV, for spreadsheets, and as Parquet, which keeps types."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from biodance.errors import BiodanceError, SessionRefused
from biodance.lab.plain_text import for_spreadsheet, write_whole
from biodance.lab.session.results_folder import made_folder
from biodance.report.tables.schema import Row, to_text

if TYPE_CHECKING:
    from pandas import DataFrame


def refuse_page(path: Path, *, force: bool) -> None:
    """Raise BiodanceError where ``path`` does not end in .html, or as `refuse_file`."""
    if path.suffix.lower() != ".html":
        raise BiodanceError(f"{path}: a page is one file that ends in .html. Choose --out {path}.html.")
    refuse_file(path, force=force)


def refuse_file(path: Path, *, force: bool) -> None:
    """Raise BiodanceError where ``path`` is a folder, exists and ``force`` was not given, or its folder is missing."""
    if path.is_dir():
        raise BiodanceError(f"{path}: is a folder; one file is written. Choose another --out.")
    if path.exists() and not force:
        raise BiodanceError(f"{path}: exists already and is not overwritten. Choose another --out, or --force.")
    refuse_missing_folder(path)


def refuse_missing_folder(path: Path) -> None:
    """Raise BiodanceError where the folder of a file to write is missing."""
    if not path.parent.is_dir():
        raise BiodanceError(f"{path.parent}: there is no such folder. Make it, or choose another --out.")


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Write every file whole, over an earlier one."""
    for name, text in files.items():
        write_whole(folder / name, text.encode(), over=True)


def write_results(folder: Path, document: Row, files: Mapping[str, str]) -> Row:
    """Write a ``document`` as results.json and ``files`` beside it; return it as programs read it."""
    text = to_text(document)
    write_files(folder, {"results.json": text, **files})
    told: Row = json.loads(text)
    return told


ENDINGS = (".csv", ".parquet")


def tables_folder(folder: Path, session: Path, *, force: bool) -> Path:
    """Return the folder for tables, made if missing, before any long work starts. Raises SessionRefused: it is the
    session folder or one above it, a file, holds anything else than tables, or holds tables and not ``force``.
    """
    folder, session = folder.resolve(), session.resolve()
    if folder == session or folder in session.parents:
        raise SessionRefused(f"{folder}: tables must not lie among the recordings. Give another folder for --tables.")
    if folder.exists() and not folder.is_dir():
        raise SessionRefused(f"{folder}: is a file; the tables need a folder. Choose another name for --tables.")
    files = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".")) if folder.is_dir() else []
    other = [name for name in files if Path(name).suffix not in ENDINGS]
    if files and (other or not force):
        wanted = "Give another folder for --tables" if other else "Give another folder, or --force"
        raise SessionRefused(
            f"{folder}: holds files already ({(other or files)[0]}) and nothing is overwritten. {wanted}."
        )
    return made_folder(folder)


def for_spreadsheets(frame: "DataFrame") -> "DataFrame":
    """Return a table with all its texts and headings as `for_spreadsheet`; itself where none begins a formula."""
    from pandas.api.types import is_numeric_dtype

    # each text is looked at once: a trial's name stands in every frame's row
    some = (name for name in frame.columns if not is_numeric_dtype(frame[name]))
    formulas = (name for name in some if any(for_spreadsheet(cell) is not cell for cell in frame[name].unique()))
    texts = {name: frame[name].map(for_spreadsheet) for name in formulas}
    if not texts and all(for_spreadsheet(name) is name for name in frame.columns):
        return frame
    return frame.assign(**texts).rename(columns=for_spreadsheet)


def csv_text(frame: "DataFrame") -> str:
    """Return a table as the text of a CSV file for spreadsheets."""
    return for_spreadsheets(frame).to_csv(index=False, lineterminator="\n")


def write_tables(tables: Mapping[str, "DataFrame"], folder: Path) -> tuple[Path, ...]:
    """Write every table as ``NAME.csv`` and ``NAME.parquet`` into a folder that exists, and return the paths.

    In the CSV, texts are as `for_spreadsheet`. Both by pyarrow: its text is the shortest that reads back exactly, like
    pandas' own, in a tenth of the time.
    """
    from pyarrow import Table, csv, parquet

    plain, written = csv.WriteOptions(quoting_style="needed", quoting_header="needed"), []
    for name, frame in tables.items():
        text, typed = (folder / f"{name}{ending}" for ending in ENDINGS)
        table, shown = Table.from_pandas(frame, preserve_index=False), for_spreadsheets(frame)
        csv.write_csv(table if shown is frame else Table.from_pandas(shown, preserve_index=False), text, plain)
        parquet.write_table(table, typed)
        written += [text, typed]
    return tuple(written)

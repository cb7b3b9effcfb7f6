"""What a run has left of a session, as a window shows and hands it out: the verdict, parts of the page, its tables as
Excel and CSV, and the formats of other programs, written by `biodance export` in a process of its own.
"""

import io
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from biodance.app.sessions import SessionPlace
from biodance.batch.summary import folder_name
from biodance.batch.work import TABLES
from biodance.child_process import run_python
from biodance.errors import BiodanceError, UnknownName, refuse_unknown
from biodance.lab.session.results_folder import check_results
from biodance.library import parse_json
from biodance.report.files import for_spreadsheets

_LONGEST = 600.0  # s that a program started for one download may take
_MOST_ROWS = 20_000  # Rows of a sheet: tables by frame have more, and are for programs (CSV, Parquet)
_PARTS: Mapping[str, tuple[str, ...]] = {
    "gait": ("movement", "gait"),
    "body": ("body", "replay", "masses", "predicts", "torques", "impact", "load", "danced", "changes", "standing"),
    "quality": ("figures", "checks", "trials", "made"),
}
"""Sections of report.html by the tab that shows them."""
EXPORTS: Mapping[str, str] = {
    "c3d": "c3d",
    "trc": "trc",
    "mot": "mot",
    "opensim": "",
    "bids": "",
    "osim": "osim",
    "urdf": "urdf",
}
"""Formats that are offered, and the ending of their file; "" = a folder, handed out as .zip."""
_OF_TRIALS = ("c3d", "trc", "mot")
_SHOWN = ("attention", "judged", "checks", "subject", "mass_check", "refused", "steps")
_FINDING = ("effect", "target", "trials", "parameters", "probability", "gain", "advice", "session_entry")


def read_results(place: SessionPlace) -> dict[str, Any]:
    """Return the content of results.json.

    Raises
    ------
    BiodanceError
        There are no results, or they are damaged.
    """
    try:
        return dict(parse_json((place.results / "results.json").read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise BiodanceError(f"{place.name}: has no results yet. Run it.") from None
    except (OSError, ValueError) as error:
        raise BiodanceError(f"{place.results}: the results cannot be read ({error}). Run it again.") from error


def shown_results(place: SessionPlace) -> dict[str, Any]:
    """Return what the tabs Steps, Quality and Files show of the results."""
    found = read_results(place)
    told = found["diagnosis"] or {}
    kept = check_results(place.results)
    moved = (found["movement"] or {"trials": []})["trials"]
    return {
        **{key: found.get(key) for key in _SHOWN},
        "status": told.get("status"),
        "reasons": told.get("reasons", []),
        "findings": [{key: one.get(key) for key in _FINDING} for one in told.get("findings", [])],
        "trials": [{key: one[key] for key in ("name", "role", "status", "reason")} for one in found["trials"]],
        "moved": [{key: one[key] for key in ("trial", "events", "cycles")} for one in moved],
        "files": sorted(kept.manifest.outputs) if kept else [],
        "folder": str(place.results),
        "exports": [{"format": name, "of_trial": name in _OF_TRIALS} for name in EXPORTS],
        "tables": (place.results / TABLES).is_dir(),
    }


def page_part(place: SessionPlace, part: str) -> str:
    """Return report.html with the sections of one ``part`` alone; the whole page for "" and where it has none."""
    page = _file(place, "report.html").read_text(encoding="utf-8")
    if not part:
        return page
    kept = [one for one in _PARTS.get(part, ()) if f'<section id="{one}">' in page]
    if not kept:
        return _NOTHING
    shown = ", ".join(f"#{one}" for one in kept)
    alone = f"<style>body > header, main > :not({shown}) {{ display: none; }}</style></head>"
    return page.replace("</head>", alone, 1)


_NOTHING = """<!doctype html><html lang="en"><title>biodance</title>
<p style="font: 15px sans-serif">The last run has nothing to show here.</p></html>"""


def results_file(place: SessionPlace, name: str) -> Path:
    """Return a file that the run wrote; BiodanceError for every other path."""
    kept = check_results(place.results)
    if kept is None or name not in kept.manifest.outputs:
        raise UnknownName.of("file of the results", name, tuple(kept.manifest.outputs) if kept else ())
    return _file(place, name)


def _file(place: SessionPlace, name: str) -> Path:
    path = place.results / name
    if not path.is_file():
        raise BiodanceError(f"{place.name}: there is no {name}. Run it.")
    return path


def _tables(place: SessionPlace) -> list[Path]:
    found = sorted((place.results / TABLES).glob("*.parquet"))
    if not found:
        raise BiodanceError(f"{place.name}: its results have no tables yet. Run it.")
    return found


def workbook(place: SessionPlace) -> bytes:
    """Return the tables of the results as .xlsx, one sheet each; those by frame are left to CSV and Parquet."""
    import pandas as pd

    buffer, tables = io.BytesIO(), {path.stem: pd.read_parquet(path) for path in _tables(place)}
    kept = {
        name: table
        for name, table in tables.items()
        if len(table) <= _MOST_ROWS and not name.endswith(("residuals", "angle_states"))
    }
    about = [f"Session {place.name}", f"Tables with units in their headings; all in {place.results / TABLES}."]
    about += [
        f"{name}: {len(table)} rows{'' if name in kept else ', as CSV and Parquet alone'}."
        for name, table in tables.items()
    ]
    options = {"options": {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}}
    with pd.ExcelWriter(buffer, engine="xlsxwriter", engine_kwargs=options) as book:
        pd.Series(about).to_excel(book, sheet_name="about", index=False, header=False)
        for name, table in kept.items():
            known = for_spreadsheets(table.replace([np.inf, -np.inf], np.nan))
            known.to_excel(book, sheet_name=name[:31], index=False, freeze_panes=(1, 1))
            book.sheets[name[:31]].autofit(max_width=300)
    return buffer.getvalue()


def csv_archive(place: SessionPlace) -> bytes:
    """Return all tables of the results as CSV in a .zip."""
    paths = [path.with_suffix(".csv") for path in _tables(place)]
    return _zipped({path.name: path for path in paths})


def exported(place: SessionPlace, kind: str, trial: str) -> tuple[str, bytes]:
    """Return name and content of the results in the format of another program; of one ``trial`` where it holds one.

    Raises
    ------
    BiodanceError
        It cannot be written; the sentence is that of ``biodance export``.
    """
    refuse_unknown("format", kind, EXPORTS)
    stem = folder_name(f"{place.name}_{trial}" if trial else place.name).replace(" ", "_")
    with tempfile.TemporaryDirectory(prefix="biodance-") as folder:
        out = Path(folder) / (f"{stem}.{EXPORTS[kind]}" if EXPORTS[kind] else f"{stem}_{kind}")
        chosen = [f"--trial={trial}"] if trial and kind in _OF_TRIALS else []
        run_command("export", str(place.results), f"--format={kind}", f"--out={out}", *chosen)
        if out.is_dir():
            inside = (path for path in sorted(out.rglob("*")) if path.is_file())
            return f"{out.name}.zip", _zipped({path.relative_to(out).as_posix(): path for path in inside})
        return out.name, out.read_bytes()


def _zipped(paths: Mapping[str, Path]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, path in paths.items():
            packed.write(path, name)
    return buffer.getvalue()


def run_command(*arguments: str, module: str = "biodance") -> str:
    """Run a command of biodance in a process of its own and return what it prints; BiodanceError says why it failed."""
    try:
        done = run_python("-m", module, *arguments, timeout=_LONGEST)
    except subprocess.TimeoutExpired:
        raise BiodanceError(f"biodance {arguments[0]} gave no answer within {_LONGEST:.0f} s and was ended.") from None
    if done.returncode not in (0, 1):
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise BiodanceError(said[-1] if said else f"biodance {arguments[0]} ended with code {done.returncode}.")
    return done.stdout.decode("utf-8", "replace")


def run_task(task: str, *arguments: str) -> Any:
    """Return what one of `tasks.TASKS` answers, in a process of its own; BiodanceError says why it failed."""
    return parse_json(run_command(task, *arguments, module="biodance.app.tasks"))


def preview_of_acceptance(place: SessionPlace, out: Path) -> dict[str, Any]:
    """Diagnose a session and write what acceptance would write into a folder beside; return before and after:
    ``residuals`` as `tasks.residual_rows`; ``written`` files with what they are, ``not_applied`` causes with why. The
    recordings are not touched; the folder is gone where it fails.
    """
    folder = _preview_folder(place, out)
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        command = run_command("diagnose", str(place.folder), "--accept", f"--out={folder}", "--force", "--json")
        accepted = parse_json(command).get("accepted") or {}
        residuals = run_task("residuals", str(place.folder), str(folder))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return {"residuals": residuals} | {key: accepted.get(key, []) for key in ("written", "not_applied", "corrections")}


def keep_acceptance(place: SessionPlace, out: Path) -> Path:
    """Give what `preview_of_acceptance` wrote its own place and return it; an earlier one is kept beside it.
    BiodanceError where there is no preview.
    """
    preview, kept = _preview_folder(place, out), out / "accepted" / folder_name(place.name)
    if not preview.is_dir():
        raise BiodanceError(f"{place.name}: there is nothing to keep. Look at before and after first.")
    if kept.exists():
        names = (kept.with_name(f"{kept.name} {number}") for number in range(2, 10_000))
        kept = next(path for path in names if not path.exists())
    preview.rename(kept)
    return kept


def _preview_folder(place: SessionPlace, out: Path) -> Path:
    return out / "accepted" / f"{folder_name(place.name)} (preview)"

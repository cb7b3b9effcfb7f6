"""What the pages of a window ask for, each question a method, and what a run has left of a session to be shown."""

import io
import json
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from starlette.responses import Response

from biodance.app.limits import limits_form, limits_text
from biodance.app.sessions import (
    Archive,
    SessionPlace,
    Worker,
    allowed_folder,
    changed_text,
    folders_document,
    results_beside,
)
from biodance.app.view import SessionView, forces_document, markers_document
from biodance.batch.summary import folder_name
from biodance.batch.work import TABLES
from biodance.child_process import run_python
from biodance.errors import BiodanceError, UnknownName, refuse_unknown
from biodance.lab.session.results_folder import check_results
from biodance.library import parse_json
from biodance.records import Trial
from biodance.report.files import for_spreadsheets
from biodance.report.pages.template import template_text, three_js
from biodance.version import __version__

_LONGEST = 600.0  # s that a program started for one download may take
_PATIENCE = 0.3  # s that the answer to how a run stands waits for its end
_MOST_ROWS = 20_000  # Rows of a sheet: tables by frame have more, and are for programs (CSV, Parquet)
_PARTS: Mapping[str, tuple[str, ...]] = {
    "gait": ("movement", "gait"),
    "body": ("body", "replay", "masses", "predicts", "torques", "impact", "load", "danced", "changes", "standing"),
    "quality": ("figures", "checks", "trials", "made"),
}
"""Sections of report.html by the tab that shows them."""
_OF_TRIALS, _FOLDERS = ("c3d", "trc", "mot"), ("opensim", "bids")
EXPORTS = (*_OF_TRIALS, *_FOLDERS, "osim", "urdf")
"""Formats that are offered; a folder is handed out as .zip."""
_SHOWN = ("attention", "judged", "checks", "subject", "mass_check", "refused", "steps")
_FINDING = ("effect", "target", "trials", "parameters", "probability", "gain", "advice", "session_entry")


def read_results(place: SessionPlace) -> dict[str, Any]:
    """Return the content of results.json. Raises BiodanceError: there are no results, or they are damaged."""
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
        return _NOTHING.format(_WHY_NOT.get(part, "The last run has nothing to show here."))
    if "replay" not in kept:  # a browser would build the 3-D picture, which nobody sees there
        for script in (three_js(), template_text("replay.js")):
            page = page.replace(f"<script>{script}</script>", "")
    shown = ", ".join(f"#{one}" for one in kept)
    alone = f"body > header, main > :not({shown}) {{ display: none; }} body {{ padding-top: 0; }}"
    return page.replace("</head>", f"<style>{alone} h2 {{ margin-top: 1rem; }}</style></head>", 1)


_NOTHING = """<!doctype html><html lang="en"><title>biodance</title>
<p style="font: 15px sans-serif">{}</p></html>"""
_WHY_NOT = {
    "gait": "No whole gait cycle (from a foot's strike to its next), squat, rise or jump was found in any recording. "
    "Steps shows the strikes that were found, Quality what could not be used."
}
"""Why a part of the page is empty, where there is one reason."""


def results_file(place: SessionPlace, name: str) -> Path:
    """Return a file that the run wrote; BiodanceError for every other path."""
    kept = check_results(place.results)
    if kept is None or name not in kept.manifest.outputs:
        raise UnknownName.of("file of the results", name, tuple(kept.manifest.outputs) if kept else ())
    return _file(place, name)


def _file(place: SessionPlace, name: str) -> Path:
    if not (place.results / name).is_file():
        raise BiodanceError(f"{place.name}: there is no {name}. Run it.")
    return place.results / name


def _tables(place: SessionPlace) -> list[Path]:
    if found := sorted((place.results / TABLES).glob("*.parquet")):
        return found
    raise BiodanceError(f"{place.name}: its results have no tables yet. Run it.")


def workbook(place: SessionPlace) -> bytes:
    """Return the tables of the results as .xlsx, one sheet each; those by frame are left to CSV and Parquet."""
    import pandas as pd

    buffer, kept = io.BytesIO(), dict[str, pd.DataFrame]()
    about = [f"Session {place.name}", f"Tables with units in their headings; all in {place.results / TABLES}."]
    for name, table in ((path.stem, pd.read_parquet(path)) for path in _tables(place)):
        by_frame = len(table) > _MOST_ROWS or name.endswith(("residuals", "angle_states"))
        about.append(f"{name}: {len(table)} rows{', as CSV and Parquet alone' if by_frame else ''}.")
        if not by_frame:
            kept[name] = table
    options = {"options": {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}}
    with pd.ExcelWriter(buffer, engine="xlsxwriter", engine_kwargs=options) as book:
        pd.Series(about).to_excel(book, sheet_name="about", index=False, header=False)
        for name, table in kept.items():
            known = for_spreadsheets(table.replace([np.inf, -np.inf], np.nan))
            known.to_excel(book, sheet_name=name[:31], index=False, freeze_panes=(1, 1))
            book.sheets[name[:31]].autofit(max_width=300)
    return buffer.getvalue()


def exported(place: SessionPlace, kind: str, trial: str) -> tuple[str, bytes]:
    """Return name and content of the results in the format of another program; of one ``trial`` where it holds one.
    Raises BiodanceError: it cannot be written; the sentence is that of ``biodance export``.
    """
    refuse_unknown("format", kind, EXPORTS)
    stem = folder_name(f"{place.name}_{trial}" if trial else place.name).replace(" ", "_")
    with tempfile.TemporaryDirectory(prefix="biodance-") as folder:
        out = Path(folder) / (f"{stem}_{kind}" if kind in _FOLDERS else f"{stem}.{kind}")
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
    folder = out / "accepted" / f"{folder_name(place.name)} (preview)"
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
    """Put what `preview_of_acceptance` wrote in a place of its own; BiodanceError where there is nothing."""
    kept = out / "accepted" / folder_name(place.name)
    preview = kept.with_name(f"{kept.name} (preview)")
    if not preview.is_dir():
        raise BiodanceError(f"{place.name}: there is nothing to keep. Look at before and after first.")
    if kept.exists():
        names = (kept.with_name(f"{kept.name} {number}") for number in range(2, 10_000))
        kept = next(path for path in names if not path.exists())
    preview.rename(kept)
    return kept


DROPPED = "dropped"
"""Folder of copies of what was dropped on a window, in that of the results."""
_SANDBOX = "sandbox allow-scripts allow-popups allow-modals allow-downloads; frame-ancestors 'self'"
"""What a page of results may do in a tab: run its own scripts, save a figure, and reach nothing of the window's."""


@dataclass(frozen=True)
class Asked:
    """What a request asks: ``query`` and JSON ``body``."""

    query: Mapping[str, str]
    body: Mapping[str, Any]

    def text(self, key: str) -> str:
        """Return a text of the query or the body; "" where it is not there."""
        value = self.body.get(key, self.query.get(key, ""))
        if not isinstance(value, str):
            raise BiodanceError(f"{key} = {value!r} is no text.")
        return value


class Window:
    """What the pages of a window over an ``archive`` ask for."""

    def __init__(self, archive: Archive) -> None:
        self.archive, self.worker = archive, Worker(archive)
        self._roots = tuple(dict.fromkeys(one.resolve() for one in (Path.home(), archive.out, archive.folder)))
        self.dropped = archive.out / DROPPED
        self._view: SessionView | None = None
        self._lock, self._one_export = Lock(), Lock()

    def listed(self, _: Asked) -> dict[str, Any]:
        """Return all sessions with what is known of them."""
        self.archive.look()
        told = {"folder": str(self.archive.folder.resolve()), "out": str(self.archive.out), "version": __version__}
        return told | {"rows": self.archive.rows(), "run": self.worker.document()}

    def folders(self, asked: Asked) -> dict[str, Any]:
        """Return the folders in one, to choose from."""
        return folders_document(asked.text("folder"), self._roots)

    def open(self, asked: Asked) -> dict[str, Any]:
        """Show the sessions of another folder; its results go beside it."""
        folder = allowed_folder(asked.text("folder"), self._roots)
        with self._lock:
            self.refuse_while_running()
            archive = Archive(folder, results_beside(folder))
            self.archive, self._view = archive, None
            self.worker.open(archive)
        return self.listed(asked)

    def drop(self, asked: Asked) -> dict[str, Any]:
        """Show what was ever dropped on the window, with the ``names`` of the sessions in the ``folder`` of now."""
        folder = Path(asked.text("folder"))
        told = self.open(Asked({}, {"folder": str(self.dropped)}))
        return told | {"names": [one.name for one in self.archive if one.folder.is_relative_to(folder)]}

    def refuse_while_running(self) -> None:
        """Raise BiodanceError while a run is not finished: its results belong to the folder that is open."""
        if self.worker.running:
            raise BiodanceError("A run is not finished. Wait for it, or stop it, before another folder is opened.")

    def session(self, asked: Asked) -> dict[str, Any]:
        """Return one session as it is read now."""
        return self._viewed(self._place(asked)).document()

    def state(self, asked: Asked) -> dict[str, Any]:
        """Return what may have changed meanwhile: the revision of session.toml, and the run; one that is at work is
        waited for, a little.
        """
        name = asked.text("name")
        self.worker.wait(_PATIENCE)
        return {"revision": self.archive[name].file.revision if name else "", "run": self.worker.document()}

    def edit(self, asked: Asked) -> dict[str, Any]:
        """Change keys of session.toml."""
        changes = asked.body.get("changes")
        if not isinstance(changes, list) or not all(isinstance(one, list) and len(one) == 2 for one in changes):
            raise BiodanceError('changes must be a list of [["subject", "mass_kg"], 70] or with null.')
        listed = [(keys if isinstance(keys, list) else [keys], value) for keys, value in changes]
        self._place(asked).file.change(asked.text("revision"), lambda text: changed_text(text, listed))
        return self.session(asked)

    def text(self, asked: Asked) -> dict[str, Any]:
        """Write session.toml as text."""
        self._place(asked).file.change(asked.text("revision"), lambda _: asked.text("text"))
        return self.session(asked)

    def undo(self, asked: Asked) -> dict[str, Any]:
        """Go back to the session.toml before."""
        self._place(asked).file.step(asked.text("revision"), -1)
        return self.session(asked)

    def redo(self, asked: Asked) -> dict[str, Any]:
        """Take the last undo back."""
        self._place(asked).file.step(asked.text("revision"), 1)
        return self.session(asked)

    def markers(self, asked: Asked) -> dict[str, Any]:
        """Return the markers of a trial, to be drawn."""
        return markers_document(self._trial(asked))

    def forces(self, asked: Asked) -> dict[str, Any]:
        """Return the forces of a trial, to be drawn."""
        return forces_document(self._trial(asked))

    def results(self, asked: Asked) -> dict[str, Any]:
        """Return what the last run found."""
        return shown_results(self._place(asked))

    def strides(self, asked: Asked) -> dict[str, Any]:
        """Return the spatio-temporal values of a trial in the last run, and with session.toml as it is now."""
        place, trial = self._place(asked), self._trial(asked)
        read_results(place)
        about = (str(place.results), str(place.folder), trial.name, trial.source.path.stem)
        with self._one_export:
            return {"rows": run_task("strides", *about)}

    def run(self, asked: Asked) -> dict[str, Any]:
        """Begin a run over sessions."""
        names = asked.body.get("names")
        if not isinstance(names, list) or not names:
            raise BiodanceError("names must be a list of sessions.")
        self.worker.start([self.archive[str(name)] for name in names])
        return {"run": self.worker.document()}

    def stop(self, _: Asked) -> dict[str, Any]:
        """Stop the run."""
        self.worker.stop()
        self.worker.make_ready()  # the process that was at work was killed
        return {"run": self.worker.document()}

    def page(self, asked: Asked) -> Response:
        """Return a part of report.html, or all of it."""
        text = page_part(self._place(asked), asked.text("part"))
        return Response(text, media_type="text/html", headers={"Content-Security-Policy": _SANDBOX})

    def download(self, asked: Asked) -> Response:
        """Return the results in a format: a file, all tables, for another program; or a person's limits."""
        if asked.text("format") == "limits":
            return _attached("person.toml", self.limits(asked)["text"].encode())
        place, kind = self._place(asked), asked.text("format")
        stem = place.folder.resolve().name
        if kind == "file":
            path = results_file(place, asked.text("file"))
            return _attached(path.name, path.read_bytes())
        with self._one_export:
            if kind == "xlsx":
                return _attached(f"{stem}.xlsx", workbook(place))
            if kind == "csv":
                tables = {f"{path.stem}.csv": path.with_suffix(".csv") for path in _tables(place)}
                return _attached(f"{stem}_tables.zip", _zipped(tables))
            return _attached(*exported(place, kind, asked.text("trial")))

    def correction(self, asked: Asked) -> dict[str, Any]:
        """Return what session.toml would say for findings to be taken off, and what that changes: before and after."""
        place, wanted = self._place(asked), asked.body.get("findings")
        found = (read_results(place)["diagnosis"] or {}).get("findings", [])
        able = {f"{one['effect']} {one['target']}": one for one in found if one.get("session_entry")}
        if not isinstance(wanted, list) or not wanted or not set(wanted) <= able.keys():
            raise BiodanceError(f"findings must be some that session.toml can correct: {', '.join(able) or 'none is'}.")
        keys = ("target", "trials", "parameters", "session_entry")
        asked_of = [{key: able[name][key] for key in keys} for name in wanted]
        with self._one_export:
            return dict(run_task("correction", str(place.folder), json.dumps(asked_of)))

    def form(self, _: Asked) -> dict[str, Any]:
        """Return what the form for a person's limits asks."""
        return limits_form()

    def limits(self, asked: Asked) -> dict[str, str]:
        """Return the file of what was filled into the form for a person's limits."""
        values = parse_json(asked.text("values"))
        if not isinstance(values, dict):
            raise BiodanceError(f"values = {values!r} is no JSON object.")
        return {"text": limits_text(asked.text("template"), values)}

    def accept(self, asked: Asked) -> dict[str, Any]:
        """Return what acceptance would change: before and after."""
        with self._one_export:
            return preview_of_acceptance(self._place(asked), self.archive.out)

    def keep(self, asked: Asked) -> dict[str, Any]:
        """Keep what was accepted."""
        return {"folder": str(keep_acceptance(self._place(asked), self.archive.out))}

    def _place(self, asked: Asked) -> SessionPlace:
        return self.archive[asked.text("name")]

    def _viewed(self, place: SessionPlace) -> SessionView:
        with self._lock:
            if self._view is None or self._view.place is not place or self._view.stamp != place.task().fingerprint:
                self._view = None  # let the recordings go before others are read
                self._view = SessionView(place)
            return self._view

    def _trial(self, asked: Asked) -> Trial:
        view = self._viewed(self._place(asked))
        if view.session is None:
            raise BiodanceError(view.why)
        return view.session[asked.text("trial")]


def _attached(name: str, content: bytes) -> Response:
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._- ") else "_" for c in name)
    headers = {"Content-Disposition": f'attachment; filename="{plain}"'}
    return Response(content, media_type="application/octet-stream", headers=headers)

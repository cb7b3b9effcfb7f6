"""What the pages of a window ask for, each question a method; how they are asked is `server`'s."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

from starlette.responses import Response

from biodance.app import outputs
from biodance.app.limits import limits_form, limits_text
from biodance.app.sessions import Archive, SessionPlace, Worker, allowed_folder, folders_document, results_beside
from biodance.app.view import SessionView, forces_document, markers_document
from biodance.errors import BiodanceError
from biodance.library import parse_json
from biodance.records import Trial
from biodance.version import __version__

_SANDBOX = "sandbox allow-scripts allow-popups allow-modals; frame-ancestors 'self'"
"""What a page of results may do in a tab: run its own scripts, and reach nothing of the window's."""


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
            if self.worker.running:
                raise BiodanceError("A run is not finished. Wait for it, or stop it, before another folder is opened.")
            archive = Archive(folder, results_beside(folder))
            self.archive, self.worker, self._view = archive, Worker(archive), None
        return self.listed(asked)

    def session(self, asked: Asked) -> dict[str, Any]:
        """Return one session as it is read now."""
        return self._viewed(self._place(asked)).document()

    def state(self, asked: Asked) -> dict[str, Any]:
        """Return what may have changed meanwhile: the revision of session.toml, and the run."""
        name = asked.text("name")
        return {"revision": self.archive[name].file.revision if name else "", "run": self.worker.document()}

    def edit(self, asked: Asked) -> dict[str, Any]:
        """Change keys of session.toml."""
        changes = asked.body.get("changes")
        if not isinstance(changes, list) or not all(isinstance(one, list) and len(one) == 2 for one in changes):
            raise BiodanceError('changes must be a list of [["subject", "mass_kg"], 70] or with null.')
        place = self._place(asked)
        place.file.change([(keys if isinstance(keys, list) else [keys], value) for keys, value in changes], _at(asked))
        return self.session(asked)

    def text(self, asked: Asked) -> dict[str, Any]:
        """Write session.toml as text."""
        self._place(asked).file.replace(asked.text("text"), _at(asked))
        return self.session(asked)

    def undo(self, asked: Asked) -> dict[str, Any]:
        """Go back to the session.toml before."""
        self._place(asked).file.undo(_at(asked))
        return self.session(asked)

    def redo(self, asked: Asked) -> dict[str, Any]:
        """Take the last undo back."""
        self._place(asked).file.redo(_at(asked))
        return self.session(asked)

    def markers(self, asked: Asked) -> dict[str, Any]:
        """Return the markers of a trial, to be drawn."""
        return markers_document(self._trial(asked))

    def forces(self, asked: Asked) -> dict[str, Any]:
        """Return the forces of a trial, to be drawn."""
        return forces_document(self._trial(asked))

    def results(self, asked: Asked) -> dict[str, Any]:
        """Return what the last run found."""
        return outputs.shown_results(self._place(asked))

    def strides(self, asked: Asked) -> dict[str, Any]:
        """Return the spatio-temporal values of a trial in the last run, and with session.toml as it is now."""
        place, trial = self._place(asked), self._trial(asked)
        outputs.read_results(place)
        about = (str(place.results), str(place.folder), trial.name, trial.source.path.stem)
        with self._one_export:
            return {"rows": outputs.run_task("strides", *about)}

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
        return {"run": self.worker.document()}

    def page(self, asked: Asked) -> Response:
        """Return a part of report.html, or all of it."""
        text = outputs.page_part(self._place(asked), asked.text("part"))
        return Response(text, media_type="text/html", headers={"Content-Security-Policy": _SANDBOX})

    def download(self, asked: Asked) -> Response:
        """Return the results in a format: a file, all tables, for another program; or a person's limits."""
        if asked.text("format") == "limits":
            return _attached("person.toml", self.limits(asked)["text"].encode())
        place, kind = self._place(asked), asked.text("format")
        stem = place.folder.resolve().name
        if kind == "file":
            path = outputs.results_file(place, asked.text("file"))
            return _attached(path.name, path.read_bytes())
        with self._one_export:
            if kind == "xlsx":
                return _attached(f"{stem}.xlsx", outputs.workbook(place))
            if kind == "csv":
                return _attached(f"{stem}_tables.zip", outputs.csv_archive(place))
            return _attached(*outputs.exported(place, kind, asked.text("trial")))

    def correction(self, asked: Asked) -> dict[str, Any]:
        """Return what session.toml would say for findings to be taken off, and what that changes: before and after."""
        place, wanted = self._place(asked), asked.body.get("findings")
        found = (outputs.read_results(place)["diagnosis"] or {}).get("findings", [])
        able = {f"{one['effect']} {one['target']}": one for one in found if one.get("session_entry")}
        if not isinstance(wanted, list) or not wanted or not set(wanted) <= able.keys():
            raise BiodanceError(f"findings must be some that session.toml can correct: {', '.join(able) or 'none is'}.")
        keys = ("target", "trials", "parameters", "session_entry")
        asked_of = [{key: able[name][key] for key in keys} for name in wanted]
        with self._one_export:
            return dict(outputs.run_task("correction", str(place.folder), json.dumps(asked_of)))

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
            return outputs.preview_of_acceptance(self._place(asked), self.archive.out)

    def keep(self, asked: Asked) -> dict[str, Any]:
        """Keep what was accepted."""
        return {"folder": str(outputs.keep_acceptance(self._place(asked), self.archive.out))}

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


def _at(asked: Asked) -> str:
    return asked.text("revision")


def _attached(name: str, content: bytes) -> Response:
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._- ") else "_" for c in name)
    headers = {"Content-Disposition": f'attachment; filename="{plain}"'}
    return Response(content, media_type="application/octet-stream", headers=headers)

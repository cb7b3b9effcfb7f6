"""The window's server: one user, this machine alone, every answer within a time and of a size that is known."""

import secrets
import socket
import webbrowser
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib.resources import files
from json import JSONDecodeError, loads
from pathlib import Path
from threading import Lock
from typing import Any

import anyio
import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from biodance.app.edits import ChangedElsewhereError
from biodance.app.guard import LARGEST_BODY, LoopbackGuard
from biodance.app.outputs import (
    csv_archive,
    exported,
    keep_acceptance,
    page_part,
    preview_of_acceptance,
    results_document,
    results_file,
    workbook,
)
from biodance.app.recording import forces_document, markers_document
from biodance.app.run import Worker
from biodance.app.sessions import Archive, SessionPlace
from biodance.app.view import SessionView
from biodance.errors import BiodanceError, UnknownName
from biodance.records import Trial
from biodance.report.pages.template import three_js
from biodance.version import __version__

_PATIENCE = 10.0
"""s that a request's body may take."""
_KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_SANDBOX = "sandbox allow-scripts allow-popups; frame-ancestors 'self'"
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
        self._view: SessionView | None = None
        self._lock, self._one_export = Lock(), Lock()

    def listed(self, _: Asked) -> dict[str, Any]:
        """Return all sessions with what is known of them."""
        self.archive.look()
        told = {"folder": str(self.archive.folder.resolve()), "out": str(self.archive.out), "version": __version__}
        return told | {"rows": self.archive.rows(), "run": self.worker.document()}

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
        return results_document(self._place(asked))

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
        text = page_part(self._place(asked), asked.text("part"))
        return Response(text, media_type="text/html", headers={"Content-Security-Policy": _SANDBOX})

    def download(self, asked: Asked) -> Response:
        """Return the results in a format: a file of theirs, all tables, or for another program."""
        place, kind = self._place(asked), asked.text("format")
        stem = place.folder.resolve().name
        if kind == "file":
            path = results_file(place, asked.text("file"))
            return _attached(path.name, path.read_bytes())
        with self._one_export:
            if kind == "xlsx":
                return _attached(f"{stem}.xlsx", workbook(place))
            if kind == "csv":
                return _attached(f"{stem}_tables.zip", csv_archive(place))
            return _attached(*exported(place, kind, asked.text("trial")))

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


def _at(asked: Asked) -> str:
    return asked.text("revision")


def _attached(name: str, content: bytes) -> Response:
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._- ") else "_" for c in name)
    headers = {"Content-Disposition": f'attachment; filename="{plain}"'}
    return Response(content, media_type="application/octet-stream", headers=headers)


def _static_files() -> dict[str, bytes]:
    """Return the window's own files by name: what is not among them cannot be asked for."""
    folder = files("biodance.app") / "static"
    found = {one.name: one.read_bytes() for one in folder.iterdir() if Path(one.name).suffix in _KINDS}
    return found | {"three.js": three_js().encode()}


def window_application(archive: Archive, *, token: str, port: int) -> LoopbackGuard:
    """Return the application that serves a window over an ``archive`` to who knows the ``token``, at ``port``."""
    window, known = Window(archive), _static_files()

    async def static(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in known:
            return Response("There is nothing here.", 404, media_type="text/plain")
        return Response(known[name], media_type=_KINDS[Path(name).suffix])

    reads = (window.listed, window.session, window.state, window.markers, window.forces, window.results)
    writes = (window.edit, window.text, window.undo, window.redo, window.run, window.stop, window.accept, window.keep)
    routes = [
        Route("/", static),
        Route("/static/{name}", static),
        Route("/page", _answered(window.page)),
        Route("/download", _answered(window.download)),
        *(Route(f"/api/{one.__name__}", _answered(one)) for one in reads),
        *(Route(f"/api/{one.__name__}", _answered(one), methods=["POST"]) for one in writes),
    ]

    @asynccontextmanager
    async def ended(_: Starlette) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(window.worker.stop)

    application = Starlette(routes=routes, lifespan=ended, max_body_size=LARGEST_BODY)
    return LoopbackGuard(application, token=token, port=port)


def _answered(work: Callable[[Asked], Any]) -> Callable[[Request], Any]:
    """Return an endpoint that does a ``work`` in a thread and answers with what it returns; with a sentence where that
    is not possible.
    """

    async def endpoint(request: Request) -> Response:
        try:
            with anyio.fail_after(_PATIENCE):
                body = await request.body()
            asked = Asked(dict(request.query_params), loads(body) if body else {})
            if not isinstance(asked.body, Mapping):
                return _told("The body must be a JSON object.", 400)
            found = await run_in_threadpool(work, asked)
            return found if isinstance(found, Response) else JSONResponse(found)
        except HTTPException:  # the body is larger than it may be
            raise
        except ChangedElsewhereError as error:
            return _told(str(error), 409)
        except UnknownName as error:
            return _told(str(error), 404)
        except BiodanceError as error:
            return _told(str(error), 400)
        except (JSONDecodeError, UnicodeDecodeError, RecursionError):
            return _told("The body is no JSON.", 400)
        except (TimeoutError, ClientDisconnect):
            return _told("The request did not end in time.", 408)
        except OSError as error:
            return _told(f"{error.filename or 'The disk'}: {error.strerror or error}. Nothing was changed.", 507)
        except Exception as error:
            return _told(f"biodance itself failed ({type(error).__name__}: {error}). Please report this.", 500)

    return endpoint


def _told(sentence: str, status: int) -> JSONResponse:
    return JSONResponse({"error": sentence}, status)


def serve_window(
    folder: Path, out: Path, *, port: int = 0, opened: bool = True, tell: Callable[[str], None] = lambda _: None
) -> None:
    """Serve a window over the sessions of a ``folder``, with results in ``out``, until Ctrl-C.

    Parameters
    ----------
    folder : pathlib.Path
        An archive, or one session.
    out : pathlib.Path
        Of the results, as `run_batch` writes them.
    port : int
        Of 127.0.0.1; 0 takes a free one.
    opened : bool
        Whether the browser is asked to show it.
    tell : callable
        Called with the address, once it answers.

    Raises
    ------
    BiodanceError
        There is no session, the results' folder is taken, or the port.
    """
    archive = Archive(folder, out)
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
    except (OSError, OverflowError) as error:
        listener.close()
        raise BiodanceError(
            f"--port {port}: this port of the loopback cannot be had ({error}). Give another one, or 0 for any."
        ) from error
    token, port = secrets.token_urlsafe(24), listener.getsockname()[1]
    application = window_application(archive, token=token, port=port)
    address = f"http://127.0.0.1:{port}/?token={token}"
    server = uvicorn.Server(
        uvicorn.Config(
            application,
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=30,
            timeout_graceful_shutdown=5,
            limit_concurrency=64,
            lifespan="on",
        )
    )
    listener.listen()
    tell(address)
    if opened:
        webbrowser.open(address)
    with listener:
        server.run(sockets=[listener])

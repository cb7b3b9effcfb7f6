"""The window's server: one user, this machine alone, every answer within a time and of a size that is known.

It listens on the loopback only. A page of a stranger in the same browser could still reach it: by a name that it lets
point to 127.0.0.1 (DNS rebinding: the Host header tells), or by a form or script of its own (CSRF: the cookie is
SameSite=Strict, and whatever changes something must come from our own Origin).
"""

import hmac
import secrets
import webbrowser
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from importlib.resources import files
from json import JSONDecodeError, loads
from pathlib import Path
from typing import Any

import anyio
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from biodance.app.dropped import received_folder
from biodance.app.sessions import Archive, ChangedElsewhereError
from biodance.app.window import Asked, Window
from biodance.batch.run import prepare_workers
from biodance.errors import BiodanceError, UnknownName
from biodance.report.loopback import LOOPBACK, loopback_socket, quiet_server
from biodance.report.pages.template import three_js

LARGEST_BODY = 2**20
"""Bytes of a request: a session.toml has a few thousand."""
LARGEST_DROP = 2**33
"""Bytes of a folder that is dropped on the window."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""What the window's page may do: nothing but with its own server."""
_HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": POLICY,
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class LoopbackGuard:
    """Lets a request to ``app`` through that carries the ``token`` as a cookie and names this server as its host.

    The address ``/?token=...`` gives the browser the cookie and leads to the page without it.
    """

    def __init__(self, app: ASGIApp, *, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"biodance-{port}"
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or hand on to the application."""
        if scope["type"] == "lifespan":
            return await self._app(scope, receive, send)
        if scope["type"] != "http":
            return None
        request = Request(scope)
        answer = self._refusal(request)
        if answer is not None:
            return await answer(scope, receive, _with_headers(send))
        return await self._app(scope, receive, _with_headers(send))

    def _refusal(self, request: Request) -> Response | None:
        """Return the answer to a request that is not let through; None for one that is."""
        if request.headers.get("host", "") not in self._hosts:
            return PlainTextResponse("This address answers to 127.0.0.1 alone.", 403)
        # a write comes from the page of this server, as JSON or a dropped folder, which no form can send
        kind = request.headers.get("content-type", "").startswith(("application/json", "application/octet-stream"))
        own = kind and request.headers.get("origin", "") in [f"http://{host}" for host in self._hosts]
        if request.method not in ("GET", "HEAD") and not own:
            return PlainTextResponse("Changes are taken from the window's own page alone.", 403)
        if self._same(request.cookies.get(self._cookie, "")):
            return None
        if request.url.path == "/" and self._same(request.query_params.get("token", "")):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
            return answer
        return PlainTextResponse("Open the whole address that biodance app printed, with its token.", 403)

    def _same(self, told: str) -> bool:
        # takes as long wherever the two differ, so that no token can be guessed letter by letter
        return hmac.compare_digest(told.encode(), self._token.encode())


def _with_headers(send: Send) -> Send:
    """Return ``send`` that adds what every answer says, where it does not say something else itself."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending


_PATIENCE = 10.0  # s that a request's body may take
_PATIENCE_DROP = 600.0  # s that a dropped folder may take to arrive
_KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}


def window_application(window: Window, *, token: str, port: int) -> LoopbackGuard:
    """Return the application that serves a ``window`` to who knows the ``token``, at ``port``."""
    # the window's own files by name: what is not among them cannot be asked for
    folder = files("biodance.app") / "static"
    known = {one.name: one.read_bytes() for one in folder.iterdir() if Path(one.name).suffix in _KINDS}
    known |= {"three.js": three_js().encode()}

    async def static(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in known:
            return Response("There is nothing here.", 404, media_type="text/plain")
        return Response(known[name], media_type=_KINDS[Path(name).suffix])

    reads = (
        *(window.listed, window.session, window.state, window.markers, window.forces, window.results),
        *(window.strides, window.folders, window.form),
    )
    writes = (
        *(window.edit, window.text, window.undo, window.redo, window.run, window.stop),
        *(window.correction, window.accept, window.keep, window.open, window.limits),
    )

    async def dropped(request: Request) -> Asked:
        window.refuse_while_running()
        with anyio.fail_after(_PATIENCE_DROP):
            return Asked({}, {"folder": str(await received_folder(request.stream(), window.dropped))})

    routes = [
        Route("/", static),
        Route("/static/{name}", static),
        Route("/page", _answered(window.page)),
        Route("/download", _answered(window.download)),
        Route("/api/drop", _answered(window.drop, dropped), methods=["POST"], max_body_size=LARGEST_DROP),
        *(Route(f"/api/{one.__name__}", _answered(one)) for one in reads),
        *(Route(f"/api/{one.__name__}", _answered(one), methods=["POST"]) for one in writes),
    ]

    @asynccontextmanager
    async def ended(_: Starlette) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(window.worker.stop)

    application = Starlette(routes=routes, lifespan=ended, max_body_size=LARGEST_BODY)
    return LoopbackGuard(application, token=token, port=port)


async def _read(request: Request) -> Asked:
    """Return what a request asks."""
    with anyio.fail_after(_PATIENCE):
        body = await request.body()
    asked = Asked(dict(request.query_params), loads(body) if body else {})
    if not isinstance(asked.body, Mapping):
        raise BiodanceError("The body must be a JSON object.")
    return asked


def _answered(
    work: Callable[[Asked], Any], read: Callable[[Request], Awaitable[Asked]] = _read
) -> Callable[[Request], Any]:
    """Return an endpoint that does a ``work`` in a thread on what it reads, and answers it, or why not."""

    async def endpoint(request: Request) -> Response:
        try:
            found = await run_in_threadpool(work, await read(request))
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
    """Serve a window over a ``folder``, an archive or one session, with results in ``out``, until Ctrl-C; at a ``port``
    of 127.0.0.1 (0 = a free one), ``opened`` in the browser. ``tell`` is called with the address, once it answers.

    Raises
    ------
    BiodanceError
        There is no session, the results' folder is taken, or the port.
    """
    window, listener = Window(Archive(folder, out)), loopback_socket(port, "--port")
    token, port = secrets.token_urlsafe(24), listener.getsockname()[1]
    address = f"http://{LOOPBACK}:{port}/?token={token}"
    server = quiet_server(window_application(window, token=token, port=port))
    prepare_workers()
    window.worker.make_ready()
    tell(address)
    if opened:
        webbrowser.open(address)
    with listener:
        server.run(sockets=[listener])

"""The page that an operator watches while a session runs: served to this machine alone, over its loopback."""

import json
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any

from biodance.diagnosis.watch import LiveWarning
from biodance.errors import BiodanceError
from biodance.pipeline.live import LiveState

_LOOPBACK = "127.0.0.1"
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'"
_LAST = 2.0
"""s that the end waits for the page to fetch it."""


class LivePage:
    """A page at ``address`` that shows the newest state of a stream; a context, closed at its end.

    Parameters
    ----------
    port : int
        Of 127.0.0.1; 0 takes a free one.

    Raises
    ------
    BiodanceError
        Another program has the port.
    """

    def __init__(self, port: int = 0) -> None:
        self._lock, self._fetched, self._watched = Lock(), Event(), False
        self._said: dict[str, Any] = {"time_s": 0.0, "known": {}, "suspect": [], "next": "", "warnings": [], "end": ""}
        try:
            self._server = ThreadingHTTPServer((_LOOPBACK, port), self._handler())
        except (OSError, OverflowError) as error:
            raise BiodanceError(
                f"--page {port}: this port of the loopback cannot be had ({error}). Give another one, or 0 for any."
            ) from error
        self._server.daemon_threads = True
        self.address = f"http://{_LOOPBACK}:{self._server.server_address[1]}/"
        Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def show(self, state: LiveState) -> None:
        """Show what is known, suspect and to be done now."""
        self._tell(time_s=state.time, known=dict(state.verdicts), suspect=list(state.suspect), next=state.advice)

    def warn(self, said: LiveWarning) -> None:
        """Add a warning."""
        with self._lock:
            self._said["warnings"] = [*self._said["warnings"], {"time_s": said.time_s, "text": said.text}]

    def end(self, state: LiveState, cause: str) -> None:
        """Show the last state, and that the stream has ended, with the ``cause`` where nothing was identified."""
        self.show(state)
        self._tell(end=cause or "The recording has ended.")
        self._fetched.clear()
        if self._watched:
            self._fetched.wait(_LAST)

    def __enter__(self) -> "LivePage":
        """Return the page itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()

    def _tell(self, **said: Any) -> None:
        with self._lock:
            self._said.update(said)

    def _answer(self, path: str) -> tuple[str, bytes] | None:
        """Return type and body of what is asked for; None where there is nothing."""
        if path == "/":
            page = files("biodance.report") / "templates" / "live.html"
            return "text/html; charset=utf-8", page.read_bytes()
        if path != "/state.json":
            return None
        self._watched = True
        with self._lock:
            text = json.dumps(self._said)
        return "application/json", text.encode()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        page = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                host = self.headers.get("Host", "").rpartition(":")[0]
                found = page._answer(self.path) if host in (_LOOPBACK, "localhost") else None
                kind, body = found or ("text/plain", b"There is nothing here.")
                self.send_response(200 if found else 404)
                headers: Mapping[str, str] = {
                    "Content-Type": kind,
                    "Content-Length": str(len(body)),
                    "Content-Security-Policy": _POLICY,
                    "Cache-Control": "no-store",
                    "X-Content-Type-Options": "nosniff",
                }
                for name, value in headers.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(body)
                if kind == "application/json":
                    page._fetched.set()

            def log_message(self, *_: Any) -> None:
                """Say nothing: the terminal belongs to the stream."""

        return Handler

"""A session while it runs: the operator's page, served over the loopback alone, what is printed, the document."""

import json
import sys
from collections.abc import Mapping
from html import escape as escape_html
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from biodance.body.body import Body
from biodance.diagnosis.watch import LiveWarning
from biodance.display import cause_in_words, spaced
from biodance.errors import BiodanceError
from biodance.pipeline.live import LiveResult, LiveState
from biodance.pipeline.still import asked_posture
from biodance.report.dance import mannequin_svg
from biodance.report.pages.template import template_text
from biodance.report.tables.identification import ASKED
from biodance.report.tables.schema import Row, Schema
from biodance.report.terminal import print_table

KNOWN_ROW = Schema(
    "segment quantity unit value sd low=interval.0 high=interval.1 verdict",
    shown="segment: {segment:name} | mass (kg): {value:2} | 95 % interval: {low:2} to {high:2} | verdict: {verdict}",
)
_WARNING = Schema("time_s effect target text")


def live_document(found: LiveResult) -> Row:
    """Return ``biodance live --json``: ms a frame of one core (``wall`` by the clock), masses, warnings."""
    one = found.identification
    cores, wall = (
        {"median": float(np.median(ms)), "p99": float(np.percentile(ms, 99)), "longest": float(ms.max())}
        for ms in (1000 * found.frame_s, 1000 * found.wall_s)
    )
    return {
        "frames": found.frame_s.size,
        "frames_used": int(found.fit.use.sum()) if found.fit else 0,
        "frame_ms": cores | {"wall": wall},
        "known": KNOWN_ROW.rows(known for known in (one.known if one else ()) if known.quantity in ASKED),
        "warnings": _WARNING.rows(found.warnings),
        "next": found.state.advice,
        "cause": found.cause,
    }


def state_line(state: LiveState) -> str:
    """Return what an operator must see now, in one line."""
    sure = [spaced(name) for name, verdict in state.verdicts.items() if verdict == "known"]
    known = f"known: {', '.join(sure)}" if sure else "no mass is known yet"
    suspect = f"; suspect: {' '.join(state.suspect)}" if state.suspect else ""
    return f"{state.time:.0f} s, {known}{suspect}; next: {state.advice}"


def warning_line(said: LiveWarning) -> str:
    """Return a warning as one line."""
    return f"{said.time_s:.2f} s, {cause_in_words(said.effect, said.target)}: {said.text}"


def print_live(found: LiveResult, document: Row, console: Console) -> None:
    """Print what is known of every segment, what is suspect, and what to do next."""
    masses = [row for row in document["known"] if row["quantity"] == "mass"]
    if masses:
        print_table(KNOWN_ROW, masses, console)
    for said in found.warnings:
        console.print(escape(f"look: {warning_line(said)}"))
    if found.cause:
        console.print(escape(found.cause))
    time = document["frame_ms"]
    console.print(
        f"{document['frames_used']} of {document['frames']} frames used; {time['median']:.1f} ms a frame of one core, "
        f"99 % within {time['p99']:.1f} ms."
    )
    console.print(f"next: {escape(found.state.advice)}")


_LOOPBACK = "127.0.0.1"
_HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}
_PATIENCE = 10.0  # s for which a connection may say nothing
_LAST = 2.0  # s that the end waits for the page to fetch it


class _Server(ThreadingHTTPServer):
    """Serves the page; says nothing of a browser that went away in the middle of an answer."""

    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Leave the terminal to the stream where a tab was closed; what else goes wrong is told as usual."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class LivePage:
    """A page at ``address`` that shows the newest state of a stream; a context, closed at its end, at a ``port`` of
    127.0.0.1 (0 = a free one). Once it knows the ``body`` it draws what is asked, too.

    Raises
    ------
    BiodanceError
        Another program has the port.
    """

    def __init__(self, port: int = 0) -> None:
        self._lock, self._fetched, self._watched = Lock(), Event(), False
        nothing: dict[str, Any] = {"time_s": 0.0, "known": {}, "suspect": [], "next": "", "warnings": [], "end": ""}
        self._said = nothing | {"picture": ""}
        self._pictures: dict[str, str] = {}
        self.body: Body | None = None
        try:
            self._server = _Server((_LOOPBACK, port), self._handler())
        except (OSError, OverflowError) as error:
            raise BiodanceError(
                f"--page {port}: this port of the loopback cannot be had ({error}). Give another one, or 0 for any."
            ) from error
        self.address = f"http://{_LOOPBACK}:{self._server.server_address[1]}/"
        Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def show(self, state: LiveState) -> None:
        """Show what is known, suspect and to be done now."""
        known, suspect = dict(state.verdicts), list(state.suspect)
        self._tell(time_s=state.time, known=known, suspect=suspect, next=state.advice, picture=self._picture(state))

    def _picture(self, state: LiveState) -> str:
        """Return the picture of what is asked, drawn once a segment."""
        if self.body is None or not state.asked:
            return ""
        if state.asked not in self._pictures:
            drawn = mannequin_svg(self.body, asked_posture(self.body, state.asked), escape_html(state.advice))
            self._pictures[state.asked] = drawn
        return self._pictures[state.asked]

    def warn(self, said: LiveWarning) -> None:
        """Add a warning."""
        with self._lock:
            self._said["warnings"] = [*self._said["warnings"], Schema("time_s text").row(said)]

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

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        page = self

        class Handler(BaseHTTPRequestHandler):
            timeout = _PATIENCE

            def do_GET(self) -> None:
                asked = self.path if self.headers.get("Host", "").rpartition(":")[0] in (_LOOPBACK, "localhost") else ""
                code, kind, body = 404, "text/plain", b"There is nothing here."
                if asked == "/":
                    code, kind, body = 200, "text/html; charset=utf-8", template_text("live.html").encode()
                elif asked == "/state.json":
                    page._watched = True
                    with page._lock:
                        code, kind, body = 200, "application/json", json.dumps(page._said).encode()
                self.send_response(code)
                for name, value in {"Content-Type": kind, "Content-Length": str(len(body)), **_HEADERS}.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(body)
                if kind == "application/json":
                    page._fetched.set()

            def log_message(self, *_: Any) -> None:
                """Say nothing: the terminal belongs to the stream."""

        return Handler

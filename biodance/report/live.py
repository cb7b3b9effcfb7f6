"""A session while it runs: the operator's page, served over the loopback alone, what is printed, the document."""

from collections.abc import Mapping
from html import escape as escape_html
from threading import Event, Thread
from types import TracebackType
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from biodance.body.body import Body
from biodance.diagnosis.watch import LiveWarning
from biodance.display import cause_in_words, spaced
from biodance.pipeline.live import LiveResult, LiveState
from biodance.pipeline.still import asked_posture
from biodance.report.dance import mannequin_svg
from biodance.report.loopback import LOOPBACK, loopback_socket, quiet_server
from biodance.report.pages.template import template_text
from biodance.report.tables.identification import ASKED
from biodance.report.tables.schema import Row, Schema
from biodance.report.terminal import print_table

KNOWN_ROW = Schema(
    "segment quantity unit value sd low=interval.0 high=interval.1 verdict",
    shown="segment: {segment:name} | mass (kg): {value:2} | 95 % interval: {low:2} to {high:2} | verdict: {verdict}",
)


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
        "warnings": Schema("time_s effect target text").rows(found.warnings),
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


_HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}


class LivePage:
    """A page at ``address`` that shows the newest state of a stream; a context, closed at its end, at a ``port`` of
    127.0.0.1 (0 = a free one). Once it knows the ``body`` it draws what is asked, too.

    Raises
    ------
    BiodanceError
        Another program has the port.
    """

    def __init__(self, port: int = 0) -> None:
        self._fetched, self._watched = Event(), False
        # never changed, only replaced: the server's thread reads it while the stream goes on
        self._said: dict[str, Any] = {"time_s": 0.0, "known": {}, "suspect": [], "next": "", "warnings": [], "end": ""}
        self._said |= {"picture": ""}
        self._pictures: dict[str, str] = {}
        self.body: Body | None = None
        listener = loopback_socket(port, "--page")
        self.address = f"http://{LOOPBACK}:{listener.getsockname()[1]}/"
        self._server = quiet_server(Starlette(routes=[Route("/{path:path}", self._answer)]))
        self._thread = Thread(target=self._server.run, kwargs={"sockets": [listener]}, daemon=True)
        self._thread.start()

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
        self._tell(warnings=[*self._said["warnings"], Schema("time_s text").row(said)])

    def end(self, state: LiveState, cause: str) -> None:
        """Show the last state, and that the stream has ended, with the ``cause`` where nothing was identified."""
        self.show(state)
        self._tell(end=cause or "The recording has ended.")
        self._fetched.clear()
        if self._watched:
            self._fetched.wait(2.0)  # s for the page to fetch the end

    def __enter__(self) -> "LivePage":
        """Return the page itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop serving."""
        self._server.should_exit = True
        self._thread.join()

    def _tell(self, **said: Any) -> None:
        self._said = self._said | said

    def _answer(self, request: Request) -> Response:
        """Answer with the page or the newest state; who calls us by another host is a stranger (DNS rebinding)."""
        own = request.headers.get("Host", "").rpartition(":")[0] in (LOOPBACK, "localhost")
        asked = request.url.path if own else ""
        if asked == "/":
            return HTMLResponse(template_text("live.html"), headers=_HEADERS)
        if asked == "/state.json":
            self._watched = True
            return JSONResponse(self._said, headers=_HEADERS, background=BackgroundTask(self._fetched.set))
        return PlainTextResponse("There is nothing here.", 404, headers=_HEADERS)

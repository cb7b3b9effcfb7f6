"""Who may ask the window for anything: this machine's own browser that knows the token, and no other page in it.

The server listens on the loopback only. A page of a stranger in the same browser could still reach it: by a name that
it lets point to 127.0.0.1 (DNS rebinding: the Host header tells), or by a form or script of its own (CSRF: the cookie
is SameSite=Strict, and whatever changes something must come from our own Origin).
"""

import hmac
from collections.abc import Mapping

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY = 2**20
"""Bytes of a request: a session.toml has a few thousand."""
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
_READS = ("GET", "HEAD")


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
        if request.method not in _READS and not self._own(request):
            return PlainTextResponse("Changes are taken from the window's own page alone.", 403)
        if self._same(request.cookies.get(self._cookie, "")):
            return None
        if request.url.path == "/" and self._same(request.query_params.get("token", "")):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
            return answer
        return PlainTextResponse("Open the whole address that biodance app printed, with its token.", 403)

    def _own(self, request: Request) -> bool:
        """Return whether a write comes from the page of this server, as JSON, which no form can send."""
        origin = request.headers.get("origin", "")
        json = request.headers.get("content-type", "").startswith("application/json")
        return json and origin in [f"http://{host}" for host in self._hosts]

    def _same(self, told: str) -> bool:
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

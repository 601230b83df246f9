"""Keeps other sites and other users away from the server, and the page away from other sites.

Every program on the user's machine can reach a server there, and so can every page in the user's
browser. So the server is private: requests must have a token, which is part of the address that is
printed and opened, and is a cookie from then on. Requests must name this machine as their host,
which a site whose name points here (DNS rebinding) does not. They must not come from another site's
page. Requests that change something must also have the token in a header, as only this server's
page sends them.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hypermap.web.hosts import is_known

TOKEN_HEADER = "X-Hypermap-Token"
TOKEN_QUERY = "token"

_PRIVATE = (
    "this page is private: open it by the whole address that was printed at the start of the "
    "server; it ends with ?token= and a secret"
)
_READING = ("GET", "HEAD")
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "media-src 'self'; "
    "connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Guard:
    """Lets a request through to the server, or answers it with 403.

    Args:
        app: the server.
        hosts: by which names it is addressed, as `known_hosts` says.
        token: what requests must know.
        is_private: whether also those must that change nothing.
        once: other tokens, each of which opens the page a single time: other users see the words
            with which a browser is started.
    """

    def __init__(
        self,
        app: ASGIApp,
        hosts: Iterable[str],
        token: str,
        is_private: bool = True,
        once: set[str] | None = None,
    ) -> None:
        self._app = app
        self._once = set() if once is None else once
        self._hosts = set(hosts)
        self._token = token
        self._is_private = is_private

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        request = HTTPConnection(scope)
        method, path = scope["method"], scope["path"]
        problem = self._problem(method, path, request.headers)
        given = request.query_params.get(TOKEN_QUERY)
        was_given = self._is_token(given)
        if not problem and path == "/" and method == "GET" and given in self._once:
            self._once.discard(given)
            was_given = True

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)  # files have a stricter policy of their own
                if was_given:
                    cookie = f"{_cookie_name(request)}={self._token}"
                    headers.append("Set-Cookie", f"{cookie}; Path=/; HttpOnly; SameSite=Strict")
            await send(message)

        if not problem and self._is_private and not (was_given or self._knows_token(request)):
            problem = _PRIVATE
        if not problem:
            await self._app(scope, receive, send_guarded)
            return
        refusal: Response = PlainTextResponse(problem, 403)
        if path.startswith("/api/"):
            refusal = JSONResponse({"error": problem, "reason": "refused"}, 403)
        await refusal(scope, receive, send_guarded)

    def _knows_token(self, request: HTTPConnection) -> bool:
        return self._is_token(request.cookies.get(_cookie_name(request))) or self._is_token(
            request.headers.get(TOKEN_HEADER)
        )

    def _is_token(self, given: str | None) -> bool:
        return secrets.compare_digest((given or "").encode(), self._token.encode())

    def _problem(self, method: str, path: str, headers: Headers) -> str:
        """Return why a request is refused; nothing if it is not."""
        host = headers.get("host", "")
        if not is_known(host, self._hosts):
            return f"this server is not {host[:200]!r}; open it by the address that it printed"
        origin = headers.get("origin")
        if origin is not None and _host_of(origin) != host.lower():
            return "requests from other sites are refused"
        came_from = headers.get("sec-fetch-site", "none")
        is_opened = path == "/" and headers.get("sec-fetch-mode") == "navigate"
        if came_from not in ("none", "same-origin") and not (is_opened and method in _READING):
            return "requests from other sites are refused"
        if method not in _READING and not self._is_token(headers.get(TOKEN_HEADER)):
            return "this window is from an earlier start of the server; reload the page"
        return ""


def _host_of(origin: str) -> str:
    """Return the host and port of a site; nothing if it is none."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _cookie_name(request: HTTPConnection) -> str:
    """Return a name of its own for each port, as browsers do not keep their cookies apart."""
    try:
        port = urlsplit(f"//{request.headers.get('host', '')}").port
    except ValueError:
        port = None
    return f"hypermap-{port or 80}"

"""Access control of the page: only the browser that was given the address, on this machine, may use it.

A page of another site, open in the same browser, can send requests to 127.0.0.1 as well. So every request must name
this host (a foreign name that resolves to this machine is refused), must not come from another origin, and must
carry the cookie that the one-time token of the address was exchanged for.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable
from contextlib import suppress
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from underlay.app.folder import LARGEST_FILE

# Browsers that were let in at one time; one more puts the first one out.
_MOST_BROWSERS = 20
# Room for the frame that a browser puts around several files.
_LARGEST_BODY = 2 * LARGEST_FILE
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; object-src 'none'; base-uri 'self'; form-action 'self'; "
    "frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}
_ASK = "ask for a new address where underlay app was started\n"


class Doorkeeper:
    """One-time access tokens, and the cookies they were exchanged for.

    Parameters
    ----------
    hosts : iterable of str
        Allowed values of the Host header: ``"127.0.0.1:8123"``.
    cookie : str
        Name of the cookie. It contains the port, as a browser sends cookies to all ports of a host.
    """

    def __init__(self, hosts: Iterable[str], cookie: str = "underlay") -> None:
        self.hosts = frozenset(hosts)
        self.cookie = cookie
        self._tokens: list[str] = []
        self._cookies: list[str] = []

    def new_token(self) -> str:
        """Make and return a token; earlier ones that were not used stay valid."""
        token = secrets.token_urlsafe(24)
        self._tokens = [*self._tokens[-_MOST_BROWSERS:], token]
        return token

    def spend(self, token: str) -> str | None:
        """Exchange a token for the value of a new cookie; None for one that is unknown or was used."""
        known = next((one for one in self._tokens if hmac.compare_digest(one.encode(), token.encode())), None)
        if known is None:
            return None
        self._tokens.remove(known)
        value = secrets.token_urlsafe(32)
        self._cookies = [*self._cookies[1 - _MOST_BROWSERS :], value]
        return value

    def knows(self, headers: Headers) -> bool:
        """Whether a request carries a valid cookie."""
        try:
            jar = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        given = jar[self.cookie].value.encode() if self.cookie in jar else b""
        return any(hmac.compare_digest(one.encode(), given) for one in self._cookies)


class Guard:
    """ASGI middleware that refuses requests and sockets which are not from the admitted browser.

    Parameters
    ----------
    app : ASGI application
        The application that it protects.
    keeper : Doorkeeper
        Tokens and cookies of those admitted.
    """

    def __init__(self, app: ASGIApp, keeper: Doorkeeper) -> None:
        self._app, self._keeper = app, keeper

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on to the application, or answer it with a refusal."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            # A folder that is dropped ends its own upload: the page says so, and the terminal needs no traceback.
            with suppress(ClientDisconnect):
                await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": "not allowed"})
        else:
            await refusal(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> Response | None:
        """Return the response that refuses a request; None where it may pass."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self._keeper.hosts:
            return PlainTextResponse("this page answers on this machine only\n", 421)
        origin = headers.get("origin")
        # A browser names the origin of every socket and of all that changes something.
        needed = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if (needed if origin is None else origin not in self._origins()) or headers.get(
            "sec-fetch-site", "same-origin"
        ) not in ("same-origin", "none"):
            return PlainTextResponse("requests of other pages are refused\n", 403)
        if not self._keeper.knows(headers):
            return self._admission(scope)
        length = headers.get("content-length", "0")
        if "transfer-encoding" in headers or not length.isdigit() or int(length) > _LARGEST_BODY:
            return PlainTextResponse(f"more than {_LARGEST_BODY // 10**6} MB at once\n", 413)
        return None

    def _admission(self, scope: Scope) -> Response:
        """Exchange the token in the address for a cookie and redirect to the bare address; refuse a bad token."""
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        token = query.get("token", [""])[0]
        value = self._keeper.spend(token) if scope["type"] == "http" and scope["path"] == "/" else None
        if value is None:
            return PlainTextResponse(f"this address was used before, or is not complete: {_ASK}", 403)
        response = RedirectResponse("/", 303)
        response.set_cookie(self._keeper.cookie, value, httponly=True, samesite="strict", path="/")
        return response

    def _origins(self) -> frozenset[str]:
        return frozenset(f"http://{host}" for host in self._keeper.hosts)


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers[name] = value
        await send(message)

    return sent

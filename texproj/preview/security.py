"""Who may talk to the page's server, and what a browser may do with its answers.

Threats met: other web sites reaching 127.0.0.1 through the visitor's browser (DNS rebinding,
cross-site requests), other machines when the server is told to listen beyond loopback, and
bodies without bound.
"""

from __future__ import annotations

import hmac
import ipaddress
import socket
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

TOKEN_COOKIE = "texproj-token"
SAFE_METHODS = frozenset({"GET", "HEAD"})
CONTENT_SECURITY_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",
        "connect-src 'self' blob:",
        "font-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    ]
)
"""blob: and data: are where the page unpacks the images inside a .glb file."""

ANSWER_HEADERS = {
    "content-security-policy": CONTENT_SECURITY_POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "x-frame-options": "DENY",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
}


def is_loopback(host: str) -> bool:
    """Whether `host` names this machine only."""
    if host == "localhost":
        return True
    address = _address(host)
    return address is not None and address.is_loopback


def split_host(value: str) -> tuple[str, int | None]:
    """`name:port` or `[v6]:port` of a Host header to (name, port); ("", None) if malformed."""
    try:
        parts = urlsplit(f"//{value}")
        port = parts.port
    except ValueError:
        return "", None
    if parts.username is not None or parts.path or parts.query or parts.fragment:
        return "", None
    return (parts.hostname or "").lower(), port


class Guard:
    """ASGI middleware that refuses what is not this page's own traffic.

    host: the address that the server listens on; port: its port; token: needed by every request
    where the server listens beyond loopback, None on loopback; max_body: bytes of a request.
    """

    def __init__(
        self, app: ASGIApp, host: str, port: int, token: str | None, max_body: int
    ) -> None:
        self.app = app
        self.port = port
        self.token = token
        self.max_body = max_body
        self.open_to_others = not is_loopback(host)
        self.names = {"localhost", host.lower()}
        if self.open_to_others:
            self.names |= {socket.gethostname().lower(), socket.getfqdn().lower()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer or refuse one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        refusal = self.refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, with_headers(send))
            return
        await self.app(scope, bounded(receive, self.max_body), with_headers(send))

    def refusal(self, scope: Scope) -> Response | None:
        """Why this request is not served; None if it is."""
        headers = Headers(scope=scope)
        if not self.host_allowed(headers.get("host", "")):
            return refuse(403, "this server answers only under its own address")
        if not self.origin_allowed(scope["method"], headers):
            return refuse(403, "requests from other web sites are not served")
        if self.token is not None:
            return self.token_refusal(scope, headers)
        return self.body_refusal(headers)

    def host_allowed(self, value: str) -> bool:
        """The Host header must be an own name, or (beyond loopback) any bare IP address.

        A rebinding attack needs a name of the attacker's, which is neither.
        """
        name, port = split_host(value)
        if not name or (port or 80) != self.port:
            return False
        if self.open_to_others and _address(name) is not None:
            return True
        return name in self.names or is_loopback(name)

    def origin_allowed(self, method: str, headers: Headers) -> bool:
        """Only the page itself may send or embed; following a link to the page is allowed."""
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{headers.get('host', '')}":
            return False
        site = headers.get("sec-fetch-site", "none")
        if site in ("none", "same-origin"):
            return True
        return method in SAFE_METHODS and headers.get("sec-fetch-mode") == "navigate"

    def token_refusal(self, scope: Scope, headers: Headers) -> Response | None:
        """The token comes once in the address and lives on in a cookie."""
        assert self.token is not None
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if given and same(given, self.token) and scope["method"] == "GET":
            answer = RedirectResponse(scope["path"], status_code=303)
            answer.set_cookie(TOKEN_COOKIE, self.token, httponly=True, samesite="strict")
            return answer
        if not same(cookie(headers, TOKEN_COOKIE), self.token):
            return refuse(401, "open the address with the token that texproj preview printed")
        return self.body_refusal(headers)

    def body_refusal(self, headers: Headers) -> Response | None:
        """A body that says it is too long is not read at all."""
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self.max_body:
            return refuse(413, f"a request may hold {self.max_body} bytes")
        return None


class BodyTooLong(Exception):  # noqa: N818 - a verdict about the client, not an error of ours
    """A chunked body went past the bound."""


def bounded(receive: Receive, limit: int) -> Receive:
    """`receive`, raising BodyTooLong once more than `limit` bytes came."""
    seen = 0

    async def read() -> Message:
        nonlocal seen
        message = await receive()
        seen += len(message.get("body", b""))
        if seen > limit:
            raise BodyTooLong
        return message

    return read


def with_headers(send: Send) -> Send:
    """`send` that adds the fixed headers to every answer that does not set its own."""

    async def write(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in ANSWER_HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return write


def refuse(status: int, sentence: str) -> Response:
    """An error answer of one sentence."""
    return JSONResponse({"error": sentence}, status_code=status)


def same(given: str, expected: str) -> bool:
    """Equality in constant time."""
    return hmac.compare_digest(given.encode(), expected.encode())


def cookie(headers: Headers, name: str) -> str:
    """The value of a cookie, empty if there is none."""
    try:
        jar = SimpleCookie("; ".join(_all(headers, "cookie")))
    except CookieError:
        return ""
    return jar[name].value if name in jar else ""


def _all(headers: Headers, name: str) -> Iterable[str]:
    return headers.getlist(name)


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None

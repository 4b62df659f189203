"""Middleware that checks the Host and Origin headers and sets security headers."""

from __future__ import annotations

import asyncio
import ipaddress
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from planish.web.problems import problem_response

_CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
_VIEW_CONTENT_SECURITY_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""For the self-contained view page: its script runs in a sandbox with an opaque origin and cannot make requests."""

VIEW_HEADERS = {
    "content-security-policy": _VIEW_CONTENT_SECURITY_POLICY,
    "cross-origin-opener-policy": "unsafe-none",  # browsers refuse any other value for a sandboxed page
}

_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}
_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")


class HostCheckMiddleware:
    """Refuses requests for unknown hosts (DNS rebinding) and cross-origin requests; sets security headers.

    Parameters
    ----------
    app : ASGI application
    hosts : frozenset of str
        Host names to accept besides localhost and IP addresses.
    """

    def __init__(self, app: ASGIApp, hosts: frozenset[str] = frozenset()):
        self.app, self.hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if scope["method"] == "HEAD":
            scope, receive, send = _as_get(scope, receive, send)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                response_headers = MutableHeaders(scope=message)
                for name, value in {**_HEADERS, "content-security-policy": _CONTENT_SECURITY_POLICY}.items():
                    response_headers.setdefault(name, value)
            await send(message)

        app = self.app
        if not self._is_known_host(headers.get("host", "")):
            app = problem_response(
                421, "this host name is not allowed; the operator of the service can allow it with --allow-host"
            )
        elif scope["method"] not in _SAFE_METHODS and _is_cross_origin(headers):
            app = problem_response(
                403, "cross-origin requests are not allowed; use the service's own page, or a client that is no browser"
            )
        await app(scope, receive, send_with_headers)

    def _is_known_host(self, host: str) -> bool:
        """Whether a Host header names this service. IP addresses are safe: DNS rebinding needs a name."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name == "localhost" or name in self.hosts:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True


def _is_cross_origin(headers: Headers) -> bool:
    """Whether a browser marks the request as cross-origin. Other clients send neither header."""
    if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
        return True
    origin = headers.get("origin")
    if origin is None:
        return False
    try:
        return urlsplit(origin).netloc != headers.get("host")
    except ValueError:  # no browser sends such a thing
        return True


def _as_get(scope: Scope, receive: Receive, send: Send) -> tuple[Scope, Receive, Send]:
    """Handle HEAD as GET whose client leaves once it has the headers, so that no file or stream is read to its end."""
    answered = asyncio.Event()

    async def leave() -> Message:
        await answered.wait()
        return {"type": "http.disconnect"}

    async def send_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            await send(message)
            await send({"type": "http.response.body", "body": b""})
            answered.set()

    # From ASGI 2.4 on streams watch for errors of send() instead of messages.
    asgi = {**scope["asgi"], "spec_version": "2.3"}
    return {**scope, "method": "GET", "asgi": asgi}, leave, send_headers

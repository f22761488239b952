"""Refusal of requests that do not come from the page itself.

Every web page that is open in a browser can send requests to a local port. A random token in the
address keeps them out. The Host header is checked as well, because a foreign host name may resolve
to 127.0.0.1 (DNS rebinding), and so is the Origin header, which names the page that asks.
"""

import re
import secrets

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_LOCAL_HOST = re.compile(r"(127\.0\.0\.1|localhost)(:[0-9]{1,5})?")

_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}


class Guard:
    """ASGI middleware that passes on only requests of the page, without the token in their path."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        """Wrap an application.

        Args:
            app: Application that answers requests of the page.
            token: First part of the path of every valid address.
        """
        self._app = app
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return  # the page uses no WebSocket; uvicorn closes one that is not accepted

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        _, token, rest = (*scope["path"].split("/", 2), "")[:3]
        if words := self._refusal(Headers(scope=scope), token):
            refused = PlainTextResponse(words + "\n", status_code=403)
            await refused(scope, receive, send_with_headers)
        else:
            inner = {**scope, "root_path": f"/{token}", "path": f"/{token}/{rest}"}
            await self._app(inner, receive, send_with_headers)

    def _refusal(self, headers: Headers, token: str) -> str:
        """Return why a request is refused; "" if it is not."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not _LOCAL_HOST.fullmatch(host):
            return "host: this server answers only as 127.0.0.1 or localhost"
        if origin is not None and origin != f"http://{host}":
            return "origin: other pages may not use this server"
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return "token: use the whole address that `fastgen studio` has printed"
        return ""

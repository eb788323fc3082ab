"""``HEAD``: the headers of ``GET``, without its content (RFC 9110)."""

from anyio import CancelScope
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class HeadMiddleware:
    """Middleware that answers ``HEAD`` like ``GET``, and stops once the headers have been sent.

    Files are not read to their end then, and events not awaited. It is the innermost middleware, so
    that the others see the method itself and are not stopped.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        get = {**scope, "method": "GET"}

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.start":
                await send(message)
                await send({"type": "http.response.body"})
                answering.cancel()

        with CancelScope() as answering:
            try:
                await self.app(get, receive, send_head)
            finally:
                scope.update(get, method="HEAD")  # the log names the route

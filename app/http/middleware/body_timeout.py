"""A timeout for bodies, against clients that send theirs drop by drop."""

import asyncio

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import problem
from app.settings import Settings


class BodyTimeoutMiddleware:
    """Middleware that refuses a request whose body is not complete by its deadline."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.limit_s = settings.deadline_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        clock = asyncio.get_running_loop().time
        end = clock() + self.limit_s
        is_complete = False

        async def receive_in_time() -> Message:
            nonlocal is_complete
            if is_complete:
                return await receive()  # waits for the client to disconnect
            try:
                async with asyncio.timeout_at(end):
                    message = await receive()
            except TimeoutError:
                detail = f"the body was not complete within {self.limit_s:g} s"
                setting = "deadline_s"
                raise problem(
                    "deadline_exceeded", detail, limit=self.limit_s, setting=setting
                ) from None
            is_complete = not message.get("more_body", False)
            return message

        async def send_and_close(message: Message) -> None:
            # Whichever deadline refused the request: without this its body would go on arriving.
            if message["type"] == "http.response.start" and not is_complete and clock() >= end:
                MutableHeaders(scope=message)["Connection"] = "close"
            await send(message)

        if scope["type"] == "http":
            await self.app(scope, receive_in_time, send_and_close)
        else:
            await self.app(scope, receive, send)

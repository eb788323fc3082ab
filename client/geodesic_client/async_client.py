"""The client for coroutines, on asyncio or trio."""

from collections.abc import AsyncIterator, Iterator
from typing import Self, TypeVar

import anyio
import httpx2

from geodesic_client import connection
from geodesic_client.errors import check, unreachable
from geodesic_client.flow import Flow, Pause, Request
from geodesic_client.operations import Operations

T = TypeVar("T")


class AsyncClient(Operations):
    """A client of a service, with the methods of `Client`, each to be awaited.

    Parameters
    ----------
    address
        The address of the service.
    api_key
        The API key, if the service requires one.
    http
        A client of httpx2 to send with, for certificates or proxies; ``address`` and ``api_key``
        are then ignored, so set them there. It is not closed.
    """

    def __init__(
        self,
        address: str = connection.ADDRESS,
        *,
        api_key: str | None = None,
        http: httpx2.AsyncClient | None = None,
    ) -> None:
        self._own = None
        if http is None:
            http = self._own = httpx2.AsyncClient(**connection.settings(address, api_key))
        self._http = http

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()

    async def aclose(self) -> None:
        """Close the connections."""
        if self._own is not None:
            await self._own.aclose()

    async def run_async(self, flow: Flow[T]) -> T:
        """Do what a conversation says, step by step, and return its outcome."""
        cancelled = False
        try:
            step = next(flow)
            while True:
                try:
                    with anyio.CancelScope(shield=cancelled):
                        reply = await self._do(step)
                except GeneratorExit:  # nobody is left to wait
                    raise
                except BaseException as error:  # noqa: BLE001 - the conversation decides
                    cancelled = cancelled or not isinstance(error, Exception)
                    step = flow.throw(error)
                else:
                    step = flow.send(reply)
        except StopIteration as end:
            outcome: T = end.value
            return outcome

    async def _do(self, step: Request | Pause) -> httpx2.Response | None:
        if isinstance(step, Pause):
            await anyio.sleep(step.seconds)
            return None
        async for attempt in connection.attempts(step):
            with attempt:
                return await self._send(step)
        return None

    async def _send(self, request: Request) -> httpx2.Response:
        content: bytes | AsyncIterator[bytes] = (
            request.content if isinstance(request.content, bytes) else _each(request.content())
        )
        options = connection.options(request)
        try:
            response = await self._http.request(
                request.method, request.path, content=content, **options
            )
        except httpx2.TransportError as error:
            raise unreachable(error) from error
        return check(response)


async def _each(chunks: Iterator[bytes]) -> AsyncIterator[bytes]:
    for chunk in chunks:
        yield chunk

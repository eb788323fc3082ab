"""The client for threads."""

import time
from collections.abc import Iterator
from typing import Self, TypeVar

import httpx2

from geodesic_client import connection
from geodesic_client.errors import check, unreachable
from geodesic_client.flow import Flow, Pause, Request
from geodesic_client.operations import Operations

T = TypeVar("T")


class Client(Operations):
    """A client of a service. It may be used by several threads, and as a context manager.

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
        http: httpx2.Client | None = None,
    ) -> None:
        self._own = None
        if http is None:
            http = self._own = httpx2.Client(**connection.settings(address, api_key))
        self._http = http

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        if self._own is not None:
            self._own.close()

    def run(self, flow: Flow[T]) -> T:
        """Do what a conversation says, step by step, and return its outcome."""
        try:
            step = next(flow)
            while True:
                try:
                    reply = self._do(step)
                except BaseException as error:  # noqa: BLE001 - the conversation decides
                    step = flow.throw(error)
                else:
                    step = flow.send(reply)
        except StopIteration as end:
            outcome: T = end.value
            return outcome

    def _do(self, step: Request | Pause) -> httpx2.Response | None:
        if isinstance(step, Pause):
            time.sleep(step.seconds)
            return None
        for attempt in connection.attempts(step):
            with attempt:
                return self._send(step)
        return None

    def _send(self, request: Request) -> httpx2.Response:
        content: bytes | Iterator[bytes] = (
            request.content if isinstance(request.content, bytes) else request.content()
        )
        options = connection.options(request)
        try:
            response = self._http.request(request.method, request.path, content=content, **options)
        except httpx2.TransportError as error:
            raise unreachable(error) from error
        return check(response)

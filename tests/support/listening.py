"""A server of the service's protocol on loopback, in a thread, with a small application."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from http.client import HTTPResponse
from threading import Event, Thread
from typing import Any, cast

import httpx2
import uvicorn

from app.http.connections import Connections
from app.http.protocol import BoundedHttpProtocol
from app.settings import Settings
from tests.support.waiting import LONG_S, wait_until


@dataclass
class Listener:
    """The server: its address, what it parsed, and what its application met."""

    port: int
    state: uvicorn.server.ServerState
    parsed_bytes: list[int] = field(default_factory=list)
    drained_bytes: list[int] = field(default_factory=list)
    """What came after a refusal"""
    bodies: list[bytes] = field(default_factory=list)
    disconnects: list[str] = field(default_factory=list)
    gate: asyncio.Event = field(default_factory=asyncio.Event)
    """Requests of ``/gate`` are answered once it is set; bodies of ``/later`` are read then."""
    loop: asyncio.AbstractEventLoop | None = None

    def open_gate(self) -> None:
        assert self.loop is not None
        self.loop.call_soon_threadsafe(self.gate.set)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Have the event loop stand still inside the block; it has answered a request before."""
        assert self.loop is not None
        stands, over = Event(), Event()

        def stand() -> None:
            stands.set()
            over.wait(LONG_S)

        self.loop.call_soon_threadsafe(stand)
        stands.wait(LONG_S)
        try:
            yield
        finally:
            over.set()

    def connect_at_once(self, sent: bytes) -> socket.socket:
        """Connect, with what is sent there before the server knows of the connection."""
        with self.paused():
            return self.connect(sent)

    def connect(self, sent: bytes = b"") -> socket.socket:
        connection = socket.create_connection(("127.0.0.1", self.port), LONG_S)
        connection.sendall(sent)
        return connection

    def get(self, path: str = "/", **more: Any) -> httpx2.Response:
        return httpx2.get(f"http://127.0.0.1:{self.port}{path}", timeout=LONG_S, **more)

    def send(self, data: bytes) -> httpx2.Response:
        """Send bytes on a connection of their own, and return the first answer."""
        with self.connect() as connection:
            # The answer may come before the end, when the server takes no more.
            with suppress(BrokenPipeError, ConnectionResetError):
                connection.sendall(data)
            return read_answer(connection, self.port)


def read_answer(connection: socket.socket, port: int = 0) -> httpx2.Response:
    """Read one answer from a connection."""
    response = HTTPResponse(connection)
    response.begin()
    body = response.read()
    request = httpx2.Request("GET", f"http://127.0.0.1:{port}/")
    return httpx2.Response(
        response.status, headers=response.getheaders(), content=body, request=request
    )


@contextmanager
def listening(settings: Settings) -> Iterator[Listener]:
    """Serve ``/gate``, ``/large`` and any other path, which answers with its query."""

    async def application(scope: Any, receive: Any, send: Any) -> None:
        assert scope["type"] == "http"
        listener.loop = asyncio.get_running_loop()
        if scope["path"] == "/later":
            await listener.gate.wait()
        body, more = b"", True
        while more:
            message = await receive()
            if message["type"] == "http.disconnect":
                listener.disconnects.append(scope["path"])
                return
            body, more = body + message["body"], message.get("more_body", False)
        listener.bodies.append(body)
        if scope["path"] == "/gate":
            await listener.gate.wait()
        answer = bytes(10_000_000) if scope["path"] == "/large" else scope["query_string"]
        length = str(len(answer)).encode()
        headers = [(b"content-length", length), (b"content-type", b"text/plain")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        for begin in range(0, max(1, len(answer)), 2**16):
            part = answer[begin : begin + 2**16]
            more = begin + 2**16 < len(answer)
            await send({"type": "http.response.body", "body": part, "more_body": more})
        if (await receive())["type"] == "http.disconnect":
            listener.disconnects.append(scope["path"])

    class Counted(BoundedHttpProtocol):
        """The protocol, which counts what reaches its parser."""

        def data_received(self, data: bytes) -> None:
            counted = listener.drained_bytes if self._is_refused else listener.parsed_bytes
            counted.append(len(data))
            super().data_received(data)

    connect = partial(Counted, connections=Connections(settings))

    with socket.create_server(("127.0.0.1", 0)) as server_socket:
        config = uvicorn.Config(
            cast(Any, application),
            http=cast(Any, connect),
            ws="none",
            lifespan="off",
            log_level="critical",
            timeout_keep_alive=10**6,
        )
        server = uvicorn.Server(config)
        listener = Listener(server_socket.getsockname()[1], server.server_state)
        thread = Thread(target=server.run, kwargs={"sockets": [server_socket]})
        thread.start()
        wait_until(lambda: server.started)
        try:
            yield listener
        finally:
            server.should_exit = server.force_exit = True
            thread.join()

"""HTTP/1.1 on a connection: what a service on loopback needs; the rest is a proxy's.

Heads are bounded in size and time, connections in number. A proxy in front of the service holds
clients that send or read slowly, see `docs/operations.md`.
"""

import asyncio
from asyncio import TimerHandle
from typing import Any
from uuid import uuid4

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from app.access import caller_at
from app.errors import Problem
from app.http.connections import Connections
from app.http.responses import common_headers, problem_response

MOST_HEAD_BYTES = 32 * 1024
"""Largest request line and headers together; trailers count as well."""
BYTES_BESIDE_HEADER = 32
"""Counted for each header beside its name and value, as in HTTP/2: short ones take as long."""
MOST_PIPELINED = 16
"""Requests of one connection that may wait for the answer to the one before.

Thousands of them, which come in one read, would hold all other callers for half a second.
"""
LEAST_CHUNK = 64
"""Least mean size of a body's chunks, once there are `FREE_CHUNKS`: each takes as long to parse."""
FREE_CHUNKS = 1000
HEAD_S = 10.0
"""Seconds until a head must be complete."""
LINGER_S = 1.0
"""Seconds in which a client can read a refusal: a socket closed at once would discard it."""
MOST_DRAINED = 256 * 1024
"""Bytes that a refused client may still send; then nothing more is read."""


class BoundedHttpProtocol(HttpToolsProtocol):
    """uvicorn's protocol, which refuses heads that are too large or too slow.

    It also refuses connections above the limit. `test_private_parts.py` names what it takes of
    uvicorn.
    """

    def __init__(self, *arguments: Any, connections: Connections, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._all_connections = connections
        self._refusal: Problem | None = None
        self._is_refused = False
        self._drained_bytes = 0
        self._is_in_head = False
        self._unparsed_bytes = 0
        """Received since the parser came to the end of a head, or to a part of a body"""
        self._chunks = self._body_bytes = 0
        self._head_timer: TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Refuse the connection if there are too many, else wait for a head."""
        super().connection_made(transport)
        self._caller = caller_at(self.client[0] if self.client else None)
        refusal = self._all_connections.open(self._caller)
        if refusal is None:
            self._start_head_timer()
        elif self._all_connections.is_crowded:
            self._is_refused = True
            transport.abort()
        else:
            self._refuse(refusal)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._all_connections.close(self._caller)
        self._stop_head_timer()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Parse what a client sent, unless it has been refused."""
        if self._is_refused:
            self._drained_bytes += len(data)
            if self._drained_bytes >= MOST_DRAINED:
                self.transport.pause_reading()
            return
        self._unparsed_bytes += len(data)
        super().data_received(data)
        if self._is_refused:
            return
        # The parser holds back an element until it is complete.
        if self._unparsed_bytes > MOST_HEAD_BYTES:
            self._refuse(_head_too_large())
        elif self._is_in_head or not self._is_serving:
            self._start_head_timer()

    # Parser

    def on_message_begin(self) -> None:
        """Begin a head."""
        self._is_in_head = True
        self._chunks = self._body_bytes = 0
        if len(self.pipeline) >= MOST_PIPELINED:
            raise ValueError("too many requests at once on one connection")
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """Serve the request, unless its head is too large."""
        self._is_in_head = False
        self._unparsed_bytes = 0
        self._stop_head_timer()
        size = sum(len(name) + len(value) + BYTES_BESIDE_HEADER for name, value in self.headers)
        if size + len(self.url) > MOST_HEAD_BYTES:
            self._refusal = _head_too_large()
            raise ValueError(self._refusal.detail)
        before = self.cycle
        super().on_headers_complete()
        if self.cycle is not before:  # else the connection is upgraded
            joined = _JoinedWrites(self.transport, self.loop)
            self.cycle.transport = joined  # type: ignore[assignment]

    def on_body(self, body: bytes) -> None:
        """Take a part of the body."""
        self._unparsed_bytes = 0
        self._body_bytes += len(body)
        super().on_body(body)

    def on_chunk_header(self) -> None:
        """Begin a chunk of the body, unless those before it were too small."""
        if self._chunks > FREE_CHUNKS and self._body_bytes < LEAST_CHUNK * self._chunks:
            detail = f"the chunks of the body have fewer than {LEAST_CHUNK} bytes on average"
            self._refusal = Problem("malformed_request", detail, limit=LEAST_CHUNK)
            raise ValueError(detail)
        self._chunks += 1

    # Refusals

    def send_400_response(self, msg: str) -> None:
        """Answer that the parser gave up."""
        self._refuse(self._refusal or Problem("malformed_request", msg))

    @property
    def _is_serving(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _refuse(self, problem: Problem) -> None:
        """Take nothing more from the client, and close the connection with this answer.

        Requests that are complete are answered first, and the problem is left out.
        """
        self._is_refused = True
        self._stop_head_timer()
        if self._is_serving and not self.cycle.more_body:
            self.cycle.keep_alive = False
            return
        if self._is_serving:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
            if self.cycle.response_started or self.pipeline:
                self.transport.close()
                return
        request_id = uuid4().hex
        response = problem_response(problem, "/", request_id, self.root_path)
        response.headers.update({**common_headers(request_id), "Connection": "close"})
        head = b"".join(b"%b: %b\r\n" % header for header in response.raw_headers)
        self.transport.write(STATUS_LINE[problem.status] + head + b"\r\n" + bytes(response.body))
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self.loop.call_later(LINGER_S, self.transport.close)

    # Time

    def _start_head_timer(self) -> None:
        if self._head_timer is None:
            self._head_timer = self.loop.call_later(HEAD_S, self._on_head_timeout)

    def _stop_head_timer(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None

    def _on_head_timeout(self) -> None:
        if self._is_in_head:
            detail = f"the headers were not complete within {HEAD_S:g} s"
            self._refuse(Problem("deadline_exceeded", detail, limit=HEAD_S))
        else:
            self.transport.close()


class _JoinedWrites:
    """The transport of an answer, whose head waits for the next write, or until others run.

    uvicorn writes a head by itself. Each write is a system call and wakes the client: for a small
    answer, the second one took a twentieth of the time of the request.
    """

    def __init__(self, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport = transport
        self._loop = loop
        self._head: bytes | None = None

    def write(self, data: bytes) -> None:
        if self._head is None:
            self._head = data
            self._loop.call_soon(self._send_head)
        elif self._head:
            head, self._head = self._head, b""
            self._transport.writelines([head, data])
        else:
            self._transport.write(data)

    def _send_head(self) -> None:
        if self._head and not self._transport.is_closing():
            self._transport.write(self._head)
        self._head = b""

    def close(self) -> None:
        self._send_head()
        self._transport.close()

    def is_closing(self) -> bool:
        return self._transport.is_closing()


def _head_too_large() -> Problem:
    detail = f"the request line and the headers are larger than {MOST_HEAD_BYTES} bytes"
    return Problem("header_too_large", detail, limit=MOST_HEAD_BYTES)

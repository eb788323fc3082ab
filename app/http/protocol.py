"""HTTP/1.1 on a connection, with bounds on what a client may send before its request is served."""

import asyncio
from asyncio import TimerHandle
from typing import Any
from uuid import uuid4

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from app.access import caller_at
from app.errors import Problem
from app.http.connections import Connections
from app.http.joined_writes import JoinedWrites
from app.http.responses import common_headers, problem_response

MOST_HEAD_BYTES = 32 * 1024
"""Largest request line and headers together; trailers count as well."""
BYTES_BESIDE_HEADER = 32
"""Counted for each header beside its name and value, as in HTTP/2: short ones take as long."""
MOST_PIPELINED = 16
"""Requests of one connection that may wait for the answer to the one before."""
HEAD_S = 10.0
"""Seconds until a head must be complete."""
LEAST_CHUNK = 8
"""Least mean size of a body's chunks, once there are `FREE_CHUNKS`: each takes as long to parse."""
FREE_CHUNKS = 1000
STALLED_S = 60.0
"""Seconds that a client may leave its answer unread."""
LINGER_S = 1.0
"""Seconds in which a client can read a refusal: a socket closed at once would discard it."""
MOST_DRAINED = 256 * 1024
"""Bytes that a refused client may still send; then nothing more is read."""


class BoundedHttpProtocol(HttpToolsProtocol):
    """uvicorn's protocol, which refuses heads that are too large or too slow.

    It also refuses connections above the limit, and drops clients that stop reading.
    """

    def __init__(self, *arguments: Any, connections: Connections, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._all_connections = connections
        self._refusal: Problem | None = None
        self._is_refused = False
        self._drained_bytes = 0
        self._is_in_head = False
        self._head_bytes = 0
        self._unparsed_bytes = 0  # received since the parser reported an element
        self._chunks = self._body_bytes = 0
        self.chunks_of_read = 0
        """Chunks of bodies that began in the last read"""
        self._body: list[bytes] = []  # received and not passed on yet
        self._head_timer: TimerHandle | None = None
        self._stall_timer: TimerHandle | None = None

    # Connection

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
        self._stop_stall_timer()
        super().connection_lost(exc)

    def data_received(self, data: bytes | memoryview) -> None:
        """Parse what a client sent, unless it has been refused."""
        self.chunks_of_read = 0
        if self._is_refused:
            self._drained_bytes += len(data)
            if self._drained_bytes >= MOST_DRAINED:
                self.transport.pause_reading()
            return
        self._unparsed_bytes += len(data)
        super().data_received(data)  # type: ignore[arg-type]
        if self._is_refused:
            return
        self._pass_body_on()
        # The parser holds back an element until it is complete.
        if self._unparsed_bytes > MOST_HEAD_BYTES:
            self._refuse(_head_too_large())
        elif self._is_in_head or not self._is_serving:
            self._start_head_timer()

    def pause_writing(self) -> None:
        """Wait for the client to read, but not forever."""
        super().pause_writing()
        self._stall_timer = self.loop.call_later(STALLED_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on sending."""
        self._stop_stall_timer()
        super().resume_writing()

    # Parser

    def on_message_begin(self) -> None:
        """Begin a head."""
        self._head_bytes = self._chunks = self._body_bytes = 0
        self._is_in_head = True
        if len(self.pipeline) >= MOST_PIPELINED:
            raise ValueError("too many requests at once on one connection")
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        """Take a part of the address."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header."""
        self._count(len(name) + len(value) + BYTES_BESIDE_HEADER)
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Serve the request."""
        self._is_in_head = False
        self._unparsed_bytes = 0
        self._stop_head_timer()
        before = self.cycle
        super().on_headers_complete()
        if self.cycle is not before:  # else the connection is upgraded
            self.cycle.transport = JoinedWrites(  # type: ignore[assignment]
                self.transport, self.loop
            )

    def on_body(self, body: bytes) -> None:
        """Take a part of the body; small ones are joined, as uvicorn copies all before each."""
        self._unparsed_bytes = 0
        self._body_bytes += len(body)
        self._body.append(body)

    def on_message_complete(self) -> None:
        """End a request."""
        self._pass_body_on()
        super().on_message_complete()

    def _pass_body_on(self) -> None:
        if self._body:
            super().on_body(b"".join(self._body))
            self._body.clear()

    def on_chunk_header(self) -> None:
        """Begin a chunk of the body, unless those before it were too small."""
        if self._chunks > FREE_CHUNKS and self._body_bytes < LEAST_CHUNK * self._chunks:
            detail = f"the chunks of the body have fewer than {LEAST_CHUNK} bytes on average"
            self._refusal = Problem("malformed_request", detail, limit=LEAST_CHUNK)
            raise ValueError(detail)
        self._chunks += 1
        self.chunks_of_read += 1

    def _count(self, size: int) -> None:
        self._unparsed_bytes = 0
        self._head_bytes += size
        if self._head_bytes > MOST_HEAD_BYTES:
            self._refusal = _head_too_large()
            raise ValueError(self._refusal.detail)

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

    # Timers

    def _start_head_timer(self) -> None:
        if self._head_timer is None:
            self._head_timer = self.loop.call_later(HEAD_S, self._on_head_timeout)

    def _stop_head_timer(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None

    def _stop_stall_timer(self) -> None:
        if self._stall_timer is not None:
            self._stall_timer.cancel()
            self._stall_timer = None

    def _on_head_timeout(self) -> None:
        if self._is_in_head:
            detail = f"the headers were not complete within {HEAD_S:g} s"
            self._refuse(Problem("deadline_exceeded", detail, limit=HEAD_S))
        else:
            self.transport.close()


def _head_too_large() -> Problem:
    detail = f"the request line and the headers are larger than {MOST_HEAD_BYTES} bytes"
    return Problem("header_too_large", detail, limit=MOST_HEAD_BYTES)

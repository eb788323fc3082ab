"""Reading from a connection: as much at a time as is parsed at once."""

import asyncio

from app.http.protocol import BoundedHttpProtocol

LARGEST_READ = 64 * 1024
"""Bytes that are read at most at a time"""
SMALLEST_READ = 4 * 1024
"""Bytes that are read at most at the beginning, and at least later"""
CHUNKS_OF_READ = 500
"""Chunks of a body that one read has at most, about: to parse them takes 0.1 ms."""
FEW_CHUNKS = 20
"""Chunks of a read that do not matter, and tell little about those to come"""

REST_S = 0.001
"""Seconds after a read with many chunks in which others are served"""


class PacedReading(asyncio.BufferedProtocol):
    """What the event loop reads for: it passes on to the HTTP protocol what comes.

    A body takes as long to parse as it has chunks. An event loop reads a quarter of a mebibyte at a
    time, and several times in a row: a hundred thousand chunks of a few bytes, while nobody else is
    served. Here a read has as many bytes as had `CHUNKS_OF_READ` in the one before, and after one
    with many chunks the connection rests.
    """

    def __init__(self, protocol: BoundedHttpProtocol) -> None:
        self._protocol = protocol
        self._size = SMALLEST_READ
        self._buffer = bytearray()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to read."""
        self._transport = transport
        self._protocol.connection_made(transport)

    def get_buffer(self, _size_hint: int) -> bytearray:
        """Return the place for the next read."""
        if len(self._buffer) != self._size:
            self._buffer = bytearray(self._size)
        return self._buffer

    def buffer_updated(self, size: int) -> None:
        """Have a read parsed, and choose the size of the next."""
        protocol = self._protocol
        protocol.data_received(memoryview(self._buffer)[:size])
        if size < self._size:
            self._buffer = bytearray()  # it may be long until there is more
        chunks = protocol.chunks_of_read
        if chunks > FEW_CHUNKS:
            self._size = max(SMALLEST_READ, min(size * CHUNKS_OF_READ // chunks, LARGEST_READ))
            if self._size < LARGEST_READ:
                self._transport.pause_reading()
                protocol.loop.call_later(REST_S, self._go_on)
        elif size == self._size:
            self._size = LARGEST_READ

    def _go_on(self) -> None:
        # Otherwise the application has enough, and goes on by itself when it wants more.
        if not self._protocol.flow.read_paused:
            self._transport.resume_reading()

    def eof_received(self) -> None:
        """Pass on that the client sends no more."""
        self._protocol.eof_received()

    def pause_writing(self) -> None:
        """Pass on that the client does not read."""
        self._protocol.pause_writing()

    def resume_writing(self) -> None:
        """Pass on that the client reads again."""
        self._protocol.resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        """Pass on that the connection is closed."""
        self._protocol.connection_lost(exc)

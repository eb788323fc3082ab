"""The head of an answer and the beginning of its body, written together."""

import asyncio


class JoinedWrites:
    """A transport that delays the first write of an answer until the next one, or until others run.

    uvicorn writes a head by itself. Each write is a system call and wakes the client: for a small
    answer, the second one took a twentieth of the time of the request.
    """

    def __init__(self, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport = transport
        self._loop = loop
        self._delayed = b""
        self._sending: asyncio.Handle | None = None
        self._is_first = True

    def write(self, data: bytes) -> None:
        """Write ``data``; of an answer's first part, see the class."""
        if self._is_first:
            self._is_first = False
            self._delayed = data
            self._sending = self._loop.call_soon(self._send)
        elif self._delayed:
            delayed = self._take()
            self._transport.writelines([delayed, data])
        else:
            self._transport.write(data)

    def close(self) -> None:
        """Write what is delayed, and close the transport."""
        self._send()
        self._transport.close()

    def is_closing(self) -> bool:
        """Tell whether the transport is closed, or about to be."""
        return self._transport.is_closing()

    def _send(self) -> None:
        delayed = self._take()
        if delayed and not self._transport.is_closing():
            self._transport.write(delayed)

    def _take(self) -> bytes:
        if self._sending is not None:
            self._sending.cancel()
            self._sending = None
        delayed, self._delayed = self._delayed, b""
        return delayed

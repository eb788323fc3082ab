"""A slot for one worker process: it hands over work, asks it to stop, and retires the worker."""

import asyncio
import pickle
import socket
from collections import deque
from contextlib import suppress
from multiprocessing.context import ForkServerProcess

from structlog.contextvars import get_contextvars

from app.engine import worker_process
from app.engine.fork_server import CONTEXT
from app.engine.signals import Signals
from app.engine.work import Outcome, Work
from app.engine.worker import WorkerConfig

_MAX_AFFINITY_KEYS = 64


class WorkerLostError(Exception):
    """The worker died, or was killed; ``had_begun`` tells whether it had begun the work."""

    def __init__(self, *, had_begun: bool) -> None:
        super().__init__("the worker died")
        self.had_begun = had_begun


class Slot:
    """A slot that has a living worker between ``open`` and ``close``, and can be opened again.

    The pools of libraries need three threads for each worker, and pass all messages through them:
    half a millisecond a request. A slot has a socket on the event loop instead. Its other end
    closes when the worker dies, whatever the worker was doing.
    """

    def __init__(self, config: WorkerConfig) -> None:
        self._config = config
        self._signals: Signals = CONTEXT.RawValue(Signals)
        self._number = 0  # of the present work
        self._outcome: asyncio.Future[Outcome] | None = None
        self._process: ForkServerProcess | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._listening: asyncio.Task[None] | None = None
        self._retired = asyncio.Event()
        self._retired.set()
        self.affinity_keys: deque[str] = deque(maxlen=_MAX_AFFINITY_KEYS)

    async def open(self) -> None:
        """Start a worker and warm its kernels; raises ``WorkerLostError`` where that fails."""
        self.affinity_keys.clear()
        try:
            ours = await self._start()
            reader, self._writer = await asyncio.open_unix_connection(sock=ours)
            await _receive(reader)  # the worker is ready
        except (EOFError, OSError) as error:
            raise WorkerLostError(had_begun=False) from error
        self._retired.clear()
        self._listening = asyncio.create_task(self._listen(reader))

    async def _start(self) -> socket.socket:
        starting = asyncio.create_task(asyncio.to_thread(self._fork))
        try:
            self._process, ours = await asyncio.shield(starting)
        except asyncio.CancelledError:
            # The thread goes on all the same: close its socket. `close` kills its process.
            with suppress(OSError):
                self._process, ours = await starting
                ours.close()
            raise
        return ours

    def _fork(self) -> tuple[ForkServerProcess, socket.socket]:
        ours, theirs = socket.socketpair()
        with theirs:
            arguments = (self._config, self._signals, theirs)
            process = CONTEXT.Process(target=worker_process.run, args=arguments, daemon=True)
            process.start()
        return process, ours

    @property
    def is_alive(self) -> bool:
        """Whether the slot has a worker that can take work."""
        return not self._retired.is_set()

    @property
    def progress(self) -> float:
        """Share of the present work that is done."""
        return float(self._signals.progress)

    @property
    def pid(self) -> int | None:
        """Id of the worker process, where there is one."""
        return None if self._process is None else self._process.pid

    @property
    def evictions(self) -> dict[str, int]:
        """Values that the workers of this slot have dropped to make room, by cache."""
        signals = self._signals
        return {
            "worker_meshes": signals.mesh_evictions,
            "worker_fields": signals.field_evictions,
            "fields": signals.stored_field_evictions,
        }

    async def wait_until_retired(self) -> None:
        """Wait until the worker is dead or retired."""
        await self._retired.wait()

    def retire(self) -> None:
        """Give this worker no more work, so that the engine replaces it."""
        self._retired.set()

    def begin(self, work: Work, *, is_small: bool) -> "asyncio.Future[Outcome]":
        """Hand ``work`` to the worker; its future fails with ``WorkerLostError`` if that dies.

        Work that is not small runs at a lower priority. What the worker logs meanwhile has the
        fields that are bound here, such as the id of the request.
        """
        self._number += 1
        self._signals.progress = 0.0
        self._outcome = asyncio.get_running_loop().create_future()
        if self.is_alive:
            assert self._writer is not None, "a living worker is connected"  # noqa: S101
            message = self._number, work, is_small, get_contextvars()
            self._writer.write(pickle.dumps(message))
        else:
            self._lose_outcome()
        return self._outcome

    def ask_to_stop(self) -> None:
        """Ask the present work to stop; a sweep checks between its slices."""
        self._signals.stop_number = self._number

    async def close(self) -> None:
        """Kill the worker, whatever it is doing."""
        self.retire()
        if self._listening is not None:
            self._listening.cancel()
        if self._writer is not None:
            self._writer.close()
        process, self._process, self._writer = self._process, None, None
        self._lose_outcome()
        if process is not None:
            await asyncio.to_thread(_kill, process)

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        try:
            with suppress(EOFError, OSError):
                while True:
                    outcome = await _receive(reader)
                    if self._outcome is not None and not self._outcome.done():
                        self._outcome.set_result(outcome)
        finally:
            self.retire()
            self._lose_outcome()

    def _lose_outcome(self) -> None:
        if self._outcome is None or self._outcome.done():
            return
        had_begun = self._signals.begun_number == self._number
        self._outcome.set_exception(WorkerLostError(had_begun=had_begun))
        self._outcome.exception()  # marks it as seen: nobody may wait for it any more


async def _receive(reader: asyncio.StreamReader) -> Outcome:
    size = int.from_bytes(await reader.readexactly(worker_process.SIZE_BYTES))
    outcome: Outcome = pickle.loads(await reader.readexactly(size))  # noqa: S301 - our own process
    return outcome


def _kill(process: ForkServerProcess) -> None:
    process.kill()  # it holds nothing that needs cleaning up
    process.join()
    process.close()

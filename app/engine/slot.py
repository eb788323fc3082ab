"""A place for one worker process: begins work, asks it to stop, gives it up."""

import asyncio
import pickle
import socket
from collections import deque
from contextlib import suppress
from multiprocessing.context import ForkServerProcess

from app.engine import worker
from app.engine.fork_server import CONTEXT
from app.engine.work import Outcome, Work

_TOPICS = 64  # that are remembered


class WorkerLostError(Exception):
    """The worker died, or was killed; ``had_begun`` tells whether it had taken up the work."""

    def __init__(self, *, had_begun: bool) -> None:
        super().__init__("the worker died")
        self.had_begun = had_begun


class Slot:
    """A place that has a living worker between ``open`` and ``close``, and can be opened again.

    A pool of a library would bring three threads for each worker, through which all messages pass:
    half a millisecond a request. This has a socket on the event loop, whose other end closes when
    the worker dies, whatever it was doing.
    """

    def __init__(self, config: worker.WorkerConfig) -> None:
        self._config = config
        self._signals: worker.Signals = CONTEXT.RawValue(worker.Signals)
        self._number = 0  # of the work given last
        self._outcome: asyncio.Future[Outcome] | None = None
        self._process: ForkServerProcess | None = None
        self._line: asyncio.StreamWriter | None = None
        self._listening: asyncio.Task[None] | None = None
        self._given_up = asyncio.Event()
        self._given_up.set()
        self.affinity_keys: deque[str] = deque(maxlen=_TOPICS)

    async def open(self) -> None:
        """Start a worker and warm its kernels; raises ``WorkerLostError`` when it cannot."""
        self.affinity_keys.clear()
        try:
            line = await self._started()
            reader, self._line = await asyncio.open_unix_connection(sock=line)
            await _received(reader)  # says that it is ready
        except (EOFError, OSError) as error:
            raise WorkerLostError(had_begun=False) from error
        self._given_up.clear()
        self._listening = asyncio.create_task(self._listen(reader))

    async def _started(self) -> socket.socket:
        starting = asyncio.create_task(asyncio.to_thread(self._start))
        try:
            self._process, line = await asyncio.shield(starting)
        except asyncio.CancelledError:
            # The thread goes on all the same: what it makes is to be closed, or killed.
            with suppress(OSError):
                self._process, line = await starting
                line.close()
            raise
        return line

    def _start(self) -> tuple[ForkServerProcess, socket.socket]:
        ours, theirs = socket.socketpair()
        with theirs:
            arguments = (self._config, self._signals, theirs)
            process = CONTEXT.Process(target=worker.run, args=arguments, daemon=True)
            process.start()
        return process, ours

    @property
    def is_alive(self) -> bool:
        """Whether work given to the slot now would be done."""
        return not self._given_up.is_set()

    @property
    def progress(self) -> float:
        """Which share of the work given last is done."""
        return float(self._signals.progress)

    async def until_dead(self) -> None:
        """Wait until the worker is gone or given up."""
        await self._given_up.wait()

    def give_up(self) -> None:
        """Say that this worker is not to be used again, so that its keeper replaces it."""
        self._given_up.set()

    def begin(self, work: Work, *, is_small: bool) -> "asyncio.Future[Outcome]":
        """Hand ``work`` to the worker; the future fails with ``WorkerLostError`` if that dies.

        What is not small lets all else on the machine go first.
        """
        self._number += 1
        self._signals.progress = 0.0
        self._outcome = asyncio.get_running_loop().create_future()
        if self.is_alive:
            assert self._line is not None, "who is alive has a line"  # noqa: S101
            self._line.write(pickle.dumps((self._number, work, is_small)))
        else:
            self._lose_outcome()
        return self._outcome

    def ask_to_stop(self) -> None:
        """Ask the work that is under way to stop; the sweep looks between its slices."""
        self._signals.stop_number = self._number

    async def close(self) -> None:
        """Kill the worker, whatever it does."""
        self.give_up()
        if self._listening is not None:
            self._listening.cancel()
        if self._line is not None:
            self._line.close()
        process, self._process, self._line = self._process, None, None
        self._lose_outcome()
        if process is not None:
            await asyncio.to_thread(_kill, process)

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        try:
            with suppress(EOFError, OSError):
                while True:
                    outcome = await _received(reader)
                    if self._outcome is not None and not self._outcome.done():
                        self._outcome.set_result(outcome)
        finally:
            self.give_up()
            self._lose_outcome()

    def _lose_outcome(self) -> None:
        if self._outcome is None or self._outcome.done():
            return
        had_begun = self._signals.begun_number == self._number
        self._outcome.set_exception(WorkerLostError(had_begun=had_begun))
        self._outcome.exception()  # who waited may have left: that is nothing to warn of


async def _received(reader: asyncio.StreamReader) -> Outcome:
    size = int.from_bytes(await reader.readexactly(worker.SIZE_BYTES))
    outcome: Outcome = pickle.loads(await reader.readexactly(size))  # noqa: S301 - our own process
    return outcome


def _kill(process: ForkServerProcess) -> None:
    process.kill()  # it holds nothing that would need a farewell
    process.join()
    process.close()

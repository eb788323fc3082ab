"""The worker process: it takes work from a socket, one piece at a time, and sends outcomes back."""

import os
import pickle
import select
import signal
import socket
import threading
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from gc import freeze
from io import BufferedRWPair

from setproctitle import setproctitle
from structlog.contextvars import bound_contextvars

import geodesic_core as gc
from app import logs
from app.engine.memory import limit_memory
from app.engine.priority import low_priority_thread
from app.engine.signals import Signals
from app.engine.work import Outcome
from app.engine.worker import Worker, WorkerConfig

TITLE = "geodesic-worker"
FIRST_KERNELS = ("exact", "paths")
"""Workloads that a worker is ready for when it starts; other kernels are loaded at first use."""
SIZE_BYTES = 8
"""Length of the number before each outcome"""


def run(config: WorkerConfig, signals: Signals, connection: socket.socket) -> None:
    """Run a worker process: do the work that arrives on ``connection``, until that closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # meant for the service, which ends its workers
    setproctitle(TITLE)
    logs.install(config.settings.log_format)
    threading.Thread(target=_die_with, args=(connection,), daemon=True).start()
    worker = Worker(config, signals)
    low_priority = low_priority_thread()
    warm_up(config.settings.worker_memory_bytes)
    with connection.makefile("rwb") as messages, suppress(EOFError, BrokenPipeError):
        _send(messages, None)
        while True:
            number, work, is_small, log_fields = pickle.load(messages)  # noqa: S301 - our own service
            signals.begun_number = number
            with bound_contextvars(**log_fields):
                do = partial(copy_context().run, worker.do, number, work)
                outcome = do() if is_small else low_priority.submit(do).result()
            _send(messages, outcome)


def warm_up(allowed_memory: int) -> None:
    """Load the first kernels, and then limit the memory."""
    gc.warm_up(FIRST_KERNELS)
    freeze()  # loaded objects live for ever; each full collection over them takes 90 ms
    limit_memory(allowed_memory)


def _send(messages: BufferedRWPair, outcome: Outcome) -> None:
    """Send a length-prefixed outcome, so that a non-blocking reader knows when it is complete."""
    pickled = pickle.dumps(outcome)
    messages.write(len(pickled).to_bytes(SIZE_BYTES))
    messages.write(pickled)
    messages.flush()


def _die_with(connection: socket.socket) -> None:
    # The other end closes when the service ends, however it ends, and when the slot does. A busy
    # worker does not read. PR_SET_PDEATHSIG would watch the fork server instead.
    hung_up = select.poll()
    hung_up.register(connection, 0)
    hung_up.poll()
    os._exit(1)

"""The fork server: a process that has imported and loaded what workers need, and forks them.

Imports take 1 s, the first kernels 0.2 s and a fork 10 ms. A fork of the service itself would copy
its threads' locks.
"""

import multiprocessing
from multiprocessing import forkserver

PRELOADED = "app.engine.preloaded"

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload([PRELOADED])


def start() -> None:
    """Start the fork server, unless it runs, and let it import and load; returns at once."""
    forkserver.ensure_running()

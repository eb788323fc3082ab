"""The process that workers are forked from: it has imported all they need, and does nothing else.

Imports take 2 s and a fork 10 ms. To fork the service itself would copy its threads' locks.
"""

import multiprocessing
from multiprocessing import forkserver

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["app.engine.worker"])


def start() -> None:
    """Have it begin to import, where it does not run already; returns at once."""
    forkserver.ensure_running()

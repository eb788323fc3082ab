"""The fork server: a process that has imported what workers need, and forks them.

Imports take 2 s and a fork 10 ms. A fork of the service itself would copy its threads' locks.
"""

import multiprocessing
from multiprocessing import forkserver

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["app.engine.worker"])


def start() -> None:
    """Start the fork server, unless it runs, and let it import; returns at once."""
    forkserver.ensure_running()

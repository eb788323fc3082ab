"""The fork server: a process that has imported and loaded what workers need, and forks them.

Imports take 2 s, the first kernels 0.4 s and a fork 10 ms. A fork of the service itself would copy
its threads' locks. What the library and the queries import late is imported here too: else each
worker would wait for it at its first query, and have a copy of its own, which counts against its
memory.
"""

import multiprocessing
from multiprocessing import forkserver

LATE = (
    "filelock",
    "igl",
    "manifold3d",
    "scipy.sparse",
    "scipy.spatial",
    "trimesh.exchange.stl",
)

PRELOADED = ["app.engine.worker", *LATE, "app.engine.preloaded"]

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(PRELOADED)


def start() -> None:
    """Start the fork server, unless it runs, and let it import and load; returns at once."""
    forkserver.ensure_running()

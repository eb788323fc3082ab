"""Imports and loads what workers need, when it is imported itself: by the fork server, once.

The first kernels are loaded, and those of fast sweeps, whose users wait least: 30 ms and 2.6 MB.
Workers do not wait for the latter where they are not compiled yet. What the library and the queries
import late is imported here: else each worker would wait for it at its first query, and have a copy
of its own, which counts against its memory.
"""

import gc
from contextlib import suppress
from importlib import import_module

LATE = (
    "cmap",
    "filelock",
    "igl",
    "manifold3d",
    "scipy.sparse",
    "scipy.sparse.csgraph",
    "scipy.spatial",
)


def _preload() -> None:
    import geodesic_core
    from app.engine.worker_process import FIRST_KERNELS

    for name in LATE:
        import_module(name)
    # Where kernels are not compiled yet or cannot be loaded, workers see to it, and report what
    # fails.
    for workloads in (FIRST_KERNELS, ("fast",)):
        with suppress(geodesic_core.errors.GeodesicError, OSError):
            geodesic_core.compile_kernels(workloads, cancel=lambda: True)
            geodesic_core.warm_up(workloads)


gc.disable()  # none of this is garbage, and to look for some takes 0.2 s
_preload()
gc.freeze()  # collectors of workers leave it alone, so that they share its pages
gc.enable()

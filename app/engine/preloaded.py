"""Loads kernels when imported by the fork server, so that its workers have them.

The first kernels, and those of fast sweeps, whose users wait least: 30 ms and 2.6 MB. Workers do
not wait for the latter where they are not compiled yet.
"""

from contextlib import suppress

import geodesic_core as gc
from app.engine.worker import FIRST_KERNELS

# Where kernels are not compiled yet or cannot be loaded, workers see to it, and report what fails.
for workloads in (FIRST_KERNELS, ("fast",)):
    with suppress(gc.errors.GeodesicError, OSError):
        gc.compile_kernels(workloads, cancel=lambda: True)
        gc.warm_up(workloads)

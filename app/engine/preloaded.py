"""Loads the first kernels when imported by the fork server, so that its workers have them."""

from contextlib import suppress

import geodesic_core as gc
from app.engine.worker import FIRST_KERNELS

# Where kernels are not compiled yet or cannot be loaded, workers see to it, and report what fails.
with suppress(gc.errors.GeodesicError, OSError):
    gc.compile_kernels(FIRST_KERNELS, cancel=lambda: True)
    gc.warm_up(FIRST_KERNELS)

"""Compilation of kernels: two decorators, one cache, and raw pointers to arrays."""

from geodesic_core.kernels.jit.dispatcher import inlined, kernel
from geodesic_core.kernels.jit.pointers import (
    as_ints,
    borrowed,
    pointer,
    pointers,
    prefetch,
    rows_of,
)

__all__ = ["as_ints", "borrowed", "inlined", "kernel", "pointer", "pointers", "prefetch", "rows_of"]

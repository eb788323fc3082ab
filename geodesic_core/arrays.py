"""Array types, rows that are aligned to cache lines, and sums by group."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Singles: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int32]
Longs: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.uint8]
Counts: TypeAlias = NDArray[np.uint16]

ABSENT: Any = ()
"""In place of an array that some kind of sweep has no use for: a type of no size."""

CACHE_LINE = 64  # bytes


def aligned_rows(count: int, width: int, dtype: Any) -> Any:
    """Return an uninitialised array (count, width) whose first row begins a cache line.

    numpy aligns to 16 bytes, where rows of 64 would lie in two lines each: 8 to 15 % of a merging
    sweep, which visits many half-edges for few windows.
    """
    size = count * width * np.dtype(dtype).itemsize
    memory = np.empty(size + CACHE_LINE, np.uint8)
    begin = -memory.ctypes.data % CACHE_LINE
    return memory[begin : begin + size].view(dtype).reshape(count, width)


def sums_by(groups: NDArray[Any], values: Floats, count: int) -> Floats:
    """Return the sum of the values of each of so many groups, (count,)."""
    sums: Floats = np.bincount(groups, values, minlength=count).astype(np.float64)
    return sums

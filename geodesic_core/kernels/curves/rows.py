"""Arrays that grow row by row."""

from typing import Any

import numpy as np

from geodesic_core.kernels.jit import kernel

ROWS = 64  # rows that arrays have at first


@kernel
def with_room(rows: Any, needed: int) -> Any:
    """Return ``rows``, in a larger array if it has fewer than ``needed`` rows."""
    if needed <= len(rows):
        return rows
    larger = np.empty((max(2 * len(rows), needed), *rows.shape[1:]), rows.dtype)
    copy_rows(rows, larger, 0)
    return larger


@kernel
def copy_rows(rows: Any, target: Any, first: int) -> None:
    """Copy ``rows``, an array of one axis or two, into ``target``, from its row ``first`` on.

    An assignment to a slice does the same, but takes half a second to compile.
    """
    for i in range(len(rows)):
        if rows.ndim == 1:
            target[first + i] = rows[i]
        else:
            for column in range(rows.shape[1]):
                target[first + i, column] = rows[i, column]

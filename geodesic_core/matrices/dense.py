"""Dense tables: blocks of rows, and the rows of the file made from them."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.matrices.blocks import Row
from geodesic_core.matrices.plan import Plan


def block_of(plan: Plan, block: int, rows: Mapping[int, Row], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return a block: (rows, targets from its first row on), mirrored in itself."""
    sweeps = plan.rows_of(block)
    first = sweeps[0] if plan.is_symmetric else 0
    table = np.full((len(sweeps), plan.width - first), np.inf, dtype)
    for place, sweep in enumerate(sweeps):
        columns = rows[sweep]["column"] - first
        table[place, columns] = rows[sweep]["distance"]
        if plan.is_symmetric:
            own = columns < len(sweeps)
            table[columns[own], place] = rows[sweep]["distance"][own]
    return table


def file_rows(
    plan: Plan, rows_of: Callable[[int], NDArray[Any]]
) -> Iterator[tuple[Longs, NDArray[Any]]]:
    """Yield rows of the file, (k,) their numbers and (k, targets) their values, all of them once.

    Reads the rows of each block once for each block that comes after it, in parts.
    """
    if plan.is_flipped:
        for first in range(0, plan.width, plan.block_rows):
            part = slice(first, first + plan.block_rows)
            columns = [rows_of(k)[:, part] for k in range(plan.blocks)]
            rows = np.concatenate(columns).T
            yield np.arange(first, first + len(rows)), rows
        return
    places = np.empty_like(plan.order)
    places[plan.order] = np.arange(plan.sweeps)
    for block in range(plan.blocks):
        sweeps = plan.rows_of(block)
        rows = rows_of(block)
        if plan.is_symmetric:
            before = [
                rows_of(k)[:, sweeps[0] - plan.rows_of(k)[0] :][:, : len(sweeps)].T
                for k in range(block)
            ]
            rows = np.concatenate([*before, rows], axis=1)[:, places]
        yield plan.order[sweeps[0] : sweeps[-1] + 1], rows

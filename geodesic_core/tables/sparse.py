"""Sparse tables: blocks of finite distances, and the rows of the file made from them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.tables.blocks import Blocks
from geodesic_core.tables.plan import Plan

ARRAYS = ("row", "column", "distance")


class Entries(NamedTuple):
    """Finite distances of some successive rows, by row and column."""

    row: Longs
    column: Longs
    distance: NDArray[Any]


def block_of(
    plan: Plan, block: int, rows: Mapping[int, Floats], dtype: np.dtype[Any]
) -> dict[str, NDArray[Any]]:
    """Return the arrays of a block: its finite distances, by column."""
    found = {sweep: np.flatnonzero(np.isfinite(rows[sweep])) for sweep in plan.rows_of(block)}
    first = {sweep: plan.width - len(rows[sweep]) for sweep in found}
    row = np.repeat(np.array(list(found)), [len(near) for near in found.values()])
    column = np.concatenate([first[sweep] + near for sweep, near in found.items()])
    distance = np.concatenate([rows[sweep][near] for sweep, near in found.items()]).astype(dtype)
    by_column = np.argsort(column, kind="stable")
    return {"row": row[by_column], "column": column[by_column], "distance": distance[by_column]}


def file_rows(plan: Plan, blocks: Blocks) -> Iterator[Entries]:
    """Yield the entries of successive rows of the file."""
    for first in range(0, plan.shape[0], plan.block_rows):
        last = min(first + plan.block_rows, plan.shape[0])
        parts: list[tuple[NDArray[Any], ...]] = []
        for block in range(plan.blocks):
            row, column, distance = (blocks.get(block, name) for name in ARRAYS)
            sweeps = plan.rows_of(block)
            if not plan.is_flipped and sweeps[0] == first:
                parts.append((row, column, distance))
            if plan.is_flipped or (plan.is_symmetric and sweeps[0] <= first):
                part = slice(*np.searchsorted(column, [first, last]))
                mirrored = Entries(column[part], row[part], distance[part])
                off = mirrored.row != mirrored.column if plan.is_symmetric else slice(None)
                parts.append(tuple(each[off] for each in mirrored))
        entries = Entries(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        order = np.lexsort((entries.column, entries.row))
        yield Entries(*(each[order] for each in entries))

"""Sparse tables: blocks of finite distances, and the rows of the file made from them."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.matrices.blocks import Row
from geodesic_core.matrices.plan import Plan


class Entries(NamedTuple):
    """Finite distances of some successive rows, by row and column."""

    row: Longs
    column: Longs
    distance: NDArray[Any]


def block_of(plan: Plan, block: int, rows: Mapping[int, Row], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return a block: its finite distances by column, (K,) of sweep, target and distance."""
    sweeps = plan.rows_of(block)
    found = [rows[sweep] for sweep in sweeps]
    entries = np.empty(
        sum(map(len, found)), [("row", np.int32), ("column", np.int32), ("distance", dtype)]
    )
    entries["row"] = np.repeat(sweeps, list(map(len, found)))
    for name in ("column", "distance"):
        entries[name] = np.concatenate([row[name] for row in found])
    return entries[np.argsort(entries["column"], kind="stable")]


def file_rows(plan: Plan, block_of: Callable[[int], NDArray[Any]]) -> Iterator[Entries]:
    """Yield the entries of successive rows of the file.

    Reads each block once, and the part of it that is mirrored once more.
    """
    for first in range(0, plan.shape[0], plan.block_rows):
        last = min(first + plan.block_rows, plan.shape[0])
        parts: list[tuple[NDArray[Any], ...]] = []
        for block in range(plan.blocks):
            sweeps = plan.rows_of(block)
            is_own = not plan.is_flipped and sweeps[0] == first
            is_mirrored = plan.is_flipped or (plan.is_symmetric and sweeps[0] <= first)
            if not (is_own or is_mirrored):
                continue
            entries = block_of(block)
            row, column, distance = (entries[name] for name in Entries._fields)
            if is_own:
                parts.append((row, column, distance))
            if is_mirrored:
                # Not np.searchsorted, which would copy the column.
                part = slice(*(bisect_left(column, end) for end in (first, last)))
                mirrored = Entries(column[part], row[part], distance[part])
                off = mirrored.row != mirrored.column if plan.is_symmetric else slice(None)
                parts.append(tuple(each[off] for each in mirrored))
        row, column, distance = (np.concatenate(each) for each in zip(*parts, strict=True))
        order = np.lexsort((column, row))
        yield Entries(row[order].astype(np.int64), column[order].astype(np.int64), distance[order])

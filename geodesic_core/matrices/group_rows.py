"""Rows of a matrix summed by groups of its columns, as they are swept: never the matrix itself."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.fields.methods import Accuracy
from geodesic_core.fields.sources import as_points
from geodesic_core.matrices.blocks import Blocks
from geodesic_core.matrices.driver import fill
from geodesic_core.matrices.formats import Facts
from geodesic_core.matrices.matrix_file import BlockRows
from geodesic_core.matrices.plan import Plan, block_rows
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import Entries

SUM, COUNT, LEAST = range(3)
"""What is known of the distances from a vertex to a group: of those that are finite"""


class GroupRows(NamedTuple):
    """The rows of a matrix, summed by groups."""

    swept: int
    """Rows that this call computed; the others were there from an earlier one"""
    parts: Iterator[tuple[slice, Floats]]
    """Some rows, and what is known of each: (rows, 3, groups)"""


@contextmanager
def group_rows(
    mesh: TriangleMesh,
    vertices: Longs,
    starts: Longs,
    beside: Path,
    facts: Facts,
    accuracy: Accuracy,
    threads: int,
    control: Control,
) -> Iterator[GroupRows]:
    """Sum the rows of all vertices; what is finished lies beside a file until the block ends.

    The vertices are in the order of their groups, of which the starts tell the first; no group is
    empty. Each row is summed in that order by itself, so that threads and interruptions change no
    bit. Where the block fails, the next call goes on, as with `write_matrix`.

    Raises
    ------
    InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `write_matrix`.
    """
    points = as_points(mesh, vertices, "vertex", control)
    plan = Plan.of(mesh, points, None, control, in_order=True)
    # Whole rows: with each pair once, sums would depend on the order in which threads add to them.
    plan = replace(plan, is_symmetric=False, block_rows=block_rows(3 * len(starts)))
    blocks = Blocks.beside(beside)

    def taken(entries: Entries) -> dict[int, Floats]:
        parts = zip(entries.ends[:-1].tolist(), entries.ends[1:].tolist(), strict=True)
        rows = (_row(entries, slice(*part), plan.width, starts) for part in parts)
        return dict(zip(entries.rows.tolist(), rows, strict=True))

    def part_of(block: int) -> tuple[slice, Floats]:
        sweeps = plan.rows_of(block)
        return slice(sweeps.start, sweeps.stop), np.array(blocks.get(block))

    with blocks.open(facts):
        sink = BlockRows(plan, blocks, taken, _block_of, control)
        with sink.kept_if_stopped():
            fill(sink, mesh, plan.ends, np.inf, accuracy.sweep_on(mesh), threads, control)
        yield GroupRows(len(sink.sweeps), map(part_of, range(plan.blocks)))
        blocks.remove()


class GroupSums:
    """What is known of the distances between groups, as rows of their vertices are added.

    ``group_of`` tells the group of each vertex, -1 for none.
    """

    def __init__(self, group_of: Longs, groups: int) -> None:
        members = np.flatnonzero(group_of >= 0)
        self.order: Longs = members[np.argsort(group_of[members], kind="stable")]
        """(N,) the vertices by their groups"""
        self.groups = groups
        self._group: Longs = group_of[self.order]
        self.starts: Longs = np.searchsorted(self._group, np.arange(self.groups))
        self._sums, self._counts = (np.zeros((self.groups, self.groups)) for _ in range(2))
        self._least = np.full((self.groups, self.groups), np.inf)
        self._vertex_mean = np.empty((len(self.order), self.groups), np.float32)
        self._own_sums, self._own_counts = (np.empty(len(self.order)) for _ in range(2))

    def add(self, places: slice, rows: Floats) -> None:
        """Add successive rows, (n, 3, groups)."""
        group = self._group[places]
        self._vertex_mean[places] = _means(rows[:, SUM], rows[:, COUNT])
        own = rows[np.arange(len(rows)), :, group]
        self._own_sums[places], self._own_counts[places] = own[:, SUM], own[:, COUNT]
        for k in np.unique(group).tolist():
            of_group = rows[group == k]
            self._sums[k] += of_group[:, SUM].sum(axis=0)
            self._counts[k] += of_group[:, COUNT].sum(axis=0)
            self._least[k] = np.minimum(self._least[k], of_group[:, LEAST].min(axis=0))

    def symmetric(self) -> tuple[Floats, Floats]:
        """Return mean and least distances, (groups, groups), the same in both ways."""
        means = _means(self._sums + self._sums.T, self._counts + self._counts.T)
        return means, np.minimum(self._least, self._least.T)

    def by_vertex(self) -> tuple[Longs, NDArray[np.float32]]:
        """Return the vertices, ascending, and the means from them."""
        ascending = np.argsort(self.order)
        return self.order[ascending], self._vertex_mean[ascending]

    def centroids(self) -> Longs:
        """Return the vertex of each group that is nearest to its others, of those that reach most.

        The least of its number where several are.
        """
        means = _means(self._own_sums, self._own_counts)
        ranked = np.lexsort((self.order, means, -self._own_counts, self._group))
        return self.order[ranked[self.starts]]


def _means(sums: Floats, counts: Floats) -> Floats:
    with np.errstate(invalid="ignore"):  # of none
        return np.where(counts > 0, sums / counts, np.inf)


def _row(entries: Entries, part: slice, width: int, starts: Longs) -> Floats:
    distances = np.full(width, np.inf)
    distances[entries.columns[part]] = entries.distances[part]
    is_finite = np.isfinite(distances)
    return np.stack(
        [
            np.add.reduceat(np.where(is_finite, distances, 0.0), starts),
            np.add.reduceat(is_finite.astype(np.float64), starts),
            np.minimum.reduceat(distances, starts),
        ]
    )


def _block_of(plan: Plan, block: int, rows: Mapping[int, NDArray[Any]]) -> Floats:
    return np.stack([rows[sweep] for sweep in plan.rows_of(block)])

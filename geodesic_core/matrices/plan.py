"""The plan of a table: which side is swept from, in which order, and what is a block."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.fields.sources import Ends, ends_of
from geodesic_core.fields.vertex_points import VertexPoints
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_BLOCK_BYTES = 1 << 25
"""Bytes of a block, at most"""
_BLOCK_ROWS = 256
"""Rows of a block, at most: its columns are as wide where a symmetric table is mirrored"""


def block_rows(width: int) -> int:
    """Return the number of sweeps in a block, for a table of this width."""
    return max(1, min(_BLOCK_ROWS, _BLOCK_BYTES // (8 * width)))


@dataclass(frozen=True)
class Plan:
    """Sweeps from the smaller side of a table; of a symmetric one, to what comes after."""

    ends: Ends
    """From the points that are swept from, in their order, to those of the other side"""
    shape: tuple[int, int]
    """Sources and targets, as the file has them"""
    is_flipped: bool
    """True where rows that are swept are columns of the file"""
    is_symmetric: bool
    order: Longs
    """(sweeps,) row of the file for each sweep, or its column where flipped; of a symmetric table
    its column too"""
    block_rows: int

    @classmethod
    def of(
        cls,
        mesh: TriangleMesh,
        sources: Sequence[SurfacePoint],
        targets: Sequence[SurfacePoint] | None,
        control: Control,
        *,
        in_order: bool,
    ) -> "Plan":
        """Return the plan of a table, symmetric where there are no targets but the sources.

        Sweeps are ``in_order`` where their rows are to be, else in the one that sweeps least.
        """
        if targets == sources:
            targets = None
        is_flipped = targets is not None and len(targets) < len(sources)
        order = np.arange(min(len(sources), len(sources if targets is None else targets)))
        if targets is None:
            if not in_order:
                order = sweep_order(_positions(mesh, sources))
                sources = taken(sources, order)
            swept_from, others = sources, sources
        else:
            swept_from, others = (targets, sources) if is_flipped else (sources, targets)
        width = len(others)
        return cls(
            ends_of(mesh, swept_from, others, control),
            (len(sources), len(sources if targets is None else targets)),
            is_flipped,
            targets is None,
            order,
            block_rows(width),
        )

    @property
    def sweeps(self) -> int:
        """Number of points that are swept from."""
        return len(self.order)

    @property
    def width(self) -> int:
        """Number of points on the other side."""
        return len(self.ends.targets)

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.sweeps // self.block_rows)

    def rows_of(self, block: int) -> range:
        """Return the sweeps of a block."""
        first = block * self.block_rows
        return range(first, min(first + self.block_rows, self.sweeps))

    def columns_of(self, sweeps: Longs) -> tuple[Ints, Ints]:
        """Return the first target of each of some sweeps, and one beyond its last.

        They are all targets; of a symmetric table, the source of the sweep and those after it.
        """
        last = np.full(len(sweeps), self.width, np.int32)
        return sweeps.astype(np.int32) if self.is_symmetric else np.zeros_like(last), last


def _positions(mesh: TriangleMesh, points: Sequence[SurfacePoint]) -> Floats:
    """Return the positions of canonical points, (n, 3); zeros where they have none."""
    if not mesh.has_positions:
        return np.zeros((len(points), 3))
    if isinstance(points, VertexPoints):
        return mesh.vertices[points.vertices]
    return np.array([mesh.position(point) for point in points])


def taken(points: Sequence[SurfacePoint], order: Longs) -> Sequence[SurfacePoint]:
    """Return points in another order."""
    if isinstance(points, VertexPoints):
        return points.take(order)
    return [points[i] for i in order.tolist()]


def sweep_order(positions: Floats) -> Longs:
    """Return the points from one end of the longest extent to the other, (n,) int64.

    A sweep ends at the farthest point that comes after its source. So the points that are left are
    to be near each other: on a sphere this order sweeps five sixths of the surface on average, on
    a long surface three quarters of it. O(n log n).

    Parameters
    ----------
    positions
        (n, 3), mesh units.
    """
    centred = positions - positions.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return np.argsort(centred @ axes[:, -1], kind="stable")

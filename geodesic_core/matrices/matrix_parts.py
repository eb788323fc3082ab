"""A matrix in parts, which may be computed on several machines and are then joined to one file."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import IO, Any, Literal

import numpy as np
from numpy.typing import NDArray

from geodesic_core.control import Control
from geodesic_core.fields.methods import Effort, Method, sweep_of
from geodesic_core.fields.sources import as_points
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.matrices import dense, sparse
from geodesic_core.matrices.blocks import Row, rows_of
from geodesic_core.matrices.driver import fill
from geodesic_core.matrices.formats import write_npy, write_npz
from geodesic_core.matrices.plan import Plan, block_rows
from geodesic_core.mesh.surface_point import Point
from geodesic_core.search.target_sweep import Entries
from geodesic_core.validation import as_limit, check_choice

_PART_WORK = 3e8
"""Faces to the power of 1.5, for each of the whole sweeps of a part: about 5 s on a core.

Whole sweeps over spheres, the dearest meshes, took 1.5e-8 s for each. A part is lost as a whole
where its process ends.
"""


def _part_rows(width: int, faces: int, max_distance: float | None) -> int:
    """Return the number of sweeps in a part, for a matrix of this width."""
    rows = block_rows(width)
    if max_distance is None:  # sweeps to a limit take any time below that
        rows = min(rows, int(_PART_WORK / faces**1.5))
    return max(1, rows)


class MatrixParts:
    """A matrix in parts, each with the distances of some sweeps.

    The parts may be computed in any order, by several processes or machines. Joined, they are the
    file that `write_matrix` writes, to the bit.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    sources, targets
        N and M vertex indices or `SurfacePoint`. Without targets, the targets are the sources.
        Where both are the same, each pair is computed once.
    layout
        ``"dense"`` for all distances, ``"sparse"`` for the finite ones.
    method, relative_error, absolute_error, effort, max_distance
        As in `write_matrix`.
    dtype
        Of the distances.
    cancel
        See `Control`.

    Raises
    ------
    InvalidPoint, InvalidArgument, Cancelled
        As in `write_matrix`.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> parts = gc.MatrixParts(mesh, [0, 1], [2, 3])
    >>> [parts.compute(part).round(3).tolist() for part in range(parts.count)]
    [[[1.0, 1.414], [1.414, 1.0]]]
    """

    def __init__(
        self,
        mesh: MeshLike,
        sources: Sequence[Point],
        targets: Sequence[Point] | None = None,
        *,
        layout: Literal["dense", "sparse"] = "dense",
        method: Method = "exact",
        relative_error: float | None = 1e-3,
        absolute_error: float | None = None,
        effort: Effort = 2,
        max_distance: float | None = None,
        dtype: Literal["float64", "float32"] = "float64",
        cancel: Callable[[], bool] | None = None,
    ) -> None:
        check_choice("layout", layout, ("dense", "sparse"))
        check_choice("dtype", dtype, ("float64", "float32"))
        control = Control(cancel=cancel)
        self._mesh = as_mesh(mesh)
        errors = relative_error, absolute_error
        self._sweep_of = sweep_of(self._mesh, method, *errors, effort)
        self._limit = as_limit(max_distance)
        self._dtype = np.dtype(dtype)
        source_points = as_points(self._mesh, sources, "source", control)
        target_points = (
            None if targets is None else as_points(self._mesh, targets, "target", control)
        )
        self._is_sparse = layout == "sparse"
        plan = Plan.of(self._mesh, source_points, target_points, control, in_order=self._is_sparse)
        rows = _part_rows(plan.width, len(self._mesh.faces), max_distance)
        self._plan = replace(plan, block_rows=rows)

    @staticmethod
    def areas(
        sources: int, targets: int | None, faces: int, max_distance: float | None = None
    ) -> list[int]:
        """Return the number of distances in each part, by the size of the question alone.

        Parameters
        ----------
        sources, targets
            Numbers of points, 1 or more; None for targets that are the sources.
        faces
            Number of faces of the mesh.
        max_distance
            As of the parts.

        Returns
        -------
        list of int
            One for each part, whatever the layout. Work and memory are about proportional to it.

        Examples
        --------
        >>> gc.MatrixParts.areas(300, None, faces=20_000)
        [31800, 20564, 7744]
        """
        sweeps = sources if targets is None else min(sources, targets)
        width = sources if targets is None else max(sources, targets)
        rows = _part_rows(width, faces, max_distance)
        return [
            min(rows, sweeps - first) * (width - (first if targets is None else 0))
            for first in range(0, sweeps, rows)
        ]

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of sources and of targets."""
        return self._plan.shape

    @property
    def count(self) -> int:
        """The number of parts."""
        return self._plan.blocks

    def compute(
        self,
        part: int,
        *,
        progress: Callable[[float], None] | None = None,
        cancel: Callable[[], bool] | None = None,
        deadline_s: float | None = None,
        memory_limit: int | None = None,
    ) -> NDArray[Any]:
        """Return the distances of a part, in a form that `write` knows.

        Parameters
        ----------
        part
            Number of the part, from 0.
        progress, cancel, deadline_s, memory_limit
            See `Control`.

        Returns
        -------
        numpy.ndarray
            Of a dense matrix: (sweeps, columns), float64 or float32, mesh units, infinite where
            unreachable. Of a sparse one: (K,) records of sweep and column, int32, and distance.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As in `exact_distance`.

        Examples
        --------
        >>> parts = gc.MatrixParts(gc.samples.plane(2), [0], [3])
        >>> parts.compute(0).round(3).tolist()
        [[1.414]]
        """
        control = Control(progress, cancel, deadline_s, memory_limit)
        sink = _Part(self._plan, part)
        fill(sink, self._mesh, self._plan.ends, self._limit, self._sweep_of, 1, control)
        block_of = sparse.block_of if self._is_sparse else dense.block_of
        return block_of(self._plan, part, sink.rows, self._dtype)

    def reached(self, part: NDArray[Any]) -> int:
        """Return the number of finite distances of the matrix that come from a part.

        Parameters
        ----------
        part
            What `compute` has returned for it.

        Returns
        -------
        int
            The sum over all parts is the number of finite distances of the matrix.

        Examples
        --------
        >>> parts = gc.MatrixParts(gc.samples.plane(2), [0, 1], [0, 1], max_distance=0.5)
        >>> parts.reached(parts.compute(0))
        2
        """
        finite = len(part) if self._is_sparse else int(np.count_nonzero(np.isfinite(part)))
        if not self._plan.is_symmetric:
            return finite
        if self._is_sparse:
            return 2 * finite - int(np.count_nonzero(part["row"] == part["column"]))
        # Of the sweeps among themselves both halves are there, of the others one.
        return 2 * finite - int(np.count_nonzero(np.isfinite(part[:, : len(part)])))

    def write(self, file: IO[bytes], part: Callable[[int], NDArray[Any]]) -> None:
        """Write the matrix, (N, M), from its parts: as npy if dense, as npz if sparse.

        Parameters
        ----------
        file
            An empty file, open for writing. Its rows are not written in their order.
        part
            Function that returns what `compute` has returned for a part, most simply a mapped
            array. It is called often.

        Examples
        --------
        >>> from io import BytesIO
        >>> parts, file = gc.MatrixParts(gc.samples.plane(2), [0, 1], [2, 3]), BytesIO()
        >>> parts.write(file, parts.compute)
        >>> np.load(BytesIO(file.getvalue())).shape
        (2, 2)
        """
        write = write_npz if self._is_sparse else write_npy
        write(self._plan, part, self._dtype, file)


class _Part:
    """The rows of a part in the making."""

    def __init__(self, plan: Plan, part: int) -> None:
        self.sweeps, self.columns_of, self.nbytes = plan.rows_of(part), plan.columns_of, 0
        self.rows: dict[int, Row] = {}

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps."""
        self.rows |= rows_of(entries)
        self.nbytes += entries.nbytes

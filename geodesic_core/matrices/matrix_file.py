"""Matrices of distances larger than memory, written to a file, and continued after a stop."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

import json
import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.methods import Accuracy, Effort, Method
from geodesic_core.fields.path import ErrorBound
from geodesic_core.fields.sources import as_points
from geodesic_core.fields.vertex_points import VertexPoints
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.kernels.jit.cache import sources_digest
from geodesic_core.matrices import dense, sparse
from geodesic_core.matrices.blocks import Blocks, Row, rows_of
from geodesic_core.matrices.driver import fill
from geodesic_core.matrices.formats import (
    SPARSE,
    SUFFIXES,
    DenseWriter,
    Facts,
    may_replace,
    require,
    sha256_of,
    write_table,
)
from geodesic_core.matrices.plan import Plan
from geodesic_core.matrices.threads import as_threads
from geodesic_core.mesh.barriers import with_barriers
from geodesic_core.mesh.surface_point import Point, Points, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.target_sweep import Entries
from geodesic_core.validation import as_limit, check_choice

Everywhere = Literal["all"]
"""Every vertex of the mesh"""

_KEPT_SECONDS = 5.0
"""Time after which finished rows are kept even though their block is not complete"""


@dataclass(frozen=True)
class MatrixFile:
    """A matrix in a file, which `write_matrix` wrote.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> mesh = gc.samples.plane(2)
    >>> gc.write_matrix(mesh, f"{mkdtemp()}/square.npy", [0, 1], [2, 3]).shape
    (2, 2)
    """

    path: Path
    shape: tuple[int, int]
    """Sources and targets"""
    error_bound: ErrorBound
    sha256: str
    """Of the file's content, hexadecimal; of a Zarr folder, of its files in the order of names"""
    swept: int
    """Rows that this call computed; the others were there from an earlier one"""


def write_matrix(
    mesh: MeshLike,
    out: str | Path,
    sources: Sequence[Point] | Everywhere,
    targets: Sequence[Point] | Everywhere | None = None,
    *,
    method: Method = "exact",
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    effort: Effort = 2,
    max_distance: float | None = None,
    barriers: Iterable[int] = (),
    dtype: Literal["float64", "float32"] = "float64",
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> MatrixFile:
    """Write the distances from each source to each target to a file, however many there are.

    If a call was interrupted, the same call continues where it stopped: finished rows are kept in a
    hidden folder beside the file until the file is complete. A process that is killed loses the
    rows of its last 5 s. Interruptions and the number of threads do not change a bit of the file.

    Parameters
    ----------
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    out
        ``.npy``: a dense matrix, which `numpy.load` can map into memory; ``.zarr``: the same in
        chunks of rows; ``.npz``: a sparse one for `scipy.sparse.load_npz`, of the finite distances;
        ``.parquet``: these as a table of source, target and distance.
    sources, targets
        N and M vertex indices or `SurfacePoint`, or ``"all"`` vertices. Without targets, the
        targets are the sources. Where both are the same, each pair is computed once.
    method
        ``"exact"``; ``"approximate"``, within ``relative_error`` and ``absolute_error``; or
        ``"fast"``, with an ``effort``. See the solvers of these names.
    relative_error, absolute_error, effort
        For the method that takes it.
    max_distance
        Limit of the sweeps, mesh units; None for no limit. Points beyond it count as unreachable.
    barriers
        Ids of faces that paths may not cross, see `TriangleMesh.with_barriers`.
    dtype
        Type of the distances in the file.
    threads
        Largest number of threads; None for one per core that the process may use.
    progress, cancel, deadline_s, memory_limit
        See `Control`; files do not count as memory.

    Returns
    -------
    MatrixFile
        The file, its shape and its error. The same facts and the arguments are in ``out`` +
        ``".json"``: the ids of the rows and columns among them, or ``"all"``, and the barriers.

    Raises
    ------
    InvalidArgument
        Also where the suffix is none of these, the folder does not exist, ``out`` is itself a
        folder other than a Zarr array, or part of another matrix for this file lies beside it.
    InvalidPoint, Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `exact_distance`.
    MissingExtra
        The format needs a package that is not installed.
    OSError
        The file cannot be written; finished rows are kept.

    Notes
    -----
    Memory is a block of rows and the state of a sweep for each thread, whatever N and M. On disk it
    takes twice the file's size until the file is complete.

    Examples
    --------
    >>> mesh = gc.samples.plane(2)  # the unit square, in two triangles
    >>> from tempfile import mkdtemp
    >>> written = gc.write_matrix(mesh, f"{mkdtemp()}/square.npy", "all")
    >>> written.shape
    (4, 4)
    >>> np.load(written.path, mmap_mode="r")[0].round(3).tolist()
    [0.0, 1.0, 1.0, 1.414]
    """
    return write_formed(
        as_mesh(mesh),
        out,
        Asked(sources, targets, max_distance, barriers, dtype, threads),
        Form(),
        Accuracy(method, relative_error, absolute_error, effort),
        Control(progress, cancel, deadline_s, memory_limit),
    )


@dataclass(frozen=True)
class Form:
    """What a file holds beside distances, and formats of it beyond those of `write_matrix`."""

    facts: Facts = field(default_factory=lambda: {"units": "mesh units"})
    are_inside: bool = False
    """Whether an npz file has the facts as well, as an array of that name"""
    dense_writers: Mapping[str, DenseWriter] = field(default_factory=dict)
    """By suffix: what writes a dense matrix, which is mapped"""


class Asked(NamedTuple):
    """The arguments of `write_matrix` that say which distances, as they are given."""

    sources: Points | Everywhere
    targets: Points | Everywhere | None
    max_distance: float | None
    barriers: Iterable[int]
    dtype: Literal["float64", "float32"]
    threads: int | None


def write_formed(
    mesh: TriangleMesh,
    out: str | Path,
    asked: Asked,
    form: Form,
    accuracy: Accuracy,
    control: Control,
) -> MatrixFile:
    """Write a matrix to a file of some form; see `write_matrix`."""
    sources, targets, max_distance, barriers, dtype, threads = asked
    limit = as_limit(max_distance)
    check_choice("dtype", dtype, ("float64", "float32"))
    most = as_threads(threads)
    path, suffix = _place_for(out, (*SUFFIXES, *form.dense_writers))
    mesh, control = with_barriers(mesh, barriers, control)
    method_sweep = accuracy.sweep_on(mesh)
    source_points, rows = _points(mesh, sources, "source", control)
    target_points, columns = (
        (None, rows) if targets is None else _points(mesh, targets, "target", control)
    )
    plan = Plan.of(mesh, source_points, target_points, control, in_order=suffix in SPARSE)
    sides = {"sources": rows, "targets": columns, "shape": plan.shape}
    facts = facts_of(mesh, accuracy, limit, sides | {"dtype": dtype, **form.facts})
    layout, blocks = sparse if suffix in SPARSE else dense, Blocks.beside(path)
    with blocks.open(facts):
        block_of = partial(layout.block_of, dtype=np.dtype(dtype))
        sink = BlockRows(plan, blocks, rows_of, block_of, control)
        with sink.kept_if_stopped():
            fill(sink, mesh, plan.ends, limit, method_sweep, most, control)
        inside = facts if form.are_inside else None
        write_table(plan, blocks, np.dtype(dtype), facts, path, inside, form.dense_writers)
        bound = accuracy.promise_on(mesh)
        written = MatrixFile(path, plan.shape, bound, sha256_of(path), len(sink.sweeps))
        write_beside(path, facts | {"sha256": written.sha256})
        blocks.remove()
    control.finish()
    return written


def facts_of(mesh: TriangleMesh, accuracy: Accuracy, limit: float, others: Facts) -> dict[str, Any]:
    """Return what a matrix is made from: the surface, what was asked, and what is promised."""
    return {
        "mesh": mesh.digest,
        "barriers": mesh.barriers.tolist(),
        **accuracy.chosen,
        "error_bound": asdict(accuracy.promise_on(mesh)),
        "max_distance": None if math.isinf(limit) else limit,
        **others,
        "kernels": sources_digest(),
    }


def _place_for(out: str | Path, suffixes: Sequence[str]) -> tuple[Path, str]:
    """Return the path of a file that can be written, and its suffix.

    Raises
    ------
    InvalidArgument, MissingExtra
        As in `write_matrix`.
    """
    path = Path(out)
    suffix = path.suffix.lower()
    check_choice("the suffix of out", suffix, suffixes)
    if not path.parent.is_dir():
        raise InvalidArgument(f"there is no folder {path.parent}")
    if not may_replace(path):
        raise InvalidArgument(f"{path} is a folder that may hold other data: choose another name")
    require(suffix)
    return path, suffix


def _points(
    mesh: TriangleMesh, points: Points | Everywhere, name: str, control: Control
) -> tuple[Sequence[SurfacePoint], Any]:
    """Return canonical points, and how the facts of a file name them, which a service reads too."""
    if isinstance(points, str) and points == "all":
        return as_points(mesh, range(len(mesh.vertices)), name, control), points
    canonical = as_points(mesh, points, name, control)
    if isinstance(canonical, VertexPoints):
        return canonical, canonical.vertices.tolist()
    return canonical, [
        {"face": int(point.face_index), "barycentric": point.barycentric}
        if point.vertex_index is None
        else point.vertex_index
        for point in canonical
    ]


def write_beside(path: Path, facts: Facts) -> None:
    """Write what a file holds into another one beside it, one fact a line."""
    rows = (f" {json.dumps(name)}: {json.dumps(fact)}" for name, fact in facts.items())
    path.with_name(f"{path.name}.json").write_text("{\n" + ",\n".join(rows) + "\n}\n")


class BlockRows:
    """The rows of blocks that are missing; a block is written once it has all of its own.

    The rows of other blocks are kept from time to time. ``taken`` makes rows of entries, and
    ``block_of`` a block of rows.
    """

    def __init__(
        self,
        plan: Plan,
        blocks: Blocks,
        taken: Callable[[Entries], Mapping[int, Row]],
        block_of: Callable[[Plan, int, Mapping[int, Row]], NDArray[Any]],
        control: Control,
    ) -> None:
        self._plan, self._blocks, self._taken, self._block_of = plan, blocks, taken, block_of
        missing = (block for block in control.watched(range(plan.blocks)) if not blocks.has(block))
        self._unfinished = {block: blocks.kept(block) for block in missing}
        self.sweeps = [
            sweep
            for block, rows in self._unfinished.items()
            for sweep in plan.rows_of(block)
            if sweep not in rows
        ]
        self.columns_of, self.nbytes = plan.columns_of, 0  # files do not count
        self._lock, self._last_kept = threading.Lock(), time.monotonic()

    def put(self, entries: Entries) -> None:
        """Store the finite distances of some sweeps."""
        complete = {}
        found = self._taken(entries)
        with self._lock:
            for sweep, row in found.items():
                block = sweep // self._plan.block_rows
                rows = self._unfinished[block]
                rows[sweep] = row
                if len(rows) == len(self._plan.rows_of(block)):
                    complete[block] = self._unfinished.pop(block)
            if not complete and time.monotonic() - self._last_kept >= _KEPT_SECONDS:
                self.keep()
                self._last_kept = time.monotonic()
        for block, rows in complete.items():
            self._blocks.put(block, self._block_of(self._plan, block, rows))

    @contextmanager
    def kept_if_stopped(self) -> Iterator[None]:
        """Keep the rows that are there, where an exception ends the block."""
        try:
            yield
        except BaseException:
            with suppress(OSError):  # a full disk is what may have stopped the call
                self.keep()
            raise

    def keep(self) -> None:
        """Write the rows of blocks that are not complete."""
        for block, rows in self._unfinished.items():
            if rows:
                self._blocks.keep(block, rows)

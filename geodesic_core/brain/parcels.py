"""Distances between the parcels of a cortex, found as rows are swept: never all at once."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.brain.cifti import brain_models, write_cifti
from geodesic_core.brain.files import nibabel
from geodesic_core.brain.map_files import write_labels
from geodesic_core.brain.parcellation import Parcellation
from geodesic_core.control import Control
from geodesic_core.fields.methods import Accuracy, Effort, Method
from geodesic_core.fields.path import ErrorBound
from geodesic_core.matrices.formats import sha256_of
from geodesic_core.matrices.group_rows import GroupSums, group_rows
from geodesic_core.matrices.matrix import find_matrix
from geodesic_core.matrices.matrix_file import facts_of, write_beside
from geodesic_core.matrices.threads import as_threads
from geodesic_core.search.workspace import Workspace

_ARRAYS = "parcels.npz"
"""Name of the file with all arrays; beside it lies what is finished"""


@dataclass(frozen=True, eq=False)
class ParcelDistances:
    """Distances between the P parcels of a cortex, mm; infinite where no path leads.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> ball = gc.samples.sphere(80)
    >>> cortex = gc.brain.load_cortex({"left": ball})
    >>> parcels = gc.brain.load_parcels(1 + (ball.vertices[:, 2] > 0), cortex)
    >>> found = gc.brain.parcel_distances(parcels, mkdtemp())
    >>> bool((found.least <= found.mean).all())
    True
    """

    parcels: Parcellation
    mean: Floats
    """(P, P) over all pairs of a vertex of one and a vertex of the other that a path joins, those
    of a vertex with itself included"""
    least: Floats
    """(P, P)"""
    centroid: Floats
    """(P, P) between their centroids"""
    centroids: Longs
    """(P,) the vertex of each parcel, in the mesh, whose mean distance to its vertices is least"""
    vertices: Longs
    """(N,) those with a parcel, ascending"""
    vertex_mean: NDArray[np.float32]
    """(N, P) from each vertex to the vertices of each parcel"""
    error_bound: ErrorBound
    swept: int
    """Vertices that this call swept from; the others were done by an earlier one"""


def parcel_distances(
    parcels: Parcellation,
    folder: str | Path,
    *,
    method: Method = "exact",
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    effort: Effort = 2,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> ParcelDistances:
    """Find the distances between parcels from those of their vertices, and write them to a folder.

    If a call was interrupted, the same call continues where it stopped, as `write_matrix` does.

    Parameters
    ----------
    parcels
        From `load_parcels`; paths go as in its cortex.
    folder
        Made where there is none. Gets ``mean.pconn.nii``, ``least.pconn.nii`` and
        ``centroid.pconn.nii``; ``vertex_mean.dpconn.nii`` and its transpose
        ``vertex_mean.pdconn.nii``; ``areas.pscalar.nii``, ``parcels.dlabel.nii``, and all as arrays
        in ``parcels.npz`` with ``parcels.npz.json``.
    method, relative_error, absolute_error, effort, threads
        As in `write_matrix`.
    progress, cancel, deadline_s, memory_limit
        See `Control`; files do not count as memory.

    Returns
    -------
    ParcelDistances
        The same, in memory.

    Raises
    ------
    InvalidArgument
        Also where the folder holds part of another call.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded, MissingExtra
        As in `write_matrix`.
    OSError
        The folder cannot be made or written; finished rows are kept.

    Notes
    -----
    A sweep for each vertex with a parcel. Memory is that of the result, of some rows and of a sweep
    for each thread.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> ball = gc.samples.sphere(80)
    >>> cortex = gc.brain.load_cortex({"left": ball})
    >>> parcels = gc.brain.load_parcels(1 + (ball.vertices[:, 2] > 0), cortex)
    >>> out = mkdtemp()
    >>> found = gc.brain.parcel_distances(parcels, out)
    >>> file = gc.brain.load_matrix(f"{out}/mean.pconn.nii")
    >>> file.rows, bool((file.values == found.mean.astype(np.float32)).all())
    (['1', '2'], True)
    """
    nibabel("cifti2", "parcel_distances")
    control = Control(progress, cancel, deadline_s, memory_limit)
    accuracy = Accuracy(method, relative_error, absolute_error, effort)
    most = as_threads(threads)
    out = Path(folder)
    out.mkdir(exist_ok=True)
    mesh = parcels.cortex.mesh
    own = {"parcels": parcels.names, "keys": parcels.keys, "parcel_of": parcels.parcel_of.tolist()}
    facts = facts_of(mesh, accuracy, np.inf, parcels.cortex.facts | own)
    sums = GroupSums(parcels.parcel_of, len(parcels.names))
    count, parts = len(sums.order), len(sums.order) + sums.groups
    first, last = control.for_part(0, parts, count), control.for_part(count, parts, sums.groups)
    asked = (out / _ARRAYS, facts, accuracy, most, first)
    with group_rows(mesh, sums.order, sums.starts, *asked) as rows:
        for part in rows.parts:
            sums.add(*part)
        centroids = sums.centroids()
        sweep_of = accuracy.sweep_on(mesh)
        between = find_matrix(Workspace(mesh), sweep_of, centroids, None, None, "dense", most, last)
        found = ParcelDistances(
            parcels,
            *sums.symmetric(),
            np.asarray(between),
            centroids,
            *sums.by_vertex(),
            accuracy.promise_on(mesh),
            rows.swept,
        )
        _write(found, out, facts)
    control.finish()
    return found


def _write(found: ParcelDistances, out: Path, facts: dict[str, Any]) -> None:
    parcels = found.parcels
    cifti2, structures = nibabel("cifti2", "parcel_distances"), parcels.cortex.structures
    vertex, area = brain_models(structures, found.vertices), cifti2.ScalarAxis(["area"])
    parcel = cifti2.ParcelsAxis.from_brain_models(
        [
            (name, brain_models(structures, np.flatnonzero(parcels.parcel_of == k)))
            for k, name in enumerate(parcels.names)
        ]
    )
    tables: dict[str, tuple[tuple[Any, Any], NDArray[Any]]] = {
        "mean.pconn.nii": ((parcel, parcel), found.mean),
        "least.pconn.nii": ((parcel, parcel), found.least),
        "centroid.pconn.nii": ((parcel, parcel), found.centroid),
        "vertex_mean.dpconn.nii": ((parcel, vertex), found.vertex_mean.T),
        "vertex_mean.pdconn.nii": ((vertex, parcel), found.vertex_mean),
        "areas.pscalar.nii": ((area, parcel), parcels.areas[None]),
    }
    for name, (axes, values) in tables.items():
        kind = "".join(Path(name).suffixes)
        write_cifti(out / name, kind, axes, values, facts)
        write_beside(out / name, facts | {"sha256": sha256_of(out / name)})
    write_labels(out / "parcels.dlabel.nii", parcels)
    arrays = {name: each for name, each in vars(found).items() if isinstance(each, np.ndarray)}
    arrays |= {name: np.array(getattr(parcels, name)) for name in ("parcel_of", "areas", "names")}
    arrays["facts"] = np.array(json.dumps(facts).encode())
    np.savez(out / _ARRAYS, allow_pickle=False, **arrays)
    write_beside(out / _ARRAYS, facts | {"sha256": sha256_of(out / _ARRAYS)})

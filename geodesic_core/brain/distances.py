"""Matrices between the vertices of a cortex, in the files of brain imaging."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from geodesic_core.brain.cifti import brain_models, write_cifti
from geodesic_core.brain.cortex import Cortex
from geodesic_core.brain.files import kind_of
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.methods import Accuracy, Effort, Method
from geodesic_core.matrices.formats import SUFFIXES, Facts
from geodesic_core.matrices.matrix_file import Asked, Form, MatrixFile, write_formed

_DCONN, _NIFTI = ".dconn.nii", ".nii"


def write_distances(
    cortex: Cortex,
    out: str | Path,
    *,
    method: Method = "exact",
    relative_error: float | None = 1e-3,
    absolute_error: float | None = None,
    effort: Effort = 2,
    max_distance: float | None = None,
    dtype: Literal["float64", "float32"] = "float32",
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> MatrixFile:
    """Write the distances between all vertices of the region, as `write_matrix` does.

    Parameters
    ----------
    cortex
        From `load_cortex`.
    out
        ``.dconn.nii``, or one of the formats of `write_matrix`: ``.npz`` and ``.parquet`` for the
        finite distances only, which suit a limit.
    method, relative_error, absolute_error, effort
        As in `write_matrix`.
    max_distance
        The farthest distance, mm; None for no limit. Beyond it, and between hemispheres, they are
        infinite (Workbench writes -1).
    dtype
        Of the distances; CIFTI has ``"float32"``.
    threads
        As in `write_matrix`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    MatrixFile
        (K, K), of the vertices of the region in their order. The ids are in the file: brain models
        of CIFTI; the member ``facts`` of ``.npz``, JSON as bytes; the metadata of Zarr and Parquet.
        ``out`` + ``".json"`` has the same: ``region`` has the vertices of each structure, and
        ``sources`` their numbers in the mesh of both surfaces; ``wall`` what it meant.

    Raises
    ------
    InvalidArgument, Cancelled, DeadlineExceeded, MemoryLimitExceeded, MissingExtra
        As in `write_matrix`.

    Notes
    -----
    Memory as for `write_matrix`: some rows, whatever the size of the matrix.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)}, [1, 2, 4], "passes")
    >>> gc.brain.write_distances(cortex, f"{mkdtemp()}/near.npz", max_distance=0.5).shape
    (3, 3)
    """
    path = Path(out)
    is_cifti = kind_of(path, (_DCONN, *SUFFIXES)) == _DCONN
    if is_cifti and dtype != "float32":
        raise InvalidArgument(f"{path} has float32 distances, as all of CIFTI")
    axis = brain_models(cortex.structures, cortex.region) if is_cifti else None

    def write_dconn(table: NDArray[Any], facts: Facts, scratch: Path) -> None:
        # The matrix is symmetric, and nibabel writes columns: which are then rows, as mapped.
        write_cifti(scratch, _DCONN, (axis, axis), table.T, facts)

    return write_formed(
        cortex.mesh,
        path,
        Asked(cortex.region, None, max_distance, (), dtype, threads),
        Form(cortex.facts, are_inside=True, dense_writers={_NIFTI: write_dconn}),
        Accuracy(method, relative_error, absolute_error, effort),
        Control(progress, cancel, deadline_s, memory_limit),
    )

"""Validation of the arrays that a mesh is made of; messages name the elements at fault."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.mesh.report import NAMED
from geodesic_core.tolerances import LARGEST_COORDINATE


def as_vertices(vertices: ArrayLike) -> Floats:
    """Return a (V, 3) float64 copy of positions, whose values `check_vertices` checks.

    Raises
    ------
    InvalidMesh
        They are not rows of three real numbers, or some are masked.
    """
    _refuse_masked(vertices, "vertex", "vertices")
    try:
        given = np.asarray(vertices)
        array = np.array(given, dtype=np.float64, order="C") if given.dtype.kind in "fiuO" else None
    except (TypeError, ValueError) as error:
        raise InvalidMesh(f"vertices are not real numbers: {error}", kind="vertex") from error
    if array is None:  # text and complex numbers: numpy would convert them
        raise InvalidMesh(
            f"vertices have type {given.dtype}; they must be real numbers", kind="vertex"
        )
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidMesh(f"vertices have shape {array.shape}; it must be (V, 3)", kind="vertex")
    return array


def as_faces(faces: ArrayLike) -> Longs:
    """Return a (F, 3) int64 copy of vertex indices, whose range `check_corners` checks.

    Raises
    ------
    InvalidMesh
        There are none, they are not rows of three integers, or some are masked.
    """
    _refuse_masked(faces, "face", "faces")
    try:
        array = np.asarray(faces)
    except ValueError as error:
        raise InvalidMesh(f"faces are not triangles: {error}", kind="face") from error
    if array.size == 0:
        raise InvalidMesh("the mesh has no faces", kind="face")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidMesh(
            f"faces have shape {array.shape}; it must be (F, 3): triangulate polygons first",
            kind="face",
        )
    if array.dtype.kind not in "iu":
        raise InvalidMesh(
            f"faces have type {array.dtype}; vertex indices must be integers", kind="face"
        )
    return np.array(array, dtype=np.int64, order="C")


def _refuse_masked(rows: ArrayLike, kind: str, name: str) -> None:
    """Refuse rows of which a masked array says that they do not count."""
    if not isinstance(rows, np.ma.MaskedArray):
        return
    mask = np.ma.getmaskarray(rows)
    bad = np.flatnonzero(mask.reshape(len(mask), -1).any(axis=1)) if mask.ndim else np.zeros(1, int)
    if len(bad):
        raise InvalidMesh(
            f"{kind} {bad[0]} is masked{_and_more(bad)}: leave masked {name} out first, with the "
            "faces that have them",
            kind=kind,
            elements=bad[:NAMED].tolist(),
        )


def as_polygons(corners: ArrayLike, sizes: ArrayLike) -> tuple[Longs, Longs]:
    """Return int64 copies of the (C,) corners of all polygons and of their (P,) sizes.

    Raises
    ------
    InvalidMesh
        They are not integers, some are masked, a polygon has no corners, or the sizes do not sum to
        C.
    """
    _refuse_masked(corners, "face", "corners")
    try:
        flat, counts = np.asarray(corners), np.asarray(sizes)
    except ValueError as error:
        raise InvalidMesh(f"polygons are not rows of corners: {error}", kind="face") from error
    if counts.size == 0:
        raise InvalidMesh("the mesh has no faces", kind="face")
    for name, array in (("corners", flat), ("sizes", counts)):
        if array.ndim != 1 or array.dtype.kind not in "iu":
            raise InvalidMesh(f"{name} must be one row of integers", kind="face")
    empty = np.flatnonzero(counts < 1)
    if len(empty):
        raise InvalidMesh(
            f"face {empty[0]} has no corners{_and_more(empty)}",
            kind="face",
            elements=empty[:NAMED].tolist(),
        )
    if counts.sum() != len(flat):
        raise InvalidMesh(
            f"the sizes sum to {counts.sum()}, but there are {len(flat)} corners", kind="face"
        )
    return flat.astype(np.int64), counts.astype(np.int64)


def check_vertices(vertices: Floats) -> None:
    """Refuse (V, 3) positions that are not finite, or larger than `LARGEST_COORDINATE`.

    Raises
    ------
    InvalidMesh
        Naming the vertices at fault.
    """
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~(np.abs(vertices) <= LARGEST_COORDINATE).all(axis=1))
    if len(bad):
        raise InvalidMesh(
            f"vertex {bad[0]} is at {vertices[bad[0]].tolist()}: coordinates must be finite and at "
            f"most {LARGEST_COORDINATE:g} in size{_and_more(bad)}",
            kind="vertex",
            elements=bad[:NAMED].tolist(),
        )


def check_corners(corners: Longs, sizes: Longs, vertex_count: int) -> None:
    """Refuse faces with an index out of range; all corners are given in one row, face by face.

    Raises
    ------
    InvalidMesh
        Naming the faces at fault.
    """
    is_bad = (corners < 0) | (corners >= vertex_count)
    if not is_bad.any():
        return
    bad = np.unique(np.repeat(np.arange(len(sizes)), sizes)[is_bad])
    start = int(sizes[: bad[0]].sum())
    end = start + int(sizes[bad[0]])
    if end - start <= NAMED:
        said = f"is {corners[start:end].tolist()}"
    else:
        first = start + int(np.argmax(is_bad[start:end]))
        said = f"has {end - start} corners, of which one is {corners[first]}"
    raise InvalidMesh(
        f"face {bad[0]} {said}, but vertices are numbered 0 to {vertex_count - 1}{_and_more(bad)}",
        kind="face",
        elements=bad[:NAMED].tolist(),
    )


def _and_more(bad: Sequence[Any] | NDArray[Any]) -> str:
    return f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""

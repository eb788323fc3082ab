"""Labels of brain surfaces, such as the medial wall: files that name vertices of a surface."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.errors import (
    EmptyBarrier,
    GeodesicError,
    InvalidArgument,
    InvalidMesh,
    NoSuchLabel,
    OtherSurface,
)
from geodesic_core.extras import extra
from geodesic_core.io.annotation import check_vertices, read_annotation
from geodesic_core.io.as_mesh import MeshLike, as_mesh
from geodesic_core.io.unpacking import read_unpacked
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_Label = str | float | None


def load_label(
    source: str | Path, mesh: MeshLike, label: _Label = None, *, outside: bool = False
) -> Longs:
    r"""Return the faces whose corners all lie in a label: barriers, where it is the medial wall.

    Parameters
    ----------
    source
        The path of a FreeSurfer label (``.label``), which lists vertices, of an annotation
        (``.annot``), which has several labels, or of a GIFTI file (``.label.gii``,
        ``.shape.gii``, ``.func.gii``), which has a value for each vertex. Any of them may be
        packed, as mesh files may (``.gz``).
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    label
        The name or the number of a label. For a GIFTI file also a value, where NaN is ``"nan"``;
        None for all values but 0 and NaN. A FreeSurfer label has no name.
    outside
        Return the faces whose corners are all outside of the label, in place of those inside. So
        the label may be the cortex, where paths are to stay.

    Returns
    -------
    (N,) int64
        Ids of faces, in order.

    Raises
    ------
    InvalidMesh
        The mesh cannot be used.
    InvalidArgument
        The file cannot be read, is not a label file, has no such label, has it at no vertex, or
        belongs to another surface.
    MissingExtra
        GIFTI needs nibabel, the extra ``brain``.

    Warns
    -----
    EmptyBarrier
        The label has vertices, but no whole face.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> import tempfile
    >>> mesh = gc.samples.plane(8)
    >>> with tempfile.NamedTemporaryFile("w", suffix=".label") as file:
    ...     _ = file.write("#!ascii label\n3\n0 0 0 0 0\n1 0.5 0 0 0\n4 0.5 0.5 0 0\n")
    ...     file.flush()
    ...     gc.load_label(file.name, mesh)
    array([0])
    """
    surface = as_mesh(mesh)
    chosen = _vertices_of(Path(source), surface, label, outside)
    faces = np.flatnonzero(chosen[surface.faces].all(axis=1))
    if len(faces) == 0:
        where = "outside of the label" if outside else "in the label"
        message = (
            f"{source}: {np.count_nonzero(chosen)} vertices are {where}, but no face has all of "
            "its corners there: as a barrier it blocks nothing"
        )
        warnings.warn(message, EmptyBarrier, stacklevel=2)
    return faces


def load_label_vertices(
    source: str | Path, mesh: MeshLike, label: _Label = None, *, outside: bool = False
) -> Longs:
    r"""Return the vertices in a label: sources, to measure distances from a region.

    Parameters
    ----------
    source, mesh, label
        As for `load_label`.
    outside
        Return the vertices outside of the label, in place of those inside.

    Returns
    -------
    (N,) int64
        Vertex indices of the mesh, in order.

    Raises
    ------
    InvalidMesh, InvalidArgument, MissingExtra
        As for `load_label`.

    Notes
    -----
    O(V).

    Examples
    --------
    >>> import tempfile
    >>> mesh = gc.samples.plane(8)
    >>> with tempfile.NamedTemporaryFile("w", suffix=".label") as file:
    ...     _ = file.write("#!ascii label\n3\n0 0 0 0 0\n3 0 0.5 0 0\n6 0 1 0 0\n")
    ...     file.flush()
    ...     left = gc.load_label_vertices(file.name, mesh)
    >>> gc.exact_distance(mesh, left).distances.tolist()
    [0.0, 0.5, 1.0, 0.0, 0.5, 1.0, 0.0, 0.5, 1.0]
    """
    return np.flatnonzero(_vertices_of(Path(source), as_mesh(mesh), label, outside))


def _vertices_of(path: Path, mesh: TriangleMesh, label: _Label, outside: bool) -> NDArray[np.bool_]:
    """Return which vertices of a mesh are in the label of a file, or outside; at least one is."""
    count = len(mesh.vertices if mesh.vertex_map is None else mesh.vertex_map)
    try:
        file = read_unpacked(path, _READERS, None, Control())
    except InvalidMesh as error:
        raise InvalidArgument(str(error)) from error
    if file.suffix not in _READERS:
        raise InvalidArgument(
            f"{path} is not a label file: its name must end in .label, .annot or .gii, or in one "
            "of these and .gz"
        )
    try:
        inside = _inside(file.data, file.suffix, count, label)
    except InvalidArgument as error:
        error.args = (f"{path} is not a label of this surface: {error}",)
        raise
    except GeodesicError:
        raise
    except Exception as error:  # any failure of a parser
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidArgument(f"{path} is damaged: {what}") from error
    if outside and inside.all():
        raise InvalidArgument(f"no vertex is outside of the label of {path}: all are in it")
    chosen: NDArray[np.bool_] = inside != outside
    if mesh.vertex_map is not None:
        merged = np.zeros(len(mesh.vertices), bool)
        merged[mesh.vertex_map[chosen]] = True
        chosen = merged
    return chosen


def _inside(data: bytes, kind: str, count: int, label: _Label) -> NDArray[np.bool_]:
    """Return which of ``count`` vertices are in a label; at least one is."""
    inside: NDArray[np.bool_] = _READERS[kind](data, count, label)
    if not inside.any():
        named = "is in it" if label is None else f"has the label {label!r}"
        raise NoSuchLabel(f"no vertex {named}")
    return inside


def _freesurfer(data: bytes, count: int, label: _Label) -> NDArray[np.bool_]:
    """Return which vertices a label lists, which has no name."""
    if label is not None:
        raise InvalidArgument("a .label file has one label without a name; leave the label out")
    return read_label(data, count)


def read_label(data: bytes, count: int) -> NDArray[np.bool_]:
    """Return which vertices a label lists: a comment, their number, and a line for each."""
    _, declared, *lines = data.decode("utf-8", "replace").splitlines()
    vertices = np.array([int(line.split()[0]) for line in lines if line.strip()], np.int64)
    if len(vertices) != int(declared):
        raise InvalidArgument(f"it declares {declared} vertices and lists {len(vertices)}")
    check_vertices(vertices, count)
    inside = np.zeros(count, bool)
    inside[vertices] = True
    return inside


def write_label(path: Path, vertices: Longs, positions: Floats) -> None:
    """Write a label of FreeSurfer: vertices, their positions as float32, and 0 as their values."""
    rows = np.column_stack([vertices, positions[vertices], np.zeros(len(vertices))])
    head = f"#!ascii label\n{len(rows)}"
    np.savetxt(path, rows, "%d %.9g %.9g %.9g %g", header=head, comments="")


def _annotation(data: bytes, count: int, label: _Label) -> NDArray[np.bool_]:
    """Return which vertices have a label of an annotation."""
    codes, table = read_annotation(data, count)
    names = [name for name, _ in table.values()]
    if label is None:
        raise InvalidArgument(f"it has several labels; name one: {_known(names)}")
    wanted = [code for name, code in table.values() if name == label]
    if not wanted:
        number = _number(label, names)
        if number not in table:
            raise _unknown(label, names)
        wanted = [table[int(number)][1]]
    return np.isin(codes, wanted)


def _gifti(data: bytes, count: int, label: _Label) -> NDArray[np.bool_]:
    """Return which vertices have a label, in the first array of a file."""
    with extra("brain", "nibabel", "load_label of a GIFTI file"):
        from nibabel.gifti.gifti import GiftiImage

    image: Any = GiftiImage.from_bytes(data)
    if not image.darrays:
        raise InvalidArgument("it holds no array")
    values = np.asarray(image.darrays[0].data)
    if values.shape != (count,):
        message = f"its values have shape {values.shape}, for {count} vertices"
        raise OtherSurface(message, len(values), count)
    if label is None:
        return np.asarray((values != 0) & ~np.isnan(values))
    names = image.labeltable.get_labels_as_dict()
    wanted = [key for key, name in names.items() if name == label]
    if wanted:
        return np.isin(values, wanted)
    number = _number(label, names.values())
    return np.isnan(values) if np.isnan(number) else np.asarray(values == number)


def _known(names: Iterable[str]) -> str:
    return f"its labels are {', '.join(map(repr, names)) or 'none'}"


def _unknown(label: _Label, names: Iterable[str]) -> NoSuchLabel:
    return NoSuchLabel(f"it has no label {label!r}; {_known(names)}")


def _number(label: str | float, names: Iterable[str]) -> float:
    """Return the number that a label is where it is none of the names."""
    try:
        return float(label)
    except ValueError:
        raise _unknown(label, names) from None


_READERS = {"label": _freesurfer, "annot": _annotation, "gii": _gifti}

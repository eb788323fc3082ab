"""Labels of brain surfaces, such as the medial wall: files that name vertices of a surface."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.errors import GeodesicError, InvalidArgument
from geodesic_core.extras import extra
from geodesic_core.io.as_mesh import MeshLike, as_mesh


def load_label(source: str | Path, mesh: MeshLike, label: str | float | None = None) -> Longs:
    r"""Return the faces whose corners all lie in a label: barriers, where it is the medial wall.

    Parameters
    ----------
    source
        The path of a FreeSurfer label (``.label``), which lists vertices, or of a GIFTI file
        (``.label.gii``, ``.shape.gii``, ``.func.gii``), which has a value for each vertex.
    mesh
        The surface: a `TriangleMesh`, or anything else that `as_mesh` takes.
    label
        For a GIFTI file: the name or the number of a label, or a value. None for all values other
        than 0.

    Returns
    -------
    (N,) int64
        Ids of faces, in order.

    Raises
    ------
    InvalidMesh
        The mesh cannot be used.
    InvalidArgument
        The file cannot be read, is not a label file, has no such label, or belongs to another
        surface.
    MissingExtra
        GIFTI needs nibabel, the extra ``brain``.

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
    path = Path(source)
    if path.suffix not in _READERS:
        raise InvalidArgument(f"{path} is not a label file: its name must end in .label or .gii")
    mesh = as_mesh(mesh)
    count = len(mesh.vertices if mesh.vertex_map is None else mesh.vertex_map)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"cannot read {path}: {error.strerror}") from error
    try:
        inside = _READERS[path.suffix](data, count, label)
    except InvalidArgument as error:
        raise InvalidArgument(f"{path} is not a label of this surface: {error}") from None
    except GeodesicError:
        raise
    except Exception as error:  # any failure of a parser
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidArgument(f"{path} is damaged: {what}") from error
    if mesh.vertex_map is not None:
        merged = np.zeros(len(mesh.vertices), bool)
        merged[mesh.vertex_map[inside]] = True
        inside = merged
    return np.flatnonzero(inside[mesh.faces].all(axis=1))


def _freesurfer(data: bytes, count: int, label: str | float | None) -> NDArray[np.bool_]:
    """Return which vertices a label lists: a comment, their number, and a line for each."""
    if label is not None:
        raise InvalidArgument("a .label file has one label without a name; leave the label out")
    _, declared, *lines = data.decode("utf-8").splitlines()
    vertices = np.array([int(line.split()[0]) for line in lines if line.strip()], np.int64)
    if len(vertices) != int(declared):
        raise InvalidArgument(f"it declares {declared} vertices and lists {len(vertices)}")
    if len(vertices) and not 0 <= vertices.min() <= vertices.max() < count:
        wrong = vertices[(vertices < 0) | (vertices >= count)][0]
        raise InvalidArgument(f"it lists vertex {wrong}, but the mesh has {count}")
    inside = np.zeros(count, bool)
    inside[vertices] = True
    return inside


def _gifti(data: bytes, count: int, label: str | float | None) -> NDArray[np.bool_]:
    """Return which vertices have a label, in the first array of a file."""
    with extra("brain", "nibabel", "load_label of a GIFTI file"):
        from nibabel.gifti.gifti import GiftiImage

    image: Any = GiftiImage.from_bytes(data)
    if not image.darrays:
        raise InvalidArgument("it holds no array")
    values = np.asarray(image.darrays[0].data)
    if values.shape != (count,):
        raise InvalidArgument(f"its values have shape {values.shape}, for {count} vertices")
    if label is None:
        return np.asarray(values != 0)
    names = {name: key for key, name in image.labeltable.get_labels_as_dict().items()}
    try:
        wanted = names[label] if label in names else float(label)
    except ValueError:
        known = ", ".join(map(repr, names)) or "none"
        raise InvalidArgument(f"it has no label {label!r}; its labels are {known}") from None
    return np.asarray(values == wanted)


_READERS = {".label": _freesurfer, ".gii": _gifti}

"""VTK's files, legacy and XML, read by meshio."""

from tempfile import NamedTemporaryFile

import numpy as np

from geodesic_core.errors import InvalidMesh
from geodesic_core.extras import extra
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.limits import check_face_count

_POLYGONS = ("triangle", "quad", "polygon")


def read_vtk(data: bytes, max_faces: int | None) -> FileContents:
    """Read a legacy VTK file; see `read_vtu`."""
    return _read(data, "vtk", max_faces)


def read_vtu(data: bytes, max_faces: int | None) -> FileContents:
    """Read the polygons of an XML file of an unstructured grid.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    MissingExtra
        meshio is not installed.
    """
    return _read(data, "vtu", max_faces)


def _read(data: bytes, kind: str, max_faces: int | None) -> FileContents:
    with extra("vtk", "meshio", f"load_mesh of a {kind.upper()} file"):
        import meshio

    with NamedTemporaryFile(suffix=f".{kind}") as file:  # meshio reads XML from paths only
        file.write(data)
        file.flush()
        mesh = getattr(meshio, kind).read(file.name)
    polygons = [block.data for block in mesh.cells if block.type.startswith(_POLYGONS)]
    ignored: dict[str, int] = {}
    for block in mesh.cells:
        if not block.type.startswith(_POLYGONS):
            ignored[f"{block.type} cells"] = ignored.get(f"{block.type} cells", 0) + len(block.data)
    if not polygons:
        raise InvalidMesh(f"the {kind.upper()} file holds no polygons", kind="face")
    sizes = np.concatenate([np.full(len(rows), np.shape(rows)[1]) for rows in polygons])
    check_face_count(int((sizes - 2).sum()), max_faces)
    corners = np.concatenate([np.asarray(rows, np.int64).reshape(-1) for rows in polygons])
    return FileContents(
        np.ascontiguousarray(mesh.points, np.float64),
        corners,
        sizes.astype(np.int64),
        note_on_ignored(kind.upper(), ignored),
    )

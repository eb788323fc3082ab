"""Fields that `DistanceField.save` stored."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

from pathlib import Path

import numpy as np

from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.distance_field import DistanceField
from geodesic_core.fields.field_file import SHOWN, read_field_file, refused_if_damaged
from geodesic_core.io.as_mesh import MeshLike, as_mesh


def load_field(path: str | Path, mesh: MeshLike) -> DistanceField:
    """Return the field that `DistanceField.save` wrote.

    Its answers are the same to the bit. Checksums find damage; that nobody has forged the file is
    taken on trust.

    Parameters
    ----------
    path
        The file.
    mesh
        The surface that the field was found on, as `as_mesh` takes it, without the barriers of the
        call: the file has those.

    Returns
    -------
    DistanceField
        Distances, (V,) float64 in mesh units, and all that the field retained.

    Raises
    ------
    InvalidMesh
        The mesh cannot be used.
    InvalidArgument
        The file cannot be read, holds a field of another mesh, or was written by another version of
        this library.

    Notes
    -----
    O(bytes of the file), and of the mesh for its digest.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> file = Path(mkdtemp()) / "field.npz"
    >>> mesh = gc.samples.plane(2)
    >>> gc.exact_distance(mesh, 0).save(file)
    >>> gc.load_field(file, mesh).path_to(3).points.tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    """
    blocked, arrays, shown = read_field_file(path, as_mesh(mesh))
    with refused_if_damaged(path):
        field = DistanceField.from_arrays(blocked, arrays)
    for name, array in shown.items():
        if not np.array_equal(array, getattr(field, name) if name in SHOWN else ()):
            raise InvalidArgument(
                f"{path} holds other {name!r} than the field that was saved into it: load_field "
                "reads only files as DistanceField.save writes them"
            )
    return field

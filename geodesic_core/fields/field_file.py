"""Files of distance fields: arrays in numpy's format npz, bound to their mesh.

A file holds, each in a member of its own:

- ``distances`` and ``nearest_source``, in the order of the mesh's vertices, for any reader;
- ``barriers``, the blocked faces;
- ``mesh``, the SHA-256 of the mesh's vertices and faces;
- ``kernels``, the digest of the code that wrote the file;
- ``sweep.…``, the arrays of `DistanceField.arrays`, whose layout belongs to that code.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import GeodesicError, InvalidArgument
from geodesic_core.files import as_output, written
from geodesic_core.kernels.jit.cache import sources_digest
from geodesic_core.mesh.triangle_mesh import TriangleMesh

_SWEEP = "sweep."
_BINDING = {"barriers", "mesh", "kernels"}

SHOWN = ("distances", "nearest_source")
"""Attributes of a field that any reader of its file is shown"""


def write_field_file(
    path: str | Path,
    mesh: TriangleMesh,
    shown: Mapping[str, NDArray[Any]],
    arrays: Mapping[str, NDArray[Any]],
) -> None:
    """Write the arrays of a field, and those that any reader is shown.

    Raises
    ------
    InvalidArgument
        The path does not end in ``.npz``, or cannot be written.
    """
    with written(as_output(path, ".npz")) as file:
        np.savez(
            file,
            allow_pickle=False,
            **shown,
            barriers=mesh.barriers,
            mesh=np.array(_digest_of(mesh)),
            kernels=np.array(sources_digest()),
            **{_SWEEP + name: array for name, array in arrays.items()},
        )


def read_field_file(
    path: str | Path, mesh: TriangleMesh
) -> tuple[TriangleMesh, dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return the mesh of a field, with its barriers; the arrays of the field; and those shown.

    Raises
    ------
    InvalidArgument
        The file cannot be read, is of another mesh, or was written by another version.
    """
    members = _members_of(path)
    if str(members["mesh"]) != _digest_of(mesh):
        raise InvalidArgument(
            f"{path} holds a field of another mesh: give the mesh that it was computed on, with "
            "the same vertices and faces in the same order"
        )
    if str(members["kernels"]) != sources_digest():
        raise InvalidArgument(
            f"{path} was written by another version of this library: compute the field again. Its "
            "distances can still be read with numpy.load(path)['distances']"
        )
    blocked = mesh.with_barriers(members["barriers"])
    if not np.array_equal(blocked.barriers, members["barriers"]):
        raise InvalidArgument(
            f"{path} holds a field with other barriers than the mesh: give the mesh without "
            "barriers"
        )
    arrays = {
        name.removeprefix(_SWEEP): members.pop(name)
        for name in list(members)
        if name.startswith(_SWEEP)
    }
    return blocked, arrays, {name: members[name] for name in members.keys() - _BINDING}


@contextmanager
def refused_if_damaged(path: str | Path) -> Iterator[None]:
    """Turn any failure to read a field's file into a refusal of the file.

    Raises
    ------
    InvalidArgument
        Something failed.
    """
    try:
        yield
    except GeodesicError:
        raise
    except OSError as error:
        raise InvalidArgument(f"cannot read {path}: {error.strerror}") from error
    except Exception as error:  # readers of zip files and of arrays raise all kinds
        raise InvalidArgument(
            f"{path} is damaged, or was not written by DistanceField.save"
        ) from error


def _members_of(path: str | Path) -> dict[str, NDArray[Any]]:
    with (
        refused_if_damaged(path),
        Path(path).open("rb") as stream,
        np.load(stream, allow_pickle=False) as file,
    ):
        members = dict(file)
    if not members.keys() >= _BINDING:
        raise InvalidArgument(f"{path} was not written by DistanceField.save")
    return members


def _digest_of(mesh: TriangleMesh) -> str:
    digest = sha256(f"{len(mesh.vertices)} {len(mesh.faces)} ".encode())
    for array in mesh.defining_arrays:
        digest.update(array.data)
    return digest.hexdigest()

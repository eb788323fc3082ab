"""Meshes on disk: a folder for each, named by a hash of its content and read by memory mapping.

::

    meshes/{id}/manifest.json      report, warnings, owner, and the checksum of each array
    meshes/{id}/{array}.npy        one file for each array of ``TriangleMesh.arrays()``

The id is a hash of the canonical arrays (vertices, faces, both maps), not of the uploaded bytes. So
the same mesh as PLY, as JSON or as a sample is one entry with one set of results. A later reader
that gets other arrays from the same file gets another id, so that no stored result is ever taken
for that of another mesh.
"""

import hashlib
import os
import re
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from app.errors import ProblemError, problem
from app.store.layout import MESHES
from geodesic_core import Solver, TriangleMesh

PUBLIC_ARRAYS = {
    "vertices": "vertices",
    "faces": "faces",
    "vertex_map": "vertex_map",
    "face_map": "face_map",
    "components": "component",
}
"""Names of the arrays that clients may read, and the names ``TriangleMesh.arrays`` gives them"""

_ID_BYTES = 16
_ID = re.compile(f"[0-9a-f]{{{2 * _ID_BYTES}}}")
_DEFINING_ARRAYS = ("vertices", "faces", "vertex_map", "face_map")


@dataclass(frozen=True)
class OpenMesh:
    """A mesh over memory-mapped arrays, its solver, and the warnings of its reader."""

    name: tuple[str, bytes]
    """Mesh id, and barriers as bytes"""
    solver: Solver
    warnings: Sequence[str]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "OpenMesh":
        """Return a mesh in memory, under the id that it would have in the store."""
        return cls((content_hash(mesh.arrays()), b""), Solver(mesh), mesh.warnings)

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh itself."""
        return self.solver.mesh

    def with_barriers(self, faces: NDArray[np.int64]) -> "OpenMesh":
        """Return the mesh with some faces blocked; see `TriangleMesh.with_barriers`."""
        name = self.name[0], faces.tobytes()
        return OpenMesh(name, Solver(self.mesh.with_barriers(faces)), self.warnings)

    @property
    def nbytes(self) -> int:
        """Bytes of the mesh and of its solver's caches, which grow as paths are found."""
        return self.mesh.nbytes + self.solver.nbytes


@dataclass(frozen=True)
class WrittenMesh:
    """A mesh in a scratch folder, or one that is in the store already."""

    manifest: Mapping[str, Any]
    folder: Path | None
    """The scratch folder; None for a mesh that is in the store already"""
    size: int = 0
    """Bytes on disk"""

    @property
    def mesh_id(self) -> str:
        """The hash of its content."""
        return str(self.manifest["id"])


class MeshStore:
    """The meshes under ``root``; any number of processes may read, and write to scratch folders."""

    def __init__(self, root: Path) -> None:
        self.folder = root / MESHES

    def write_aside(self, mesh: TriangleMesh, folder: Path, owner: str | None) -> WrittenMesh:
        """Write ``mesh`` into a new scratch ``folder``, unless it is in the store.

        A mesh in the store belongs to the ``owner`` that stored it first.
        """
        arrays = mesh.arrays()
        mesh_id = content_hash(arrays)
        if (self.folder / mesh_id).is_dir():
            return WrittenMesh(self.manifest(mesh_id), folder=None)
        manifest = {
            "id": mesh_id,
            "owner": owner,
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "report": mesh.report.as_dict(),
            "warnings": list(mesh.warnings),
            "crc32": {name: _checksum(array) for name, array in arrays.items()},
        }
        folder.mkdir()
        for name, array in arrays.items():
            _write_array(folder / f"{name}.npy", array)
        (folder / "manifest.json").write_bytes(orjson.dumps(manifest))
        return WrittenMesh(manifest, folder, _bytes_in(folder))

    def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh; its arrays are not opened."""
        path = f"{self._path(mesh_id)}/manifest.json"
        try:
            changed = os.stat(path).st_mtime_ns  # noqa: PTH116 - see _path
            manifest = _read_manifest(path, changed)
            is_its_own = manifest["id"] == mesh_id
        except (OSError, ValueError, TypeError, KeyError) as error:
            self._folder(mesh_id)  # raises where there is no such mesh
            raise _damaged(mesh_id, "its manifest cannot be read") from error
        if not is_its_own:
            raise _damaged(mesh_id, "its manifest is that of another mesh")
        return manifest

    def owner(self, mesh_id: str) -> str | None:
        """Return the owner of a mesh; None where it has none, or its manifest cannot be read."""
        try:
            owner: str | None = self.manifest(mesh_id).get("owner")
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            return None
        return owner

    def open(self, mesh_id: str) -> OpenMesh:
        """Return a mesh over memory-mapped arrays, after a check of their checksums."""
        manifest = self.manifest(mesh_id)
        arrays = {name: self._array(mesh_id, name) for name in manifest["crc32"]}
        solver = Solver(TriangleMesh.from_arrays(arrays))
        return OpenMesh((mesh_id, b""), solver, manifest["warnings"])

    def damage(self, mesh_id: str) -> Iterator[ProblemError]:
        """Yield each damage of a mesh; raises ``ProblemError`` where there is no such mesh."""
        try:
            names = self.manifest(mesh_id)["crc32"]
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            yield error
            return
        arrays = {}
        for name in names:
            try:
                arrays[name] = self._array(mesh_id, name)
            except ProblemError as error:
                yield error
        if len(arrays) == len(names) and content_hash(arrays) != mesh_id:
            yield _damaged(mesh_id, "its name is not that of its content")

    def _array(self, mesh_id: str, name: str) -> NDArray[Any]:
        try:
            array = _open_array(self._folder(mesh_id) / f"{name}.npy")
        except (OSError, ValueError) as error:
            raise _damaged(mesh_id, f"its array {name} cannot be read") from error
        if _checksum(array) != self.manifest(mesh_id)["crc32"][name]:
            raise _damaged(mesh_id, f"its array {name} is not what was written")
        return array

    def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read."""
        folder = self._folder(mesh_id)
        if name not in PUBLIC_ARRAYS:
            raise problem(
                "not_found", f"there is no array {name!r}, but {', '.join(PUBLIC_ARRAYS)}"
            )
        path = folder / f"{PUBLIC_ARRAYS[name]}.npy"
        if not path.is_file():
            # TriangleMesh has no map where it is the identity.
            unchanged = "vertices" if name == "vertex_map" else "faces"
            detail = f"the mesh has no {name}: it keeps the {unchanged} of its file"
            raise problem("not_found", detail)
        return path

    def page(self, after: str, limit: int) -> tuple[list[str], bool]:
        """Return the next ``limit`` ids after ``after``, in order, and whether more follow."""
        ids = sorted(entry.name for entry in self.folder.iterdir())
        first = bisect_right(ids, after)
        return ids[first : first + limit], len(ids) > first + limit

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each mesh on disk, the least recently used first."""
        folders = [entry for entry in self.folder.glob("*") if entry.is_dir()]
        folders.sort(key=lambda folder: folder.stat().st_mtime_ns)
        return {folder.name: _bytes_in(folder) for folder in folders}

    def last_used(self, mesh_id: str) -> datetime:
        """Return the time of a mesh's last use."""
        return datetime.fromtimestamp(self._folder(mesh_id).stat().st_mtime, UTC)

    def note_use(self, mesh_id: str) -> None:
        """Record a use of a mesh as the time of its folder, which a restart reads."""
        try:
            os.utime(self._path(mesh_id))
        except FileNotFoundError:
            raise mesh_not_found(mesh_id) from None

    def _folder(self, mesh_id: str) -> Path:
        folder = Path(self._path(mesh_id))
        if not folder.is_dir():
            raise mesh_not_found(mesh_id)
        return folder

    def _path(self, mesh_id: str) -> str:
        """Return the path of a mesh, as text: each request needs it, and a `Path` is slow."""
        if not _ID.fullmatch(mesh_id):
            raise mesh_not_found(mesh_id)
        return f"{self.folder}/{mesh_id}"


@lru_cache(maxsize=256)
def _read_manifest(path: str, _changed: int) -> Mapping[str, Any]:
    manifest: dict[str, Any] = orjson.loads(Path(path).read_bytes())
    return manifest


def content_hash(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the id of a mesh with these arrays."""
    digest = hashlib.blake2b(digest_size=_ID_BYTES)
    for name in _DEFINING_ARRAYS:
        if name in arrays:
            array = np.ascontiguousarray(arrays[name])
            digest.update(f"{name}{array.dtype.str}{array.shape}".encode())
            digest.update(array.data.cast("B") if array.size else b"")
    return digest.hexdigest()


def _checksum(array: NDArray[Any]) -> int:
    return zlib.crc32(np.ascontiguousarray(array).data) if array.size else 0


def _write_array(path: Path, array: NDArray[Any]) -> None:
    # Like np.save, whose OSError does not tell that the disk is full.
    array = np.ascontiguousarray(array)
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(array))
        file.write(array.data)


def _bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir())


def _open_array(path: Path) -> NDArray[Any]:
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped.view(np.ndarray)


def mesh_not_found(mesh_id: str) -> ProblemError:
    """Return the error for a mesh that is not in the store."""
    return problem("mesh_not_found", f"there is no mesh {mesh_id!r}")


def _damaged(mesh_id: str, reason: str) -> ProblemError:
    hint = "delete the mesh and upload it again"
    return problem("mesh_damaged", f"mesh {mesh_id} is damaged: {reason}", hint=hint)

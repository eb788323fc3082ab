"""Meshes on disk: one folder each, named by its content, read by memory mapping.

::

    meshes/{id}/manifest.json      report, warnings, owner, and the checksum of each array
    meshes/{id}/{array}.npy        one file per array of ``TriangleMesh.arrays()``

The id is a hash over the canonical arrays (vertices, faces, both maps), not over the bytes of the
upload: the same mesh as PLY, as JSON or as a sample is one entry with one set of results; and a
later reader that gets other arrays out of the same file also gets another id, so that no kept
result can be taken for one of another mesh.
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
"""The names under which clients read arrays, and those that ``TriangleMesh.arrays`` gives them."""

_ID_BYTES = 16
_ID = re.compile(f"[0-9a-f]{{{2 * _ID_BYTES}}}")
_DEFINING_ARRAYS = ("vertices", "faces", "vertex_map", "face_map")


@dataclass(frozen=True)
class OpenMesh:
    """A mesh over memory-mapped arrays, its solver, and what its reader said of the file."""

    name: tuple[str, bytes]
    """Its id, and its barriers"""
    solver: Solver
    warnings: Sequence[str]

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh itself."""
        return self.solver.mesh

    def with_barriers(self, faces: NDArray[np.int64]) -> "OpenMesh":
        """Return the same with some faces blocked; see `TriangleMesh.with_barriers`."""
        name = self.name[0], faces.tobytes()
        return OpenMesh(name, Solver(self.mesh.with_barriers(faces)), self.warnings)

    @property
    def nbytes(self) -> int:
        """Size of the mesh, and of what its solver keeps; that grows while paths are asked for."""
        return self.mesh.nbytes + self.solver.nbytes


@dataclass(frozen=True)
class WrittenMesh:
    """A mesh that has been written aside, or was found to be in the store already."""

    manifest: Mapping[str, Any]
    folder: Path | None
    """Where it waits to be moved in; None where it was in the store"""
    size: int = 0
    """In bytes, on disk"""

    @property
    def mesh_id(self) -> str:
        """The hash of its content."""
        return str(self.manifest["id"])


class MeshStore:
    """The meshes under ``root``; any number of processes may read, and write aside."""

    def __init__(self, root: Path) -> None:
        self.folder = root / MESHES

    def write_aside(self, mesh: TriangleMesh, folder: Path, owner: str | None) -> WrittenMesh:
        """Write ``mesh`` into a new ``folder``, unless it is stored.

        A mesh that is stored stays ``owner``'s who stored it first.
        """
        arrays = mesh.arrays()
        mesh_id = _content_hash(arrays)
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
        """Return what is known of a mesh without opening its arrays."""
        path = f"{self._path(mesh_id)}/manifest.json"
        try:
            changed = os.stat(path).st_mtime_ns  # noqa: PTH116 - see _path
            manifest = _read_manifest(path, changed)
            is_its_own = manifest["id"] == mesh_id
        except (OSError, ValueError, TypeError, KeyError) as error:
            self._folder(mesh_id)  # refuses a mesh that is not there at all
            raise _damaged(mesh_id, "its manifest cannot be read") from error
        if not is_its_own:
            raise _damaged(mesh_id, "its manifest is that of another mesh")
        return manifest

    def owner(self, mesh_id: str) -> str | None:
        """Return who stored a mesh, where that was with a key and its manifest can be read."""
        try:
            owner: str | None = self.manifest(mesh_id).get("owner")
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            return None
        return owner

    def open(self, mesh_id: str) -> OpenMesh:
        """Return the mesh over memory-mapped arrays, once their checksums are found right."""
        manifest = self.manifest(mesh_id)
        arrays = {name: self._array(mesh_id, name) for name in manifest["crc32"]}
        solver = Solver(TriangleMesh.from_arrays(arrays))
        return OpenMesh((mesh_id, b""), solver, manifest["warnings"])

    def damage(self, mesh_id: str) -> Iterator[ProblemError]:
        """Yield all that is damaged of a mesh; raises ``ProblemError`` where there is none such."""
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
        if len(arrays) == len(names) and _content_hash(arrays) != mesh_id:
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
            kept = "vertices" if name == "vertex_map" else "faces"
            raise problem("not_found", f"the mesh has no {name}: it keeps the {kept} of its file")
        return path

    def page(self, after: str, limit: int) -> tuple[list[str], bool]:
        """Return the ``limit`` ids that follow ``after``, in order, and whether there are more."""
        ids = sorted(entry.name for entry in self.folder.iterdir())
        first = bisect_right(ids, after)
        return ids[first : first + limit], len(ids) > first + limit

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each mesh on disk, those that were used least recently first."""
        folders = [entry for entry in self.folder.glob("*") if entry.is_dir()]
        folders.sort(key=lambda folder: folder.stat().st_mtime_ns)
        return {folder.name: _bytes_in(folder) for folder in folders}

    def last_used(self, mesh_id: str) -> datetime:
        """Return when a mesh was used last."""
        return datetime.fromtimestamp(self._folder(mesh_id).stat().st_mtime, UTC)

    def note_use(self, mesh_id: str) -> None:
        """Note that a mesh is used now, where a restart finds it: the time of its folder."""
        try:
            os.utime(self._path(mesh_id))
        except FileNotFoundError:
            raise unknown(mesh_id) from None

    def _folder(self, mesh_id: str) -> Path:
        folder = Path(self._path(mesh_id))
        if not folder.is_dir():
            raise unknown(mesh_id)
        return folder

    def _path(self, mesh_id: str) -> str:
        """Return where a mesh would be: as text, for each request asks, and a `Path` takes long."""
        if not _ID.fullmatch(mesh_id):
            raise unknown(mesh_id)
        return f"{self.folder}/{mesh_id}"


@lru_cache(maxsize=256)
def _read_manifest(path: str, _changed: int) -> Mapping[str, Any]:
    manifest: dict[str, Any] = orjson.loads(Path(path).read_bytes())
    return manifest


def _content_hash(arrays: Mapping[str, NDArray[Any]]) -> str:
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
    # As np.save does, which on a full disk raises an OSError that does not tell why.
    array = np.ascontiguousarray(array)
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(array))
        file.write(array.data)


def _bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir())


def _open_array(path: Path) -> NDArray[Any]:
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped.view(np.ndarray)


def unknown(mesh_id: str) -> ProblemError:
    """Return the refusal of a mesh that is not there."""
    return problem("mesh_not_found", f"there is no mesh {mesh_id!r}")


def _damaged(mesh_id: str, reason: str) -> ProblemError:
    hint = "delete the mesh and upload it again"
    return problem("mesh_damaged", f"mesh {mesh_id} is damaged: {reason}", hint=hint)

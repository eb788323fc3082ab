"""Meshes on disk: one folder each, named by its content, read by memory mapping.

::

    store/
        meshes/{id}/manifest.json      report, warnings, owner, and the checksum of each array
        meshes/{id}/{array}.npy        one file per array of ``TriangleMesh.arrays()``
        results/                       see ``result_store``
        tmp/                           what is being written; swept when the service starts

The id is a hash over the canonical arrays (vertices, faces, both maps), not over the bytes of the
upload: the same mesh as PLY, as JSON or as a sample is one entry with one set of results; and a
later reader that gets other arrays out of the same file also gets another id, so that no kept
result can be taken for one of another mesh.
"""

import hashlib
import shutil
import tempfile
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from app.errors import ProblemError, refuse
from geodesic_core import Solver, TriangleMesh

VERSION = 4
PUBLIC_ARRAYS = {
    "vertices": "vertices",
    "faces": "faces",
    "vertex_map": "vertex_map",
    "face_map": "face_map",
    "components": "component",
}
"""The names under which clients read arrays, and those that ``TriangleMesh.arrays`` gives them."""

_ID_BYTES = 16
_DEFINING_ARRAYS = ("vertices", "faces", "vertex_map", "face_map")


@dataclass(frozen=True)
class OpenMesh:
    """A mesh over memory-mapped arrays, its solver, and what its reader said of the file."""

    solver: Solver
    warnings: Sequence[str]

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh itself."""
        return self.solver.mesh

    def with_barriers(self, faces: NDArray[np.int64]) -> "OpenMesh":
        """Return the same with some faces blocked; see `TriangleMesh.with_barriers`."""
        return OpenMesh(Solver(self.mesh.with_barriers(faces)), self.warnings)

    @property
    def nbytes(self) -> int:
        """Size of the mesh, and of what its solver keeps; that grows while paths are asked for."""
        return self.mesh.nbytes + self.solver.nbytes


class MeshStore:
    """The meshes in the folder ``root``; any number of processes may read and add."""

    def __init__(self, root: Path) -> None:
        self._meshes = root / "meshes"
        self._temporary = root / "tmp"

    def prepare(self) -> None:
        """Create the folders, and sweep what a former service left half-written."""
        shutil.rmtree(self._temporary, ignore_errors=True)
        self._meshes.mkdir(parents=True, exist_ok=True)
        self._temporary.mkdir(parents=True)

    @contextmanager
    def scratch_file(self) -> Iterator[Path]:
        """Lend a path on the store's disk, for an upload; the file is gone afterwards."""
        with tempfile.TemporaryDirectory(dir=self._temporary) as folder:
            yield Path(folder) / "upload"

    def add(self, mesh: TriangleMesh, owner: str | None = None) -> tuple[str, bool]:
        """Store ``mesh``; return its id, and whether it was not there before.

        A mesh that was there stays ``owner``'s who stored it first.
        """
        arrays = mesh.arrays()
        mesh_id = _content_hash(arrays)
        target = self._meshes / mesh_id
        if target.exists():
            return mesh_id, False
        with tempfile.TemporaryDirectory(dir=self._temporary) as folder:
            written = Path(folder) / mesh_id
            written.mkdir()
            checksums = {name: _write_array(written, name, arrays[name]) for name in arrays}
            manifest = {
                "version": VERSION,
                "id": mesh_id,
                "owner": owner,
                "created": datetime.now(UTC).isoformat(timespec="seconds"),
                "report": mesh.report.as_dict(),
                "warnings": mesh.warnings,
                "crc32": checksums,
            }
            (written / "manifest.json").write_bytes(orjson.dumps(manifest))
            return mesh_id, _rename_unless_there(written, target)

    def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return what is known of a mesh without opening its arrays."""
        path = self._folder(mesh_id) / "manifest.json"
        try:
            manifest = _read_manifest(path, path.stat().st_mtime_ns)
            version = manifest["version"]
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise _damaged(mesh_id, "its manifest cannot be read") from error
        if version != VERSION:
            raise _damaged(mesh_id, f"it has layout {version}, and this service reads {VERSION}")
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
        manifest, folder = self.manifest(mesh_id), self._folder(mesh_id)
        arrays = {}
        for name, checksum in manifest["crc32"].items():
            try:
                arrays[name] = _open_array(folder / f"{name}.npy")
            except (OSError, ValueError) as error:
                raise _damaged(mesh_id, f"its array {name} cannot be read") from error
            if _checksum(arrays[name]) != checksum:
                raise _damaged(mesh_id, f"its array {name} is not what was written")
        return OpenMesh(Solver(TriangleMesh.from_arrays(arrays)), manifest["warnings"])

    def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read."""
        folder = self._folder(mesh_id)
        if name not in PUBLIC_ARRAYS:
            raise refuse("not_found", f"there is no array {name!r}, but {', '.join(PUBLIC_ARRAYS)}")
        path = folder / f"{PUBLIC_ARRAYS[name]}.npy"
        if not path.is_file():
            # TriangleMesh has no map where it is the identity.
            kept = "vertices" if name == "vertex_map" else "faces"
            raise refuse("not_found", f"the mesh has no {name}: it keeps the {kept} of its file")
        return path

    def page(self, after: str, limit: int) -> tuple[list[str], bool]:
        """Return the ``limit`` ids that follow ``after``, in order, and whether there are more."""
        ids = sorted(entry.name for entry in self._meshes.iterdir())
        first = bisect_right(ids, after)
        return ids[first : first + limit], len(ids) > first + limit

    def usage(self) -> tuple[int, int]:
        """Return how many meshes there are, and their size in bytes."""
        sizes = [file.stat().st_size for file in self._meshes.glob("*/*")]
        return len(list(self._meshes.iterdir())), sum(sizes)

    def delete(self, mesh_id: str) -> None:
        """Remove a mesh at once; processes that have it open keep what they mapped."""
        folder = self._folder(mesh_id)
        with tempfile.TemporaryDirectory(dir=self._temporary) as trash:
            try:
                folder.rename(Path(trash) / mesh_id)
            except FileNotFoundError as error:
                raise _unknown(mesh_id) from error

    def _folder(self, mesh_id: str) -> Path:
        is_id = len(mesh_id) == 2 * _ID_BYTES and set(mesh_id) <= set("0123456789abcdef")
        folder = self._meshes / mesh_id
        if not is_id or not folder.is_dir():
            raise _unknown(mesh_id)
        return folder


@lru_cache(maxsize=256)
def _read_manifest(path: Path, _changed: int) -> Mapping[str, Any]:
    manifest: dict[str, Any] = orjson.loads(path.read_bytes())
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


def _write_array(folder: Path, name: str, array: NDArray[Any]) -> int:
    np.save(folder / f"{name}.npy", array, allow_pickle=False)
    return _checksum(array)


def _open_array(path: Path) -> NDArray[Any]:
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped.view(np.ndarray)


def _rename_unless_there(written: Path, target: Path) -> bool:
    try:
        written.rename(target)
    except OSError:
        if not target.is_dir():
            raise
        return False  # another process stored the same mesh meanwhile
    return True


def _unknown(mesh_id: str) -> ProblemError:
    return refuse("mesh_not_found", f"there is no mesh {mesh_id!r}")


def _damaged(mesh_id: str, reason: str) -> ProblemError:
    hint = "delete the mesh and upload it again"
    return refuse("mesh_damaged", f"mesh {mesh_id} is damaged: {reason}", hint=hint)

"""Meshes on disk: a folder for each, named by a hash of its content and read by memory mapping.

::

    meshes/{id}/manifest.json      report, warnings, owner, name, and the checksum of each array
    meshes/{id}/{array}.npy        one file for each array of ``TriangleMesh.arrays()``

The id is a hash of the canonical arrays (vertices, faces, both maps), not of the uploaded bytes. So
the same mesh as PLY, as JSON or as a sample is one entry with one set of results. A later reader
that gets other arrays from the same file gets another id, so that no stored result is ever taken
for that of another mesh.

No file is changed once it is written. One that is damaged is noticed before it is sent or mapped,
and before the next use where it is mapped already. Writing the mesh again replaces it.
"""

import hashlib
import os
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.errors import ProblemError, problem
from app.store.last_use import note_use, order_of_use
from app.store.layout import MESHES
from app.store.manifests import MANIFEST, encode_manifest, manifest_of, read_manifest
from app.store.verified import FileVersion, changed_files, checksum_of, read_checksum, version_of
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
    files: Mapping[str, FileVersion | None] = field(default_factory=dict)
    """Versions of the mapped files, by path; none for a mesh in memory"""

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
        return OpenMesh(name, Solver(self.mesh.with_barriers(faces)), self.warnings, self.files)

    @property
    def nbytes(self) -> int:
        """Bytes of the mesh and of its solver's caches, which grow as paths are found."""
        return self.mesh.nbytes + self.solver.nbytes


@dataclass(frozen=True)
class WrittenMesh:
    """A mesh in a scratch folder, or one that is intact in the store already."""

    manifest: Mapping[str, Any]
    folder: Path | None
    """The scratch folder; None for a mesh that is intact in the store already"""
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

    def write_aside(
        self,
        mesh: TriangleMesh,
        folder: Path,
        owner: str | None,
        name: str | None = None,
        check: Callable[[], None] = lambda: None,
    ) -> WrittenMesh:
        """Write ``mesh`` into a new scratch ``folder``, unless it is intact in the store.

        A mesh in the store belongs to the ``owner`` that stored it first, and keeps the ``name``
        that it got then, as far as its manifest still tells. Before each array ``check`` is called;
        it may raise.
        """
        arrays = mesh.arrays()
        mesh_id = content_hash(arrays)
        with suppress(ProblemError):  # removed since it was read
            if self.is_intact(mesh_id):
                return WrittenMesh(self.manifest(mesh_id), folder=None)
        folder.mkdir()
        checksums = {}
        for array_name, array in arrays.items():
            check()
            checksums[array_name] = _write_array(folder / f"{array_name}.npy", array)
        manifest = {
            "id": mesh_id,
            "owner": owner,
            "name": name,
            "created": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "report": mesh.report.as_dict(),
            "warnings": list(mesh.warnings),
            "crc32": checksums,
        }
        with suppress(ProblemError):  # there is no such mesh, or its manifest is damaged
            stored = self.manifest(mesh_id)
            manifest |= {key: stored.get(key) for key in ("owner", "name", "created")}
        (folder / MANIFEST).write_bytes(encode_manifest(manifest))
        return WrittenMesh(manifest, folder, _bytes_in(folder))

    def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh; its arrays are not read."""
        return self._manifest(mesh_id, manifest_of)

    def _manifest(
        self, mesh_id: str, read: Callable[[str], Mapping[str, Any]]
    ) -> Mapping[str, Any]:
        try:
            manifest = read(f"{self._path(mesh_id)}/{MANIFEST}")
        except (OSError, ValueError) as error:
            self._folder(mesh_id)  # raises where there is no such mesh
            raise mesh_damaged(mesh_id, "its manifest has changed since it was written") from error
        if manifest["id"] != mesh_id:
            raise mesh_damaged(mesh_id, "its manifest belongs to another mesh")
        return manifest

    def owner(self, mesh_id: str) -> str | None:
        """Return the owner of a mesh; None where it has none, or its manifest is damaged."""
        try:
            owner: str | None = self.manifest(mesh_id)["owner"]
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            return None
        return owner

    def open(self, mesh_id: str) -> OpenMesh:
        """Return a mesh over memory-mapped arrays, whose files are verified first."""
        manifest, folder = self.manifest(mesh_id), self._path(mesh_id)
        names = manifest["crc32"]
        files = {path: version_of(path) for path in (f"{folder}/{name}.npy" for name in names)}
        arrays = {name: _open_array(self._verified(mesh_id, name)) for name in names}
        solver = Solver(TriangleMesh.from_arrays(arrays))
        return OpenMesh((mesh_id, b""), solver, manifest["warnings"], files)

    def is_current(self, opened: OpenMesh) -> bool:
        """Tell whether the files of an open mesh are still those that were verified."""
        return not changed_files(opened.files)

    def verify_mapped(self, opened: OpenMesh) -> None:
        """Raise ``ProblemError`` where a mapped array of an open mesh is damaged by now.

        A file that was replaced or removed is still mapped as it was.
        """
        for path in changed_files(opened.files):
            version, now = opened.files[path], version_of(path)
            if now and version and now.inode == version.inode:
                self._verified(opened.name[0], Path(path).stem)

    def inspect(self, mesh_id: str) -> Iterator[ProblemError | None]:
        """Read each file of a mesh as it is now, and yield its damage; None where it is intact.

        Ends early where the mesh is removed meanwhile. Raises ``ProblemError`` where there is no
        such mesh.
        """
        with _watched(self._folder(mesh_id)) as was_removed:
            for error in self._findings(mesh_id):
                if error is not None and was_removed():
                    return
                yield error

    def _findings(self, mesh_id: str) -> Iterator[ProblemError | None]:
        """Yield what `inspect` does; files that were removed count as damaged."""
        try:
            checksums = self._manifest(mesh_id, read_manifest)["crc32"]
        except ProblemError as error:
            if error.problem.code != "mesh_damaged":
                raise
            yield error
            return
        folder, is_intact = self._path(mesh_id), True
        for name, checksum in checksums.items():
            if read_checksum(f"{folder}/{name}.npy") == checksum:
                yield None
            else:
                is_intact = False
                yield mesh_damaged(mesh_id, f"its array {name} has changed since it was written")
        if not is_intact:
            return
        try:
            arrays = {name: _open_array(Path(folder) / f"{name}.npy") for name in checksums}
        except FileNotFoundError:
            yield mesh_damaged(mesh_id, "an array is missing")
            return
        is_named = content_hash(arrays) == mesh_id
        yield None if is_named else mesh_damaged(mesh_id, "its id does not match its content")

    def is_intact(self, mesh_id: str) -> bool:
        """Read the files of a mesh; tell whether it is in the store and all are as written."""
        try:
            return (self.folder / mesh_id).is_dir() and not any(self.inspect(mesh_id))
        except ProblemError:  # deleted meanwhile
            return False

    def distrust(self, mesh_id: str) -> None:
        """Have each process verify the files of a mesh again before it uses them.

        Meant for damage that changed no file's status, as a disk may do it.
        """
        with suppress(FileNotFoundError):  # deleted meanwhile
            for path in Path(self._path(mesh_id)).iterdir():
                os.utime(path)

    def _verified(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array; raise where it is not what was written."""
        path = self._folder(mesh_id) / f"{name}.npy"
        if checksum_of(str(path)) != self.manifest(mesh_id)["crc32"][name]:
            raise mesh_damaged(mesh_id, f"its array {name} has changed since it was written")
        return path

    def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read, after verifying it."""
        self._folder(mesh_id)  # raises where there is no such mesh
        if name not in PUBLIC_ARRAYS:
            raise problem(
                "not_found",
                f"there is no array {name!r}; the arrays are {', '.join(PUBLIC_ARRAYS)}",
            )
        if PUBLIC_ARRAYS[name] not in self.manifest(mesh_id)["crc32"]:
            # TriangleMesh has no map where it is the identity.
            unchanged = "vertices" if name == "vertex_map" else "faces"
            detail = f"the mesh has no {name}: it keeps the {unchanged} of its file"
            raise problem("not_found", detail)
        return self._verified(mesh_id, PUBLIC_ARRAYS[name])

    def ids(self) -> list[str]:
        """Return the ids of all meshes."""
        return [entry.name for entry in self.folder.iterdir()]

    def manifests(self, ids: Iterable[str]) -> list[Mapping[str, Any]]:
        """Return the manifests of meshes, in their order, without those that cannot be read."""
        found = []
        for mesh_id in ids:
            with suppress(ProblemError):
                found.append(self.manifest(mesh_id))
        return found

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each mesh on disk, the least recently used first."""
        found = []
        for folder in self.folder.glob("*"):
            with suppress(FileNotFoundError, NotADirectoryError):  # removed meanwhile, or no mesh
                found.append((order_of_use(folder.stat()), folder.name, _bytes_in(folder)))
        return {name: size for _, name, size in sorted(found)}

    def size(self, mesh_id: str) -> int | None:
        """Return the bytes of a mesh on disk; None where it is not there."""
        folder = Path(self._path(mesh_id))
        return _bytes_in(folder) if folder.is_dir() else None

    def last_used(self, mesh_id: str) -> datetime:
        """Return the time of a mesh's last use."""
        return datetime.fromtimestamp(self._folder(mesh_id).stat().st_mtime, UTC)

    def note_use(self, mesh_id: str) -> None:
        """Record a use of a mesh as the time of its folder, which a restart reads."""
        try:
            note_use(self._path(mesh_id))
        except FileNotFoundError:
            raise mesh_not_found(mesh_id) from None

    def _folder(self, mesh_id: str) -> Path:
        folder = Path(self._path(mesh_id))
        if not folder.is_dir():
            raise mesh_not_found(mesh_id)
        return folder

    def _path(self, mesh_id: str) -> str:
        """Return the path of a mesh, as text: each request needs it, and a `Path` is slow."""
        require_id(mesh_id)
        return f"{self.folder}/{mesh_id}"


def require_id(mesh_id: str) -> None:
    """Raise where no mesh can have this id."""
    if not _ID.fullmatch(mesh_id):
        raise mesh_not_found(mesh_id)


def content_hash(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the id of a mesh with these arrays."""
    digest = hashlib.blake2b(digest_size=_ID_BYTES)
    for name in _DEFINING_ARRAYS:
        if name in arrays:
            array = np.ascontiguousarray(arrays[name])
            digest.update(f"{name}{array.dtype.str}{array.shape}".encode())
            digest.update(array.data.cast("B") if array.size else b"")
    return digest.hexdigest()


@contextmanager
def _watched(folder: Path) -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether ``folder`` was removed, even if there is a new one."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except FileNotFoundError:
        raise mesh_not_found(folder.name) from None
    # While it is open, no new folder gets its inode.
    watched = os.fstat(descriptor)

    def was_removed() -> bool:
        try:
            return not os.path.samestat(watched, folder.stat())
        except FileNotFoundError:
            return True

    try:
        yield was_removed
    finally:
        os.close(descriptor)


def _write_array(path: Path, array: NDArray[Any]) -> int:
    """Write an array as `numpy.save` does, and return the CRC-32 of the file."""
    # The OSError of np.save does not tell that the disk is full.
    array = np.ascontiguousarray(array)
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, np.lib.format.header_data_from_array_1_0(array))
    checksum = 0
    with path.open("wb") as file:
        for part in (header.getvalue(), array.data.cast("B") if array.size else b""):
            file.write(part)
            checksum = zlib.crc32(part, checksum)
    return checksum


def _bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir())


def _open_array(path: Path) -> NDArray[Any]:
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped.view(np.ndarray)


def mesh_not_found(mesh_id: str) -> ProblemError:
    """Return the error for a mesh that is not in the store."""
    return problem("mesh_not_found", f"there is no mesh {mesh_id!r}")


def mesh_damaged(mesh_id: str, reason: str) -> ProblemError:
    """Return the error for a mesh whose files are not what was written."""
    hint = "upload it again: that replaces the damaged files"
    return problem("mesh_damaged", f"mesh {mesh_id} is damaged: {reason}", hint=hint)

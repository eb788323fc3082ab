"""Meshes on disk: a folder for each, named by a hash of its content and read by memory mapping.

::

    meshes/{id}/manifest.json      report, warnings, name, and the checksum of each array
    meshes/{id}/{array}.npy        one file for each array of ``TriangleMesh.arrays()``, and of
                                   ``CUT_ARRAYS`` where the mesh was cut from another one

The id is a hash of the canonical arrays (vertices, faces, both maps), not of the uploaded bytes. So
the same mesh as PLY, as JSON or as a sample is one entry with one set of results. That of a cut
mesh is a hash of what it was cut from, too. A later reader that gets other arrays from the same
file gets another id, so that no stored result is ever taken for that of another mesh.

No file is changed once it is written. A process verifies the files of a mesh when it opens it.
Writing a damaged mesh again replaces its files, and processes that have it open open it anew.
"""

import errno
import hashlib
import os
import re
import shutil
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import orjson
from numpy.typing import NDArray

from app.errors import ProblemError, problem
from app.store.atomic import sync, sync_all
from app.store.folder import checksum_of
from app.store.layout import MESHES, TEMPORARY
from geodesic_core import Solver, TriangleMesh

MANIFEST = "manifest.json"
_CHECKSUM = "checksum"

FileVersion = tuple[int, int]
"""Inode, and time of the last change in ns"""

CUT_ARRAYS = (
    "face_of",
    "location_faces",
    "location_weights",
    "curve_edges",
    "edge_curves",
    "copy_of",
    "parts",
)
"""Arrays of a cut mesh that lead back to the mesh it was cut from, as `CutMesh` names them"""

PUBLIC_ARRAYS = {
    "vertices": "vertices",
    "faces": "faces",
    "lengths": "lengths",
    "vertex_map": "vertex_map",
    "face_map": "face_map",
    "components": "component",
    **{name: name for name in CUT_ARRAYS},
}
"""Names of the arrays that clients may read, and the names ``TriangleMesh.arrays`` gives them"""

_ID_BYTES = 16
_ID = re.compile(f"[0-9a-f]{{{2 * _ID_BYTES}}}")
_DEFINING_ARRAYS = ("vertices", "faces", "vertex_map", "face_map", "lengths", *CUT_ARRAYS)


@dataclass(frozen=True)
class CutFrom:
    """The mesh that another was cut from, and the ``CUT_ARRAYS`` that lead back to it."""

    mesh_id: str
    arrays: Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class OpenMesh:
    """A mesh over memory-mapped arrays, its solver, and the warnings of its reader."""

    name: tuple[str, bytes]
    """Mesh id, and barriers as bytes"""
    solver: Solver
    warnings: Sequence[str]
    version: FileVersion | None = None
    """That of a file of the mesh; None for a mesh in memory"""

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
        return OpenMesh(name, Solver(self.mesh.with_barriers(faces)), self.warnings, self.version)

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
    """The meshes in the folder ``root``: the store itself, or copies of what is elsewhere.

    Any number of processes may read, and write to scratch folders.
    """

    def __init__(self, root: Path) -> None:
        self.folder = root / MESHES
        self._temporary = root / TEMPORARY

    def write_aside(
        self,
        mesh: TriangleMesh,
        folder: Path,
        name: str | None = None,
        check: Callable[[], None] = lambda: None,
        cut_from: CutFrom | None = None,
    ) -> WrittenMesh:
        """Write ``mesh`` into a new scratch ``folder``, unless it is intact in the store.

        The files survive a power cut. A mesh in the store keeps the ``name`` that it got first, as
        far as its manifest still tells. Before each array ``check`` is called; it may raise.
        """
        arrays, origin = mesh.arrays(), ""
        if cut_from is not None:
            arrays, origin = {**arrays, **cut_from.arrays}, cut_from.mesh_id
        mesh_id = content_hash(arrays, origin)
        stored: Mapping[str, Any] = {}
        with suppress(ProblemError):  # there is no such mesh, or its manifest is damaged
            stored = self.manifest(mesh_id)
            if not any(self.inspect(mesh_id)):
                return WrittenMesh(stored, folder=None)
        folder.mkdir()
        with ThreadPoolExecutor(1) as beside:  # the report of a large mesh takes as long
            writing = beside.submit(_write_arrays, folder, arrays, check)
            report, warnings = mesh.report.as_dict(), list(mesh.warnings)
        manifest = {
            "id": mesh_id,
            "name": name,
            "created": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "report": report,
            "warnings": warnings,
            "crc32": writing.result(),
        }
        if origin:
            manifest["cut_from"] = origin
        if stored:
            manifest |= {key: stored.get(key) for key in ("name", "created")}
        (folder / MANIFEST).write_bytes(encode_manifest(manifest))
        sync(folder / MANIFEST)
        sync(folder)
        size = sum(path.stat().st_size for path in folder.iterdir())
        return WrittenMesh(manifest, folder, size)

    def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh; its arrays are not read."""
        require_id(mesh_id)
        try:
            return decode_manifest(mesh_id, (self.folder / mesh_id / MANIFEST).read_bytes())
        except FileNotFoundError:
            raise mesh_not_found(mesh_id) from None
        except OSError as error:
            raise mesh_damaged(mesh_id, f"its manifest cannot be read: {error}") from error

    def open(self, mesh_id: str) -> OpenMesh:
        """Return a mesh over memory-mapped arrays, whose files are verified first."""
        manifest, version = self.manifest(mesh_id), self._version(mesh_id)
        arrays = {}
        for name in manifest["crc32"]:
            if name in CUT_ARRAYS:  # for clients only
                continue
            self.verify(manifest, name)
            mapped = np.load(self.array_file(mesh_id, name), mmap_mode="r", allow_pickle=False)
            arrays[name] = mapped.view(np.ndarray)
        solver = Solver(TriangleMesh.from_arrays(arrays))
        return OpenMesh((mesh_id, b""), solver, manifest["warnings"], version)

    def is_current(self, opened: OpenMesh) -> bool:
        """Tell whether an open mesh is still that of the store: not removed, and not replaced."""
        return self._version(opened.name[0]) == opened.version

    def _version(self, mesh_id: str) -> FileVersion | None:
        """Return what changes with each upload; a use changes only the time of the manifest."""
        try:
            # Each query asks for it, and a `Path` is slow.
            status = os.stat(f"{self.folder}/{mesh_id}/vertices.npy")  # noqa: PTH116
        except FileNotFoundError:
            return None
        return status.st_ino, status.st_mtime_ns

    def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array."""
        return self.folder / mesh_id / f"{name}.npy"

    def verify(self, manifest: Mapping[str, Any], name: str) -> None:
        """Raise ``ProblemError`` where an array is not what was written."""
        mesh_id = manifest["id"]
        if checksum_of(self.array_file(mesh_id, name)) != manifest["crc32"][name]:
            self.manifest(mesh_id)  # raises where the mesh has been removed since
            raise mesh_damaged(mesh_id, f"its array {name} has changed since it was written")

    def inspect(self, mesh_id: str) -> Iterator[ProblemError]:
        """Read a mesh, and yield its damage; none of one that is removed meanwhile."""
        try:
            manifest = self.manifest(mesh_id)
        except ProblemError as error:
            if error.problem.code == "mesh_damaged":
                yield error
            return
        for name in manifest["crc32"]:
            try:
                self.verify(manifest, name)
            except ProblemError as error:
                if error.problem.code == "mesh_damaged":
                    yield error

    def ids(self) -> Collection[str]:
        """Return the ids of all meshes."""
        return [path.parent.name for path in self.folder.glob(f"*/{MANIFEST}")]

    def install(self, mesh_id: str, folder: Path) -> None:
        """Move the files of a mesh here: by one rename, or over those that are there.

        A rename keeps an upload cheap, and a crash leaves the mesh whole or not there. One that is
        damaged remains so until its manifest comes, which is the last.
        """
        place = self.folder / mesh_id
        self.folder.mkdir(exist_ok=True)
        try:
            folder.rename(place)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            for path in sorted(folder.iterdir(), key=lambda path: path.name == MANIFEST):
                path.replace(place / path.name)
        sync(place)
        sync(self.folder)

    def drop(self, mesh_id: str) -> None:
        """Remove the files of a mesh, if there are any; who has them open can go on reading."""
        gone = self._temporary / f"{uuid4().hex}.gone"
        try:
            (self.folder / mesh_id).rename(gone)
        except FileNotFoundError:
            return
        except OSError:  # the disk has no room for another name
            gone = self.folder / mesh_id
        shutil.rmtree(gone, ignore_errors=True)


def public_arrays(manifest: Mapping[str, Any]) -> Mapping[str, str]:
    """Return the arrays of a mesh that clients may read, and the names of their files.

    A mesh that is given by lengths alone has no vertices.
    """
    absent = ["vertices"] if manifest["report"]["bounds"] is None else []
    return {
        name: stored
        for name, stored in PUBLIC_ARRAYS.items()
        if stored in manifest["crc32"] and name not in absent
    }


def encode_manifest(manifest: Mapping[str, Any]) -> bytes:
    """Return a manifest as it is stored, with its checksum."""
    return orjson.dumps({**manifest, _CHECKSUM: _checksum(manifest)})


def decode_manifest(mesh_id: str, content: bytes) -> Mapping[str, Any]:
    """Return the manifest of a mesh; raises ``ProblemError`` where it is not what was written."""
    try:
        manifest: dict[str, Any] = orjson.loads(content)
        is_intact = manifest.pop(_CHECKSUM) == _checksum(manifest)
    except (ValueError, TypeError, AttributeError, KeyError):
        is_intact = False
    if not is_intact:
        raise mesh_damaged(mesh_id, "its manifest has changed since it was written")
    if manifest["id"] != mesh_id:
        raise mesh_damaged(mesh_id, "its manifest belongs to another mesh")
    return manifest


def _checksum(manifest: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(orjson.dumps(manifest, option=orjson.OPT_SORT_KEYS)):08x}"


def require_id(mesh_id: str) -> None:
    """Raise where no mesh can have this id."""
    if not _ID.fullmatch(mesh_id):
        raise mesh_not_found(mesh_id)


def content_hash(arrays: Mapping[str, NDArray[Any]], cut_from: str = "") -> str:
    """Return the id of a mesh with these arrays, which may have been cut from another mesh."""
    digest = hashlib.blake2b(cut_from.encode(), digest_size=_ID_BYTES)
    for name in _DEFINING_ARRAYS:
        if name in arrays:
            array = np.ascontiguousarray(arrays[name])
            digest.update(f"{name}{array.dtype.str}{array.shape}".encode())
            digest.update(array.data.cast("B") if array.size else b"")
    return digest.hexdigest()


def _write_arrays(
    folder: Path, arrays: Mapping[str, NDArray[Any]], check: Callable[[], None]
) -> dict[str, int]:
    """Write arrays to the disk, and return the CRC-32 of each file; ``check`` may stop it."""
    checksums = {}
    for name, array in arrays.items():
        check()
        checksums[name] = _write_array(folder / f"{name}.npy", array)
    sync_all(folder)
    return checksums


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


def mesh_not_found(mesh_id: str) -> ProblemError:
    """Return the error for a mesh that is not in the store."""
    return problem("mesh_not_found", f"there is no mesh {mesh_id!r}")


def mesh_damaged(mesh_id: str, reason: str) -> ProblemError:
    """Return the error for a mesh whose files are not what was written."""
    hint = "upload it again: that replaces the damaged files"
    return problem("mesh_damaged", f"mesh {mesh_id} is damaged: {reason}", hint=hint)

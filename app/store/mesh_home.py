"""The meshes of a store, as a service has them."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple, TypeVar

from anyio import CapacityLimiter, to_thread

from app.errors import ProblemError, problem
from app.store.layout import MESHES
from app.store.meshes import (
    CUT_ARRAYS,
    MANIFEST,
    PUBLIC_ARRAYS,
    MeshStore,
    WrittenMesh,
    decode_manifest,
    mesh_not_found,
    public_arrays,
    require_id,
)
from app.store.objects import ObjectInfo, Objects

T = TypeVar("T")

_CALLS = 32
"""Calls of the store at the same time; the threads of others stay free while it is away"""
_MOST_KNOWN = 1024
"""Manifests in memory"""


class MeshRecord(NamedTuple):
    """A mesh in the catalog."""

    size: int
    """Bytes of its files"""
    is_pinned: bool = False
    """Whether a service that shares the table needs it at the moment"""


@dataclass(frozen=True)
class Known:
    """A manifest in memory."""

    content: bytes
    manifest: Mapping[str, Any]
    until: float
    """Time until which it counts as that of the store, of `monotonic`"""
    verified: set[str] = field(default_factory=set)
    """Arrays that this process has read and found intact"""


class MeshHome:
    """The meshes in ``objects``, which workers map in ``local``: both are the same folder.

    A change of what is here is made by one catalog at a time.
    """

    trusted_s = 1.0
    """Seconds for which a manifest counts as that of the store, so that few requests ask for it"""

    def __init__(self, objects: Objects, local: MeshStore) -> None:
        self._objects = objects
        self._local = local
        self._known: dict[str, Known] = {}
        self._limiter = CapacityLimiter(_CALLS)

    def found(self) -> Mapping[str, MeshRecord]:
        """Return what is here, the least recently used first; remove what uploads left.

        It is for a start: later, other services may be writing what seems to be left.
        """
        return self._found(MESHES, True)

    async def record(self, mesh_id: str) -> MeshRecord | None:
        """Return the record of a mesh; None where it is not here."""
        found = await self._call(self._found, f"{MESHES}/{mesh_id}", False)
        return found.get(mesh_id)

    async def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh, as it was here less than a second ago.

        Raises ``ProblemError`` where there is none.
        """
        return (await self._current(mesh_id)).manifest

    async def ids(self) -> Collection[str]:
        """Return the ids of all meshes."""
        return await self._call(self._objects.folders, MESHES)

    async def manifests(self, ids: Iterable[str]) -> Sequence[Mapping[str, Any]]:
        """Return the manifests of meshes, in their order, without those that cannot be read."""
        return [each for each in await self._call(self._read_all, ids) if each is not None]

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read, which is verified once."""
        known = await self._current(mesh_id)
        stored = _stored_name(known.manifest, name)
        if stored not in known.verified:
            await self._call(self._local.verify, known.manifest, stored)
            known.verified.add(stored)
        return self._local.array_file(mesh_id, stored)

    async def is_intact(self, mesh_id: str) -> bool:
        """Read the files of a mesh; tell whether it is here and all are as written."""
        return await self._call(self._is_intact, mesh_id)

    async def put(self, written: WrittenMesh) -> None:
        """Put a mesh here, over the files of one that is damaged."""
        assert written.folder is not None, "there is something to put"  # noqa: S101
        await self._call(self._local.install, written.mesh_id, written.folder)
        self.distrust(written.mesh_id)

    async def discard(self, written: WrittenMesh) -> None:
        """Remove the files of a mesh that is not to be put here: with their scratch folder."""

    async def remove(self, mesh_id: str) -> None:
        """Remove a mesh, if it is here, the manifest first; who has it open can go on reading."""
        await self._call(self._remove, mesh_id)
        self.distrust(mesh_id)

    def distrust(self, mesh_id: str) -> None:
        """Have a mesh looked up, and its files verified, before it is used again."""
        self._known.pop(mesh_id, None)

    def note_use(self, mesh_id: str) -> None:
        """Record a use of a mesh, as far as the next start is to know it."""
        self._objects.note_use(manifest_name(mesh_id))

    async def _call(self, do: Callable[..., T], *arguments: Any) -> T:
        return await to_thread.run_sync(do, *arguments, limiter=self._limiter)

    async def _current(self, mesh_id: str) -> Known:
        require_id(mesh_id)
        known = self._known.get(mesh_id)
        if known is not None and monotonic() < known.until:
            return known
        until = monotonic() + self.trusted_s
        content = await self._call(self._objects.read, manifest_name(mesh_id))
        if content is None:
            self.distrust(mesh_id)
            raise mesh_not_found(mesh_id)
        if known is not None and known.content == content:
            now = Known(content, known.manifest, until, known.verified)
        else:
            now = Known(content, decode_manifest(mesh_id, content), until)
        self._known.pop(mesh_id, None)
        self._known[mesh_id] = now
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]
        return now

    def _found(self, folder: str, removes: bool) -> Mapping[str, MeshRecord]:
        objects = list(self._objects.found(folder))
        ids = [mesh_of(each) for each in objects if each.name.endswith(f"/{MANIFEST}")]
        manifests = dict(zip(ids, self._read_all(ids), strict=True))
        sizes: Counter[str] = Counter()
        for each in objects:
            mesh_id = mesh_of(each)
            if mesh_id in manifests and _is_named(each.name, manifests[mesh_id]):
                sizes[mesh_id] += each.size
            elif removes and each.is_abandoned:
                self._objects.remove(each.name)
        return {mesh_id: MeshRecord(sizes[mesh_id]) for mesh_id in manifests}

    def _read_all(self, ids: Iterable[str]) -> Sequence[Mapping[str, Any] | None]:
        with ThreadPoolExecutor(_CALLS) as pool:
            return list(pool.map(self._readable, ids))

    def _readable(self, mesh_id: str) -> Mapping[str, Any] | None:
        """Return the manifest of a mesh as it is now; None where it is missing or damaged."""
        content = self._objects.read(manifest_name(mesh_id))
        try:
            return None if content is None else decode_manifest(mesh_id, content)
        except ProblemError:
            return None

    def _is_intact(self, mesh_id: str) -> bool:
        manifest = self._readable(mesh_id)
        return manifest is not None and all(
            self._objects.checksum(array_name(manifest, name)) == checksum
            for name, checksum in manifest["crc32"].items()
        )

    def _remove(self, mesh_id: str) -> None:
        manifest = self._readable(mesh_id)
        self._objects.remove(manifest_name(mesh_id))
        if manifest is not None:
            self._remove_arrays(manifest)
        self._local.drop(mesh_id)

    def _remove_arrays(self, manifest: Mapping[str, Any]) -> None:
        self._objects.remove(*(array_name(manifest, name) for name in manifest["crc32"]))


def manifest_name(mesh_id: str) -> str:
    """Return the name of the manifest of a mesh."""
    return f"{MESHES}/{mesh_id}/{MANIFEST}"


def array_name(manifest: Mapping[str, Any], name: str) -> str:
    """Return the name of an array, which in an object store is in the place of its upload."""
    place = f"{manifest['place']}/" if "place" in manifest else ""
    return f"{MESHES}/{manifest['id']}/{place}{name}.npy"


def mesh_of(found: ObjectInfo) -> str:
    """Return the id of the mesh that an object belongs to."""
    return found.name.split("/")[1]


def _is_named(name: str, manifest: Mapping[str, Any] | None) -> bool:
    """Tell whether a manifest names an object; one that is damaged may name any."""
    return manifest is None or name in (
        manifest_name(manifest["id"]),
        *(array_name(manifest, array) for array in manifest["crc32"]),
    )


def _stored_name(manifest: Mapping[str, Any], name: str) -> str:
    """Return what ``TriangleMesh.arrays`` calls an array that clients may read."""
    if name not in PUBLIC_ARRAYS:
        detail = f"there is no array {name!r}; the arrays are {', '.join(PUBLIC_ARRAYS)}"
        raise problem("not_found", detail)
    stored = public_arrays(manifest).get(name)
    if stored is None:
        raise problem("not_found", f"the mesh has no {name}: {_ABSENT[name]}")
    return stored


_ABSENT = {
    "vertices": "it is given by the lengths of its edges",
    "lengths": "they are the distances of its vertices",
    "vertex_map": "it keeps the vertices of its file",  # TriangleMesh has no map that moves nothing
    "face_map": "it keeps the faces of its file",
    **dict.fromkeys(CUT_ARRAYS, "it was not cut from another one"),
}
"""Why a mesh has no array of a name"""

"""The meshes of an object store, and the copies of them that this machine has.

A worker maps files. So a mesh is pulled into the folder of this machine before it is used, once
however many ask, and verified on its way. Copies are bounded: those used least recently go, but
none in use. The manifest in the store tells whether a copy is still that mesh.
"""

import asyncio
import shutil
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import Any, NamedTuple
from uuid import uuid4
from weakref import WeakValueDictionary

from anyio import CapacityLimiter, to_thread

from app.errors import ProblemError
from app.store.layout import MESHES, TEMPORARY
from app.store.manifests import MANIFEST, decode_manifest, encode_manifest
from app.store.mesh_home import MeshRecord
from app.store.meshes import (
    MeshStore,
    WrittenMesh,
    mesh_damaged,
    mesh_not_found,
    require_id,
)
from app.store.objects import UPLOADS, Objects

_AT_ONCE = 4
"""Arrays that travel at the same time"""
_CALLS = 32
"""Calls of the store at the same time; the threads of others stay free while it is away"""
_PLACE, _SIZE = "place", "bytes"
"""What a manifest has besides: the folder of the arrays, and their size"""


class _Known(NamedTuple):
    content: bytes
    manifest: Mapping[str, Any]
    until: float


class ObjectMeshes:
    """The meshes in ``objects``, see ``MeshHome``, with copies of ``capacity`` bytes in a folder.

    The folder belongs to this process.
    """

    trusted_s = 1.0
    """Seconds for which a manifest counts as that of the store, so that few requests ask for it"""

    def __init__(self, objects: Objects, folder: Path, capacity: int) -> None:
        self._objects = objects
        self._copies = MeshStore(folder)
        self._temporary = folder / TEMPORARY
        self._capacity = capacity
        self._known: dict[str, _Known] = {}
        self._pulls: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        """Each lives as long as a pull holds it or waits for it"""
        self._pins: Counter[str] = Counter()
        self._limiter = CapacityLimiter(_CALLS)
        self._installing = Lock()  # a cancelled pull goes on in its thread

    def prepare(self) -> None:
        """Make the folders of this machine."""
        self._copies.folder.mkdir(parents=True, exist_ok=True)
        self._temporary.mkdir(exist_ok=True)

    def found(self) -> Mapping[str, MeshRecord]:
        """Return the meshes, the oldest first, and remove what uploads left, files included."""
        objects = list(self._objects.found(MESHES))
        ids = [each.name.split("/")[1] for each in objects if each.name.endswith(f"/{MANIFEST}")]
        with ThreadPoolExecutor(_CALLS) as pool:
            manifests = dict(zip(ids, pool.map(self._readable, ids), strict=True))
        kept = {
            f"{MESHES}/{mesh_id}/{manifest[_PLACE]}"
            for mesh_id, manifest in manifests.items()
            if manifest is not None
        }
        for each in (*objects, *self._objects.found(UPLOADS)):
            folder, _, file = each.name.rpartition("/")
            if each.is_old and file != MANIFEST and folder not in kept:
                self._objects.remove(each.name)
        return {mesh_id: _record(manifest) for mesh_id, manifest in manifests.items()}

    async def record(self, mesh_id: str) -> MeshRecord | None:
        """Ask for the manifest of a mesh; one that is damaged has no size."""
        content = await self._call(self._objects.read, _manifest_name(mesh_id))
        return None if content is None else _record(_decoded(content))

    async def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh, as it was in the store less than a second ago."""
        return (await self._current(mesh_id)).manifest

    async def ids(self) -> Collection[str]:
        """List the store."""
        ids: Collection[str] = await self._call(self._objects.folders, MESHES)
        return ids

    async def manifests(self, ids: Iterable[str]) -> Sequence[Mapping[str, Any]]:
        """Ask for the manifests, as many at a time as there are calls."""
        found = await asyncio.gather(*map(self.manifest, ids), return_exceptions=True)
        for error in found:
            if isinstance(error, BaseException) and not isinstance(error, ProblemError):
                raise error
        return [each for each in found if not isinstance(each, BaseException)]

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Pull the mesh, and return the file of the copy."""
        async with self.holding(mesh_id):
            return await to_thread.run_sync(self._copies.array_file, mesh_id, name)

    async def is_intact(self, mesh_id: str) -> bool:
        """Read a mesh in the store."""
        is_intact: bool = await self._call(self._is_intact, mesh_id)
        return is_intact

    async def settle(self, written: WrittenMesh) -> None:
        """Do nothing: the arrays are in the store already, see `send`."""

    async def put(self, written: WrittenMesh, *, is_new: bool) -> None:
        """Write the manifest of a mesh whose arrays are in the store."""
        self._known.pop(written.mesh_id, None)
        await self._call(self._put, written, is_new)

    async def discard(self, written: WrittenMesh) -> None:
        """Remove the arrays of a mesh, which its manifest in the store does not name."""
        self._known.pop(written.mesh_id, None)
        await self._call(self._remove_arrays, _manifest_of(written))

    async def remove(self, mesh_id: str) -> None:
        """Remove a mesh: the manifest first."""
        self._known.pop(mesh_id, None)
        await self._call(self._remove, mesh_id)
        await self.distrust(mesh_id)

    async def distrust(self, mesh_id: str) -> None:
        """Drop the copy of a mesh, so that it is pulled again."""
        self._known.pop(mesh_id, None)
        await to_thread.run_sync(self._drop, mesh_id)

    def note_use(self, mesh_id: str) -> None:
        """Do nothing: the order of use is that of copies, and of a shared table."""

    @asynccontextmanager
    async def holding(self, mesh_id: str) -> AsyncIterator[None]:
        """Have a copy of a mesh in the folder, and keep it inside the block."""
        self._pins[mesh_id] += 1
        try:
            await self._pull(mesh_id)
            yield
        finally:
            self._pins[mesh_id] -= 1
            if not self._pins[mesh_id]:
                del self._pins[mesh_id]

    async def send(self, written: WrittenMesh) -> bool:
        """Write the arrays of a new mesh to the store; its files become the copy of this machine.

        False means that the mesh was not new for this machine, but is not intact in the store: it
        is to be written again.
        """
        if written.folder is not None:
            await self._call(self._send, written)
            return True
        if await self.is_intact(written.mesh_id):
            return True
        await self.distrust(written.mesh_id)
        return False

    async def _current(self, mesh_id: str) -> _Known:
        require_id(mesh_id)
        known = self._known.get(mesh_id)
        if known is not None and monotonic() < known.until:
            return known
        until = monotonic() + self.trusted_s
        content = await self._call(self._objects.read, _manifest_name(mesh_id))
        if content is None:
            await self.distrust(mesh_id)
            raise mesh_not_found(mesh_id)
        manifest = known.manifest if known and known.content == content else _decoded(content)
        if manifest is None:
            raise mesh_damaged(mesh_id, "its manifest has changed since it was written")
        self._known.pop(mesh_id, None)
        self._known[mesh_id] = _Known(content, manifest, until)
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]
        return self._known[mesh_id]

    async def _pull(self, mesh_id: str) -> None:
        lock = self._pulls.setdefault(mesh_id, asyncio.Lock())
        async with lock:
            known = await self._current(mesh_id)
            if await to_thread.run_sync(self._has_copy, mesh_id, known.content):
                return
            try:
                await self._call(self._fetch, mesh_id, known)
            except FileNotFoundError:
                self._known.pop(mesh_id, None)
                if (await self._current(mesh_id)).content == known.content:
                    raise mesh_damaged(mesh_id, "an array is missing") from None
                await self._call(self._fetch, mesh_id, await self._current(mesh_id))

    async def _call(self, do: Any, *arguments: Any) -> Any:
        return await to_thread.run_sync(do, *arguments, limiter=self._limiter)

    def _has_copy(self, mesh_id: str, content: bytes) -> bool:
        try:
            is_copy = (self._copies.folder / mesh_id / MANIFEST).read_bytes() == content
        except FileNotFoundError:
            return False
        if is_copy:
            with suppress(ProblemError):
                self._copies.note_use(mesh_id)
        return is_copy

    def _fetch(self, mesh_id: str, known: _Known) -> None:
        """Pull a mesh; raises ``FileNotFoundError`` where it was removed meanwhile."""
        with tempfile.TemporaryDirectory(dir=self._temporary) as scratch:
            folder = Path(scratch) / mesh_id
            folder.mkdir()

            def fetch(name: str) -> int:
                return self._objects.fetch(_array_name(known.manifest, name), folder / _file(name))

            expected = known.manifest["crc32"]
            with ThreadPoolExecutor(_AT_ONCE) as pool:
                checksums = dict(zip(expected, pool.map(fetch, expected), strict=True))
            for name, checksum in checksums.items():
                if checksum != expected[name]:
                    raise mesh_damaged(
                        mesh_id, f"its array {name} has changed since it was written"
                    )
            self._install(mesh_id, folder, known.content)

    def _install(self, mesh_id: str, folder: Path, content: bytes) -> None:
        """Make a folder of arrays the copy of a mesh, and remove copies beyond the bound."""
        (folder / MANIFEST).write_bytes(content)
        with self._installing:
            self._drop(mesh_id)
            folder.rename(self._copies.folder / mesh_id)
            sizes = self._copies.sizes()
            total = sum(sizes.values())
            for old, size in sizes.items():
                if total <= self._capacity:
                    return
                if old != mesh_id and old not in self._pins:
                    self._drop(old)
                    total -= size

    def _drop(self, mesh_id: str) -> None:
        gone = self._temporary / f"{uuid4().hex}.gone"
        with suppress(FileNotFoundError):
            (self._copies.folder / mesh_id).rename(gone)
            shutil.rmtree(gone, ignore_errors=True)

    def _send(self, written: WrittenMesh) -> None:
        manifest, folder = _manifest_of(written), written.folder
        assert folder is not None, "there is something to send"  # noqa: S101

        def send(name: str) -> None:
            self._objects.write(_array_name(manifest, name), folder / _file(name))

        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(send, manifest["crc32"]))
        self._install(written.mesh_id, folder, encode_manifest(manifest))

    def _put(self, written: WrittenMesh, is_new: bool) -> None:
        name, content = _manifest_name(written.mesh_id), encode_manifest(_manifest_of(written))
        if is_new and self._objects.create(name, content):
            return
        before = self._readable(written.mesh_id)
        self._objects.write(name, content)
        if before is not None:
            self._remove_arrays(before)

    def _remove(self, mesh_id: str) -> None:
        manifest = self._readable(mesh_id)
        self._objects.remove(_manifest_name(mesh_id))
        if manifest is not None:
            self._remove_arrays(manifest)

    def _remove_arrays(self, manifest: Mapping[str, Any]) -> None:
        self._objects.remove(*(_array_name(manifest, name) for name in manifest["crc32"]))

    def _is_intact(self, mesh_id: str) -> bool:
        manifest = self._readable(mesh_id)
        if manifest is None:
            return False

        def is_as_written(name: str) -> bool:
            checksum: int = manifest["crc32"][name]
            return self._objects.checksum(_array_name(manifest, name)) == checksum

        with ThreadPoolExecutor(_AT_ONCE) as pool:
            return all(pool.map(is_as_written, manifest["crc32"]))

    def _readable(self, mesh_id: str) -> Mapping[str, Any] | None:
        """Return the manifest of a mesh as it is now; None where it is missing or damaged."""
        content = self._objects.read(_manifest_name(mesh_id))
        return None if content is None else _decoded(content)


_MOST_KNOWN = 1024
"""Manifests in memory"""


def _manifest_of(written: WrittenMesh) -> Mapping[str, Any]:
    """Return the manifest of a new mesh with the place of its arrays, which no other upload has."""
    assert written.folder is not None, "it is new"  # noqa: S101
    place = f"{written.folder.parent.name}-{written.folder.name}"
    return {**written.manifest, _PLACE: place, _SIZE: written.size}


def _decoded(content: bytes) -> Mapping[str, Any] | None:
    try:
        return decode_manifest(content)
    except ValueError:
        return None


def _record(manifest: Mapping[str, Any] | None) -> MeshRecord:
    return MeshRecord(manifest[_SIZE], manifest["owner"]) if manifest else MeshRecord(0, None)


def _manifest_name(mesh_id: str) -> str:
    return f"{MESHES}/{mesh_id}/{MANIFEST}"


def _array_name(manifest: Mapping[str, Any], name: str) -> str:
    return f"{MESHES}/{manifest['id']}/{manifest[_PLACE]}/{_file(name)}"


def _file(name: str) -> str:
    return f"{name}.npy"

"""The meshes of an object store, and the copies of them that this machine has.

A worker maps files. So a mesh is pulled into the folder of this machine before it is used, once
however many ask, and verified on its way. Copies are bounded: those used least recently go, but
none in use. The manifest in the store tells whether a copy is still that mesh.
"""

import asyncio
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

from anyio import to_thread

from app.errors import ProblemError
from app.store.bucket import Bucket
from app.store.folder import Folder
from app.store.layout import MESHES, TEMPORARY
from app.store.mesh_home import Known, MeshHome, array_name, manifest_name
from app.store.meshes import (
    MANIFEST,
    MeshStore,
    WrittenMesh,
    decode_manifest,
    encode_manifest,
    mesh_damaged,
)

_AT_ONCE = 4
"""Arrays that travel at the same time"""


class CopiedMeshes(MeshHome):
    """The meshes in ``objects``, with copies of ``capacity`` bytes in a folder of this process."""

    _objects: Bucket

    def __init__(self, objects: Bucket, folder: Path, capacity: int) -> None:
        super().__init__(objects, MeshStore(folder))
        self._copies = Folder(folder)
        self._temporary = folder / TEMPORARY
        self._capacity = capacity
        self._pulls: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        """Each lives as long as a pull holds it or waits for it"""
        self._pins: Counter[str] = Counter()
        self._installing = Lock()  # a cancelled pull goes on in its thread

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Pull the mesh, and return the file of the copy."""
        async with self.holding(mesh_id):
            return await super().array_file(mesh_id, name)

    async def put(self, written: WrittenMesh) -> None:
        """Write the manifest of a mesh whose arrays are in the store, see `send`."""
        await self._call(self._put, _placed(written))
        self.distrust(written.mesh_id)

    async def discard(self, written: WrittenMesh) -> None:
        """Remove the arrays of a mesh, which its manifest in the store does not name."""
        await self._call(self._remove_arrays, _placed(written))
        self.distrust(written.mesh_id)

    @asynccontextmanager
    async def holding(self, mesh_id: str) -> AsyncIterator[None]:
        """Have a copy of a mesh in the folder, and keep it inside the block."""
        self._pins[mesh_id] += 1
        try:
            async with self._pulls.setdefault(mesh_id, asyncio.Lock()):
                try:
                    await self._pull(mesh_id)
                except ProblemError:  # it is gone, or damaged
                    await self.drop_copy(mesh_id)
                    raise
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
            await self._call(self._send, _placed(written), written.folder)
            return True
        if await self.is_intact(written.mesh_id):
            return True
        await self.drop_copy(written.mesh_id)
        return False

    async def drop_copy(self, mesh_id: str) -> None:
        """Have a mesh pulled again before it is used."""
        self.distrust(mesh_id)
        await to_thread.run_sync(self._local.drop, mesh_id)

    async def _pull(self, mesh_id: str) -> None:
        known = await self._current(mesh_id)
        if await to_thread.run_sync(self._has_copy, mesh_id, known):
            return
        try:
            await self._call(self._fetch, known)
        except FileNotFoundError:
            self.distrust(mesh_id)
            now = await self._current(mesh_id)
            if now.content == known.content:
                raise mesh_damaged(mesh_id, "an array is missing") from None
            await self._call(self._fetch, now)

    def _has_copy(self, mesh_id: str, known: Known) -> bool:
        name = manifest_name(mesh_id)
        is_copy = self._copies.read(name) == known.content
        if is_copy:
            self._copies.note_use(name)
        return is_copy

    def _fetch(self, known: Known) -> None:
        """Pull a mesh; raises ``FileNotFoundError`` where it was removed meanwhile."""
        manifest = known.manifest
        with tempfile.TemporaryDirectory(dir=self._temporary) as scratch:

            def fetch(name: str) -> int:
                return self._objects.fetch(array_name(manifest, name), Path(scratch, f"{name}.npy"))

            expected = manifest["crc32"]
            with ThreadPoolExecutor(_AT_ONCE) as pool:
                checksums = dict(zip(expected, pool.map(fetch, expected), strict=True))
            for name, checksum in checksums.items():
                if checksum != expected[name]:
                    detail = f"its array {name} has changed since it was written"
                    raise mesh_damaged(manifest["id"], detail)
            self._install(manifest["id"], Path(scratch), known.content)

    def _install(self, mesh_id: str, folder: Path, content: bytes) -> None:
        """Make the arrays in a folder the copy of a mesh, and remove copies beyond the bound."""
        (folder / MANIFEST).write_bytes(content)
        with self._installing:
            self._local.install(mesh_id, folder)
            copies, total = list(self._copies.found(MESHES)), Counter[str]()
            for each in copies:
                total[each.name.split("/")[1]] += each.size
            for each in copies:
                old = each.name.split("/")[1]
                if total.total() <= self._capacity:
                    return
                if each.name == manifest_name(old) and old != mesh_id and old not in self._pins:
                    self._local.drop(old)
                    del total[old]

    def _send(self, manifest: Mapping[str, Any], folder: Path) -> None:
        def send(name: str) -> None:
            self._objects.write(array_name(manifest, name), folder / f"{name}.npy")

        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(send, manifest["crc32"]))
        self._install(manifest["id"], folder, encode_manifest(manifest))

    def _put(self, manifest: Mapping[str, Any]) -> None:
        mesh_id = manifest["id"]
        before = self._objects.replace(manifest_name(mesh_id), encode_manifest(manifest))
        if before is not None:
            with suppress(ProblemError):  # it is damaged
                self._remove_arrays(decode_manifest(mesh_id, before))


def _placed(written: WrittenMesh) -> Mapping[str, Any]:
    """Return the manifest of a new mesh with the place of its arrays, which no other upload has."""
    assert written.folder is not None, "it is new"  # noqa: S101
    place = f"{written.folder.parent.name}-{written.folder.name}"
    return {**written.manifest, "place": place, "bytes": written.size}

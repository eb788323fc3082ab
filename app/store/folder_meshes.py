"""The meshes of a folder: each comes and goes by one rename."""

import asyncio
import shutil
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from anyio import to_thread

from app.errors import ProblemError
from app.store.atomic import sync, sync_all
from app.store.layout import TEMPORARY
from app.store.manifests import MANIFEST
from app.store.mesh_home import MeshRecord
from app.store.meshes import MeshStore, WrittenMesh


class FolderMeshes:
    """The meshes in the store ``root``; see ``MeshHome``."""

    trusted_s = 0.0

    def __init__(self, root: Path) -> None:
        self._store = MeshStore(root)
        self._temporary = root / TEMPORARY

    def found(self) -> Mapping[str, MeshRecord]:
        """Measure the meshes."""
        self._store.folder.mkdir(exist_ok=True)
        return {
            mesh_id: MeshRecord(size, self._owner(mesh_id))
            for mesh_id, size in self._store.sizes().items()
        }

    async def record(self, mesh_id: str) -> MeshRecord | None:
        """Measure a mesh."""
        size = self._store.size(mesh_id)
        return None if size is None else MeshRecord(size, self._owner(mesh_id))

    async def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh, which is read once."""
        return self._store.manifest(mesh_id)

    async def ids(self) -> Collection[str]:
        """List the folder."""
        return await to_thread.run_sync(self._store.ids)

    async def manifests(self, ids: Iterable[str]) -> Sequence[Mapping[str, Any]]:
        """Read the manifests in a thread: there may be thousands."""
        return await to_thread.run_sync(self._store.manifests, ids)

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file itself."""
        return await to_thread.run_sync(self._store.array_file, mesh_id, name)

    async def is_intact(self, mesh_id: str) -> bool:
        """Read the files of a mesh."""
        return await asyncio.to_thread(self._store.is_intact, mesh_id)

    async def settle(self, written: WrittenMesh) -> None:
        """Flush the files to the disk."""
        if written.folder is not None:
            await asyncio.to_thread(sync_all, written.folder)

    async def put(self, written: WrittenMesh, *, is_new: bool) -> None:
        """Move the files in."""
        assert written.folder is not None, "there is something to put"  # noqa: S101
        place = self._store.folder / written.mesh_id
        if is_new:
            written.folder.rename(place)
        else:
            _replace_files(place, written.folder)
        await asyncio.to_thread(sync, self._store.folder if is_new else place)

    async def discard(self, written: WrittenMesh) -> None:
        """Leave the files to the end of their scratch folder."""

    async def remove(self, mesh_id: str) -> None:
        """Move the files out, and remove them."""
        gone = self._temporary / f"{uuid4().hex}.gone"
        with suppress(FileNotFoundError):  # a crash came before the shared table was told
            (self._store.folder / mesh_id).rename(gone)
        await asyncio.to_thread(shutil.rmtree, gone, ignore_errors=True)

    async def distrust(self, mesh_id: str) -> None:
        """See ``MeshStore.distrust``."""
        await to_thread.run_sync(self._store.distrust, mesh_id)

    def note_use(self, mesh_id: str) -> None:
        """Record a use as the time of the folder."""
        self._store.note_use(mesh_id)

    def _owner(self, mesh_id: str) -> str | None:
        try:
            return self._store.owner(mesh_id)
        except ProblemError:  # a folder that is no mesh
            return None


def _replace_files(folder: Path, new: Path) -> None:
    """Move the files of a mesh over those in ``folder``, the manifest last."""
    for path in sorted(new.iterdir(), key=lambda path: path.name == MANIFEST):
        path.replace(folder / path.name)

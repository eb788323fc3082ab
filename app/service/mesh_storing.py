"""Meshes that workers make, put into the store: uploads, samples and cuts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from anyio import to_thread

from app.engine.interface import Engine, ProgressCallback
from app.engine.work import MeshInput, StoreMesh, Task
from app.store.fields import FieldStore
from app.store.mesh_catalog import MeshCatalog
from app.store.results import ResultStore
from app.store.scratch import Scratch

Manifest = Mapping[str, Any]
PhaseSeconds = Mapping[str, float]
"""Seconds of each phase of the work; empty where the store had the answer"""


@dataclass(frozen=True)
class StoredMesh:
    """A mesh that a request has put into the store, or found there."""

    manifest: Manifest
    is_new: bool
    seconds: PhaseSeconds
    about: Mapping[str, Any]
    """What the answer to a cut tells besides"""

    @property
    def mesh_id(self) -> str:
        """The hash of its content."""
        return str(self.manifest["id"])


class MeshStoring:
    """Has workers make meshes, and puts them into the store."""

    def __init__(
        self,
        scratch: Scratch,
        catalog: MeshCatalog,
        results: ResultStore,
        fields: FieldStore,
        engine: Engine,
    ) -> None:
        self._scratch = scratch
        self._catalog = catalog
        self._results = results
        self._fields = fields
        self._engine = engine

    async def store(
        self,
        mesh_input: MeshInput,
        name: str | None,
        client: str,
        on_progress: ProgressCallback,
        *,
        affinity_keys: tuple[str, ...] = (),
        is_promised: bool = False,
    ) -> StoredMesh:
        """Have a worker read or make a mesh, and store it under a name, if it has one."""
        async with self._scratch.folder(client) as scratch:
            work = StoreMesh(mesh_input, scratch.path / "mesh", name)
            task = Task(work, client, affinity_keys, is_promised=is_promised)
            while True:
                done = await self._engine.run(task, on_progress)
                written = done.mesh
                assert written is not None, "this kind of work writes a mesh"  # noqa: S101
                change = await self._catalog.add(written)
                if change is not None:
                    break
        for mesh_id in change.evicted:
            await self.forget(mesh_id)
        if change.is_healed:
            await self.forget(written.mesh_id)
        return StoredMesh(written.manifest, change.is_new, done.seconds, done.about_mesh)

    async def forget(self, mesh_id: str) -> None:
        """Remove results and fields of a mesh that is gone, or that was damaged.

        Nobody knows which answers came before the damage.
        """
        self._results.forget_mesh(mesh_id)
        await to_thread.run_sync(self._fields.forget_mesh, mesh_id)

"""The catalogues of two services over one folder of meshes and one table, in PostgreSQL."""

from pathlib import Path

import anyio
import pytest

import geodesic_core as gc
from app.errors import ProblemError
from app.state import Database
from app.state.mesh_records import MeshRecords
from app.store.mesh_catalog import CatalogChange, MeshCatalog
from app.store.meshes import MeshStore
from app.store.store import Store
from tests.support.service import scratch_folder

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.parametrize("state_url", ["postgresql"], indirect=True),
    pytest.mark.service,
]


class Replica:
    """A catalogue of its own, and meshes to add to it."""

    def __init__(self, root: Path, database: Database, capacity: int = 2**30) -> None:
        self.store = MeshStore(root)
        self.catalog = MeshCatalog(
            Store(root).meshes,
            capacity,
            evicts=True,
            shared=MeshRecords(database),
        )

    async def add(self, scale: int) -> tuple[str, CatalogChange | None]:
        """Add a mesh; those of all scales take equally much."""
        sample = gc.samples.plane(50)
        vertices, faces = sample.vertices, sample.faces
        mesh = gc.TriangleMesh(vertices * scale, faces)
        async with scratch_folder(self.store) as folder:
            written = self.store.write_aside(mesh, folder / "mesh")
            return written.mesh_id, await self.catalog.add(written)


async def started(root: Path, database: Database, capacity: int = 2**30) -> tuple[Replica, Replica]:
    first, second = (Replica(root, database, capacity) for _ in range(2))
    first.catalog.prepare()
    await first.catalog.reconcile()
    second.catalog.prepare()
    await second.catalog.keep_up()
    return first, second


async def test_two_catalogues_see_each_other(tmp_path: Path, database: Database) -> None:
    first, second = await started(tmp_path, database)
    mesh_id, change = await first.add(1)
    assert change == CatalogChange(is_new=True, evicted=[])
    assert await second.add(1) == (mesh_id, CatalogChange(is_new=False))
    await second.catalog.keep_up()
    assert list(second.catalog.ids) == [mesh_id]
    assert second.catalog.total == first.catalog.total > 0
    await second.catalog.delete(mesh_id)
    with pytest.raises(ProblemError):
        await first.catalog.delete(mesh_id)
    assert list(first.catalog.ids) == []
    assert await first.add(1) == (mesh_id, CatalogChange(is_new=True, evicted=[]))


async def test_what_nobody_uses_is_evicted(tmp_path: Path, database: Database) -> None:
    first, second = await started(tmp_path, database)
    oldest, _ = await first.add(1)
    size = first.catalog.total
    first, second = await started(tmp_path, database, capacity=size * 7 // 2)
    middle, _ = await first.add(2)
    newest, _ = await second.add(3)
    await first.catalog.keep_up()
    first.catalog.use(oldest)
    await first.catalog.keep_up()
    _, change = await second.add(4)
    assert change is not None
    assert change.evicted == [middle]
    with first.catalog.pinned(newest):
        await first.catalog.keep_up()
        await second.catalog.keep_up()
        second.catalog.use(oldest)
        _, change = await second.add(5)
        assert change is not None
        assert newest not in change.evicted
    assert (tmp_path / "meshes" / newest).is_dir()


async def forget(database: Database, mesh_id: str) -> None:
    async with MeshRecords(database).alone() as table:
        await table.remove(mesh_id)


async def test_a_start_after_a_crash(tmp_path: Path, database: Database) -> None:
    """The table has a mesh that is gone, and lacks one that is there."""
    first, _ = await started(tmp_path, database)
    lost, _ = await first.add(1)
    left, _ = await first.add(2)
    await forget(database, left)
    again, _ = await first.add(2)
    assert again == left
    assert set(first.catalog.ids) == {lost, left}
    await forget(database, left)
    (tmp_path / "meshes" / lost).rename(tmp_path / "elsewhere")
    first, second = await started(tmp_path, database)
    assert list(first.catalog.ids) == list(second.catalog.ids) == [left]


async def test_meshes_are_used_during_an_upload(tmp_path: Path, database: Database) -> None:
    """Queries use meshes while the shared table is told which one is evicted for a new one."""
    first, second = await started(tmp_path, database)
    evicted, _ = await first.add(1)
    size = first.catalog.total
    first, second = await started(tmp_path, database, capacity=size * 7 // 2)
    mesh_ids = [(await first.add(scale))[0] for scale in (2, 3)]

    async def query() -> None:
        while True:
            for mesh_id in mesh_ids:
                first.catalog.use(mesh_id)
            await anyio.sleep(0)

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(query)
        added, change = await first.add(4)
        tasks.cancel_scope.cancel()
    assert change == CatalogChange(is_new=True, evicted=[evicted])
    await second.catalog.keep_up()
    assert set(second.catalog.ids) == {*mesh_ids, added}

"""The catalogues of two services over one folder of meshes and one table, in both databases."""

from collections.abc import Awaitable, Callable
from pathlib import Path

import anyio
import pytest

import geodesic_core as gc
from app.errors import ProblemError
from app.state import Database, MeshRecords
from app.store.mesh_catalog import CatalogChange, MeshCatalog
from app.store.meshes import MeshStore
from app.store.store import Store
from tests.support.databases import opened
from tests.support.service import scratch_folder


class Replica:
    """A catalogue of its own, and meshes to add to it."""

    def __init__(
        self, root: Path, database: Database, capacity: int = 2**30, quota: int | None = None
    ) -> None:
        self.store = MeshStore(root)
        self.catalog = MeshCatalog(
            Store(root).meshes,
            capacity,
            evicts=True,
            quota=quota,
            shared=MeshRecords(database),
        )

    async def add(self, scale: int, owner: str | None = None) -> tuple[str, CatalogChange | None]:
        """Add a mesh; those of all scales take equally much."""
        sample = gc.samples.plane(50)
        vertices, faces = sample.vertices, sample.faces
        mesh = gc.TriangleMesh(vertices * scale, faces)
        async with scratch_folder(self.store) as folder:
            written = self.store.write_aside(mesh, folder / "mesh", owner)
            return written.mesh_id, await self.catalog.add(written)


async def started(
    root: Path, database: Database, capacity: int = 2**30, quota: int | None = None
) -> tuple[Replica, Replica]:
    first, second = (Replica(root, database, capacity, quota) for _ in range(2))
    first.catalog.prepare()
    await first.catalog.reconcile()
    second.catalog.prepare()
    await second.catalog.keep_up()
    return first, second


async def tick(database: Database) -> None:
    """Wait until the clock of the database, which in SQLite counts milliseconds, has gone on."""
    statement = f"SELECT {database.clock}"
    (before,) = await database.rows(statement)
    while before in await database.rows(statement):
        await anyio.sleep(0)


async def see_each_other(root: Path, database: Database) -> None:
    first, second = await started(root, database)
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


async def share_a_quota(root: Path, database: Database) -> None:
    first, _ = await started(root, database)
    await first.add(1, "bob")
    size = first.catalog.total
    first, second = await started(root, database, quota=size * 3 // 2)
    await first.add(2, "alice")
    with pytest.raises(ProblemError) as refused:
        await second.add(3, "alice")
    assert refused.value.problem.code == "quota_exceeded"
    await second.add(3, "carol")


async def evict_what_nobody_uses(root: Path, database: Database) -> None:
    first, second = await started(root, database)
    oldest, _ = await first.add(1)
    size = first.catalog.total
    first, second = await started(root, database, capacity=size * 7 // 2)
    middle, _ = await first.add(2)
    newest, _ = await second.add(3)
    await first.catalog.keep_up()
    await tick(database)
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
    assert (root / "meshes" / newest).is_dir()


async def start_after_a_crash(root: Path, database: Database) -> None:
    """The table has a mesh that is gone, and lacks one that is there."""
    first, _ = await started(root, database)
    lost, _ = await first.add(1)
    left, _ = await first.add(2)
    await database.run("DELETE FROM meshes WHERE id = ?", left)
    again, _ = await first.add(2)
    assert again == left
    assert set(first.catalog.ids) == {lost, left}
    await database.run("DELETE FROM meshes WHERE id = ?", left)
    (root / "meshes" / lost).rename(root / "elsewhere")
    first, second = await started(root, database)
    assert list(first.catalog.ids) == list(second.catalog.ids) == [left]


async def use_meshes_during_an_upload(root: Path, database: Database) -> None:
    """Queries use meshes while the shared table is told which one is evicted for a new one."""
    first, second = await started(root, database)
    evicted, _ = await first.add(1)
    size = first.catalog.total
    first, second = await started(root, database, capacity=size * 7 // 2)
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


@pytest.mark.parametrize(
    "check",
    [
        see_each_other,
        share_a_quota,
        evict_what_nobody_uses,
        start_after_a_crash,
        use_meshes_during_an_upload,
    ],
)
def test_catalogues(
    tmp_path: Path, database: Database, check: Callable[[Path, Database], Awaitable[None]]
) -> None:
    async def check_opened() -> None:
        async with opened(database):
            await check(tmp_path, database)

    anyio.run(check_opened)

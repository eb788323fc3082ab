"""The catalog of meshes: its bound, what makes room, and what crashes leave."""

import asyncio
import errno
import os
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import anyio
import pytest
from anyio import to_thread

import geodesic_core as gc
from app.engine.interface import ProgressCallback
from app.engine.work import RunQuery, Task, TaskResult
from app.errors import ProblemError
from app.store import meshes
from app.store.folder import Folder
from app.store.mesh_catalog import CatalogChange, MeshCatalog
from app.store.mesh_home import MeshHome
from app.store.meshes import MeshStore, WrittenMesh
from app.store.scratch import Scratch
from app.store.store import Store
from tests.support.service import (
    check_problem,
    distances,
    scratch_folder,
    serving,
    store_mesh,
    upload_sample,
)
from tests.support.waiting import LONG_S

Opened = tuple[MeshStore, MeshCatalog]


def plane(faces: int = 50) -> gc.TriangleMesh:
    return gc.samples.plane(faces)


def files_in(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*")}


@contextmanager
def opened(root: Path, capacity: int = 2**60, *, evicts: bool = False) -> Iterator[Opened]:
    store = Store(root)
    catalog = MeshCatalog(store.meshes, capacity, evicts=evicts)
    with store.owned():
        (root / "meshes").mkdir(exist_ok=True)
        Scratch(root, 1).prepare()
        catalog.prepare()
        yield MeshStore(root), catalog


def sizes_in(store: MeshStore) -> Mapping[str, int]:
    """Return the bytes of the meshes in a store."""
    found = MeshHome(Folder(store.folder.parent), store).found()
    return {mesh_id: record.size for mesh_id, record in found.items()}


def add(opened: Opened, mesh: gc.TriangleMesh) -> tuple[str, CatalogChange]:
    store, catalog = opened

    async def run() -> tuple[str, CatalogChange]:
        async with scratch_folder(store) as folder:
            written = store.write_aside(mesh, folder / "mesh", "plane")
            change = await catalog.add(written)
            assert change is not None
            return written.mesh_id, change

    return anyio.run(run)


def sizes(root: Path, *faces: int) -> list[int]:
    """Return the bytes that planes of so many faces take."""
    with opened(root / "sizes") as store:
        return [
            add(store, plane(count)) and list(sizes_in(store[0]).values())[-1] for count in faces
        ]


def test_what_finds_no_room_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    first, second = sizes(tmp_path, 50, 200)
    with opened(tmp_path / "store", first + second - 1) as store:
        mesh_id, _ = add(store, plane(50))
        before = files_in(tmp_path / "store")

        with pytest.raises(ProblemError) as caught:
            add(store, plane(200))
        problem = caught.value.problem
        assert problem.code == "storage_full"
        assert (problem.limit, problem.actual) == (first + second - 1, first + second)
        assert problem.setting == "store_bytes"
        assert files_in(tmp_path / "store") == before
        assert add(store, plane(50)) == (mesh_id, CatalogChange(is_new=False)), "it takes no room"
        anyio.run(store[1].delete, mesh_id)
        assert add(store, plane(200))[1].is_new


def test_the_bound_holds_for_what_a_former_service_left(tmp_path: Path) -> None:
    (size,) = sizes(tmp_path, 50)
    with opened(tmp_path / "store") as store:
        add(store, plane(50))

    with opened(tmp_path / "store", size) as store:
        assert store[1].total == size
        with pytest.raises(ProblemError):
            add(store, plane(18))


def test_of_two_uploads_at_the_same_time_the_store_takes_one(tmp_path: Path) -> None:
    capacity = sum(sizes(tmp_path, 50, 72)) - 1
    with opened(tmp_path / "store", capacity) as (store, catalog):
        ends: list[str] = []

        async def add_one(faces: int) -> None:
            async with scratch_folder(store) as folder:
                written = store.write_aside(plane(faces), folder / "mesh", "plane")
                await anyio.sleep(0)  # both are written before either is added
                try:
                    await catalog.add(written)
                    ends.append("added")
                except ProblemError as error:
                    ends.append(error.problem.code)

        async def add_both() -> None:
            async with anyio.create_task_group() as group:
                group.start_soon(add_one, 50)
                group.start_soon(add_one, 72)

        anyio.run(add_both)
        assert sorted(ends) == ["added", "storage_full"]
        assert len(catalog.ids) == 1
        assert catalog.total <= capacity


@pytest.mark.parametrize("restarts", [False, True])
def test_the_least_recently_used_go_first(tmp_path: Path, restarts: bool) -> None:
    kinds = (50, 72, 98)
    room = sum(sizes(tmp_path, *kinds))
    root = tmp_path / "store"
    with opened(root, room, evicts=True) as store:
        ids = [add(store, plane(faces))[0] for faces in kinds]
        for number, mesh_id in enumerate(ids):
            os.utime(root / "meshes" / mesh_id / "manifest.json", (number, number))
        store[1].use(ids[0])
        if not restarts:
            assert add(store, plane(128))[1].evicted == ids[1:]
    if restarts:
        with opened(root, room, evicts=True) as store:
            assert add(store, plane(128))[1].evicted == ids[1:]
            assert sorted(sizes_in(store[0])) == sorted([ids[0], add(store, plane(128))[0]])
    assert files_in(root / "tmp") == set()


def test_what_is_held_does_not_go(tmp_path: Path) -> None:
    first, second, third = sizes(tmp_path, 50, 72, 98)
    with opened(tmp_path / "store", first + second, evicts=True) as store:
        held, _ = add(store, plane(50))
        other, _ = add(store, plane(72))
        with store[1].pinned(held):
            with pytest.raises(ProblemError):
                add(store, plane(98))
            assert set(sizes_in(store[0])) == {held, other}, "nothing goes in vain"
            with store[1].pinned(held):
                pass
            assert add(store, plane(32))[1].evicted == [other]
        assert third < first + second
        assert held in add(store, plane(98))[1].evicted


def test_nothing_goes_for_what_would_never_fit(tmp_path: Path) -> None:
    small, large = sizes(tmp_path, 50, 200)
    with opened(tmp_path / "store", large - 1, evicts=True) as store:
        mesh_id, _ = add(store, plane(50))
        with pytest.raises(ProblemError):
            add(store, plane(200))
        assert sizes_in(store[0]) == {mesh_id: small}


def test_two_that_write_one_mesh(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        own, catalog = store

        async def run() -> list[bool]:
            async with scratch_folder(own) as folder:
                both = [own.write_aside(plane(), folder / name) for name in "ab"]
                kept = await asyncio.gather(*map(catalog.add, both))
                return [each.is_new for each in kept]

        assert sorted(anyio.run(run)) == [False, True]
        assert len(sizes_in(store[0])) == 1
        assert catalog.total == sum(sizes_in(store[0]).values())
        assert files_in(tmp_path / "tmp") == set()


def test_uploads_at_the_same_time_do_not_exceed_the_bound(tmp_path: Path) -> None:
    kinds = (50, 72, 98, 128)
    room = sum(sizes(tmp_path, *kinds)[:2])
    with opened(tmp_path / "store", room) as store:
        own, catalog = store

        async def run() -> list[Any]:
            async with scratch_folder(own) as folder:
                written = [own.write_aside(plane(faces), folder / str(faces)) for faces in kinds]
                return await asyncio.gather(*map(catalog.add, written), return_exceptions=True)

        kept = anyio.run(run)
        refused = [each for each in kept if isinstance(each, ProblemError)]
        assert len(refused) >= 2
        assert len(sizes_in(store[0])) == len(kinds) - len(refused) >= 1
        assert catalog.total == sum(sizes_in(store[0]).values()) <= room
        assert files_in(tmp_path / "store" / "tmp") == set()


def test_a_mesh_removed_before_its_upload_ends_is_to_be_written_again(tmp_path: Path) -> None:
    with opened(tmp_path / "store") as store:
        mesh_id, _ = add(store, plane(50))
        found = store[0].write_aside(plane(50), tmp_path / "aside")
        assert found.folder is None
        anyio.run(store[1].delete, mesh_id)
        assert anyio.run(store[1].add, found) is None


def test_a_mesh_on_its_way_out_is_to_be_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder is gone, and the catalog still has it, while its files are removed."""
    with opened(tmp_path / "store") as (store, catalog):
        mesh_id, _ = add((store, catalog), plane(50))
        found = store.write_aside(plane(50), tmp_path / "aside")
        assert found.folder is None

        async def run() -> CatalogChange | None:
            remove, may_end = MeshHome.remove, anyio.Event()

            async def remove_slowly(home: MeshHome, mesh_id: str) -> None:
                await remove(home, mesh_id)
                await may_end.wait()

            monkeypatch.setattr(MeshHome, "remove", remove_slowly)
            async with anyio.create_task_group() as group:
                group.start_soon(catalog.delete, mesh_id)
                while (store.folder / mesh_id).exists():
                    await anyio.sleep(0)
                group.start_soon(_set_soon, may_end)
                return await catalog.add(found)

        assert anyio.run(run) is None


async def _set_soon(event: anyio.Event) -> None:
    await anyio.sleep(0.01)
    event.set()


@pytest.mark.service
def test_a_mesh_evicted_while_it_is_uploaded_again_is_there_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_to_catalog, lost = MeshCatalog.add, []

    async def add_late(catalog: MeshCatalog, written: WrittenMesh) -> CatalogChange | None:
        if written.folder is None and not lost:
            lost.append(written.mesh_id)
            await catalog.delete(written.mesh_id)
        return await add_to_catalog(catalog, written)

    with serving(tmp_path / "store") as client:
        mesh_id = upload_sample(client, "plane", 50)
        monkeypatch.setattr(MeshCatalog, "add", add_late)
        assert upload_sample(client, "plane", 50) == mesh_id
        assert lost == [mesh_id]
        assert distances(client, mesh_id).status_code == 200


@pytest.mark.service
def test_a_mesh_stays_while_a_query_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    room = sum(sizes(tmp_path, 50, 72))
    with (
        serving(tmp_path / "store", store_bytes=room, store_evict="lru") as client,
        ThreadPoolExecutor() as threads,
    ):
        held, other = (upload_sample(client, "plane", faces) for faces in (50, 72))
        run, waits, may_run = client.engine.run, threading.Event(), threading.Event()

        async def run_later(task: Task, on_progress: ProgressCallback) -> TaskResult:
            if isinstance(task.work, RunQuery):
                waits.set()
                await to_thread.run_sync(may_run.wait)
            return await run(task, on_progress)

        monkeypatch.setattr(client.engine, "run", run_later)
        waiting = threads.submit(distances, client, held)
        assert waits.wait(LONG_S)
        client.get(f"/v1/meshes/{other}")
        third = upload_sample(client, "plane", 32)
        stored = {mesh["id"] for mesh in client.get("/v1/meshes").json()["meshes"]}
        may_run.set()

        assert stored == {held, third}
        assert waiting.result().status_code == 200
        client.get(f"/v1/meshes/{third}")
        upload_sample(client, "plane", 72)
        check_problem(client.get(f"/v1/meshes/{held}"), 404, "mesh_not_found")


# Crashes


class Crash(BaseException):
    """The end of a process, as far as its files are concerned."""


STEPS = [
    (Path, "open"),
    (meshes, "sync_all"),
    (meshes, "sync"),
    (Path, "write_bytes"),
    (Path, "rename"),
    (Path, "replace"),
    (Path, "mkdir"),
]


def count_down(
    monkeypatch: pytest.MonkeyPatch, root: Path, steps: int, error: BaseException
) -> None:
    """Fail at a step of all that change files below ``root``; other threads may change others."""
    left = steps

    def failing(real: Callable[..., Any]) -> Callable[..., Any]:
        def step(*args: Any, **kwargs: Any) -> Any:
            nonlocal left
            is_reading = real.__name__ == "open" and "w" not in str((args[1:], kwargs))
            left -= str(root) in str(args) and not is_reading
            if left == 0:
                left = -1
                raise error
            return real(*args, **kwargs)

        return step

    for owner, name in STEPS:
        monkeypatch.setattr(owner, name, failing(getattr(owner, name)))


@pytest.mark.slow
def test_a_crash_at_any_step_leaves_a_mesh_whole_or_not_there(tmp_path: Path) -> None:
    kept = store_mesh(tmp_path / "before", plane(18))
    seen = set()
    for step in range(1, 100):
        root = tmp_path / str(step)
        shutil.copytree(tmp_path / "before", root)
        with pytest.MonkeyPatch.context() as patch, opened(root) as store:
            before = files_in(root)
            folder = root / "tmp" / "crashed"
            folder.mkdir()
            count_down(patch, root, step, Crash())
            try:
                written = store[0].write_aside(plane(), folder / "mesh")
                anyio.run(store[1].add, written)
            except Crash:
                has_crashed = True
            else:
                has_crashed = False
        with opened(root) as store:
            there = set(sizes_in(store[0])) - {kept}
            assert store[1].total == sum(sizes_in(store[0]).values())
            assert files_in(root / "tmp") == set()
        for mesh_id in (kept, *there):
            assert not any(store[0].inspect(mesh_id))
        assert there or files_in(root) == before
        seen.add((has_crashed, bool(there)))
        if not has_crashed:
            break

    assert step > 15
    assert seen == {(True, False), (True, True), (False, True)}


@pytest.mark.slow
def test_a_crash_while_a_mesh_is_healed_leaves_it_damaged_or_whole(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path / "before", plane())
    folder = Path("meshes", mesh_id)
    expected = {path.name: path.read_bytes() for path in (tmp_path / "before" / folder).iterdir()}
    (tmp_path / "before" / folder / "faces.npy").write_bytes(b"")
    (tmp_path / "before" / folder / "vertices.npy").unlink()
    seen = set()
    for step in range(1, 100):
        root = tmp_path / str(step)
        shutil.copytree(tmp_path / "before", root)
        with pytest.MonkeyPatch.context() as patch, opened(root) as store:
            (root / "tmp" / "crashed").mkdir()
            count_down(patch, root, step, Crash())
            try:
                written = store[0].write_aside(plane(), root / "tmp" / "crashed" / "mesh")
                change = anyio.run(store[1].add, written)
            except Crash:
                has_crashed = True
            else:
                has_crashed = False
                assert change == CatalogChange(is_new=False, is_healed=True, evicted=[])
        with opened(root) as store:
            assert list(sizes_in(store[0])) == [mesh_id]
            assert store[1].total == sum(sizes_in(store[0]).values())
            is_whole = not any(store[0].inspect(mesh_id))
            found = {path.name: path.read_bytes() for path in (root / folder).iterdir()}
            assert is_whole == (found == expected)
        seen.add((has_crashed, is_whole))
        if not has_crashed:
            break

    assert step > 25
    assert seen == {(True, False), (True, True), (False, True)}


def test_a_full_disk_at_any_step_leaves_nothing(tmp_path: Path) -> None:
    for step in range(1, 100):
        root = tmp_path / str(step)
        with pytest.MonkeyPatch.context() as patch, opened(root) as store:
            before = files_in(root)
            count_down(patch, root, step, OSError(errno.ENOSPC, "full"))
            try:
                add(store, plane())
            except OSError:
                assert store[1].total == 0
                assert files_in(root) == before
                continue
            break
    assert step > 15

"""The store as a whole: who owns it, its layout, its bound, and what crashes leave of it."""

import asyncio
import errno
import os
import shutil
import sqlite3
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import anyio
import numpy as np
import orjson
import pytest
from anyio import to_thread

import geodesic_core as gc
from app.engine.interface import ProgressCallback
from app.engine.work import RunQuery, Task, TaskResult
from app.errors import ProblemError
from app.state import require_intact
from app.store import folder_meshes, ownership
from app.store.folder_meshes import FolderMeshes
from app.store.layout import LAYOUT, StoreError, require_layout
from app.store.mesh_catalog import CatalogChange, MeshCatalog
from app.store.meshes import MeshStore, WrittenMesh
from app.store.ownership import owned
from app.store.scratch import Scratch
from tests.support.disks import fill_disk
from tests.support.paths import ROOT
from tests.support.service import (
    check_problem,
    distances,
    scratch_folder,
    serving,
    store_mesh,
    upload_sample,
)
from tests.support.waiting import LONG_S, wait_until


def plane(faces: int = 50) -> gc.TriangleMesh:
    return gc.samples.plane(faces)


def files_in(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*")}


# Whose it is


def test_a_store_belongs_to_one_at_a_time(tmp_path: Path) -> None:
    root = tmp_path / "new" / "store"
    busy = pytest.raises(StoreError, match=r"store is in use by another process.*GEODESIC_STORE")
    with owned(root), busy:
        owned(root).__enter__()
    with owned(root):
        pass


@pytest.mark.slow
def test_the_lock_goes_with_its_process_however_that_ends(tmp_path: Path) -> None:
    script = "import sys; from pathlib import Path; from app.store.ownership import owned\n"
    script += "with owned(Path(sys.argv[1])): print('owned', flush=True); sys.stdin.read()"
    owner = subprocess.Popen(  # noqa: S603 - this Python, and the text above
        [sys.executable, "-c", script, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    )
    with owner:
        assert owner.stdout is not None
        assert owner.stdout.readline() == b"owned\n"
        with pytest.raises(StoreError, match="in use"):
            owned(tmp_path).__enter__()
        owner.kill()
        owner.wait()
        with owned(tmp_path):
            pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(StoreError, match="cannot be written: Permission denied"):
        owned(tmp_path / "store").__enter__()


def test_a_file_is_no_store(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="cannot be written: "):
        owned(tmp_path / "file").__enter__()


# Its layout


def test_a_new_store_has_the_number_of_its_layout(tmp_path: Path) -> None:
    with owned(tmp_path):
        pass

    assert (tmp_path / "VERSION").read_text() == f"{LAYOUT}\n"
    assert files_in(tmp_path) == {"VERSION", "lock"}


@pytest.mark.parametrize("written", ["3", "8", "7.1", "", "five", "-5"])
def test_another_layout_is_refused(tmp_path: Path, written: str) -> None:
    (tmp_path / "VERSION").write_text(written)

    with pytest.raises(StoreError, match=rf"has layout '?{written}'?, but this release reads 7:"):
        owned(tmp_path).__enter__()
    assert (tmp_path / "VERSION").read_text() == written


def make_older(root: Path, layout: int) -> tuple[str, str]:
    """Make a store look like one of an older layout; return its two meshes, the second damaged."""
    ids = store_mesh(root, plane(), "alice"), store_mesh(root, plane(18))
    for mesh_id in ids:
        folder = root / "meshes" / mesh_id
        manifest = orjson.loads((folder / "manifest.json").read_bytes())
        del manifest["checksum"]
        for name in manifest["crc32"]:
            content = np.load(folder / f"{name}.npy").tobytes()
            manifest["crc32"][name] = zlib.crc32(content)
        manifest |= {"version": layout} if layout < 5 else {}
        (folder / "manifest.json").write_bytes(orjson.dumps(manifest))
    flip_bytes(folder / "component.npy")
    (root / "VERSION").unlink()
    if layout >= 5:
        (root / "VERSION").write_text(f"{layout}\n")
    return ids


def flip_bytes(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[:-8] + bytes(byte ^ 255 for byte in content[-8:]))


@pytest.mark.parametrize("layout", [4, 5])
@pytest.mark.parametrize("was_interrupted", [False, True])
def test_an_older_store_is_converted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, layout: int, was_interrupted: bool
) -> None:
    whole, damaged = make_older(tmp_path, layout)
    expected = plane()
    with pytest.raises(StoreError, match=rf"has layout {layout}.*start the service on it once"):
        require_layout(tmp_path)
    if was_interrupted:
        with monkeypatch.context() as patch:
            patch.setattr(ownership, "_write_layout", failing)
            with pytest.raises(Crash):
                owned(tmp_path).__enter__()
        (tmp_path / "meshes" / whole / "tmp123").touch()

    with owned(tmp_path):
        pass

    assert (tmp_path / "VERSION").read_text() == f"{LAYOUT}\n"
    require_layout(tmp_path)
    store = MeshStore(tmp_path)
    assert not any(store.inspect(whole))
    manifest = store.manifest(whole)
    assert manifest["owner"] == "alice"
    assert manifest["report"] == orjson.loads(orjson.dumps(expected.report.as_dict()))
    arrays = store.open(whole).mesh.arrays()
    for name, array in expected.arrays().items():
        np.testing.assert_array_equal(arrays[name], array)
    assert any(store.inspect(damaged))
    assert not list((tmp_path / "meshes").glob("*/tmp*"))


def test_a_store_of_layout_6_is_taken_over_as_it_is(tmp_path: Path) -> None:
    mesh_id = store_mesh(tmp_path, plane())
    (tmp_path / "VERSION").write_text("6\n")

    with owned(tmp_path):
        pass

    assert (tmp_path / "VERSION").read_text() == f"{LAYOUT}\n"
    assert MeshStore(tmp_path).is_intact(mesh_id)


def failing(*_: object) -> None:
    raise Crash


def test_counts_that_were_edited_before_are_not_taken_over(tmp_path: Path) -> None:
    whole, _ = make_older(tmp_path, 5)
    path = tmp_path / "meshes" / whole / "manifest.json"
    path.write_bytes(path.read_bytes().replace(b'"faces":50', b'"faces":51'))

    with owned(tmp_path):
        pass

    assert MeshStore(tmp_path).manifest(whole)["report"]["faces"] == 50


def test_an_older_store_is_refused(tmp_path: Path) -> None:
    make_older(tmp_path, 3)
    before = files_in(tmp_path)

    with pytest.raises(StoreError, match=r"has layout 3, .*upload its meshes again"):
        owned(tmp_path).__enter__()
    assert files_in(tmp_path) == before


def test_a_damaged_job_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite3"
    require_intact(path)
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE jobs (record TEXT)")
        database.executemany("INSERT INTO jobs VALUES (?)", [("x" * 1000,)] * 100)
    database.close()
    require_intact(path)
    content = path.read_bytes()
    for damaged in (b"no database" * 100, content[:20000] + bytes(9000) + content[29000:]):
        path.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"jobs.sqlite3 is damaged .*: move it away"):
            require_intact(path)


# Its bound

Store = tuple[MeshStore, MeshCatalog]


@contextmanager
def opened(
    root: Path, capacity: int = 2**60, *, evicts: bool = False, quota: int | None = None
) -> Iterator[Store]:
    store = MeshStore(root)
    catalog = MeshCatalog(FolderMeshes(root), capacity, evicts=evicts, quota=quota)
    with owned(root):
        Scratch(root, 1).prepare()
        catalog.prepare()
        yield store, catalog


def add(
    opened: Store, mesh: gc.TriangleMesh, owner: str | None = None
) -> tuple[str, CatalogChange]:
    store, catalog = opened

    async def run() -> tuple[str, CatalogChange]:
        async with scratch_folder(store) as folder:
            written = store.write_aside(mesh, folder / "mesh", owner, "plane")
            change = await catalog.add(written)
            assert change is not None
            return written.mesh_id, change

    return anyio.run(run)


def sizes(root: Path, *faces: int) -> list[int]:
    """Return the bytes that planes of so many faces take."""
    with opened(root / "sizes") as store:
        return [add(store, plane(count)) and list(store[0].sizes().values())[-1] for count in faces]


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


@pytest.mark.parametrize("restarts", [False, True])
@pytest.mark.parametrize("owner", ["alice", None])
def test_the_quota_bounds_what_each_owner_stored_first(
    tmp_path: Path, owner: str | None, restarts: bool
) -> None:
    root = tmp_path / "store"
    with opened(tmp_path / "sizes") as sizing:
        small, large = (
            add(sizing, plane(faces), owner) and list(sizing[0].sizes().values())[-1]
            for faces in (50, 200)
        )
    quota = small + large - 100  # manifests of other owners differ by some bytes
    with opened(root, quota=quota) as store:
        mesh_id, _ = add(store, plane(50), owner)
        if not restarts:
            check_quota(store, mesh_id, owner, small + large, quota)
    if restarts:
        (root / "meshes" / "no mesh").mkdir()
        with opened(root, quota=quota) as store:
            check_quota(store, mesh_id, owner, small + large, quota)


def check_quota(store: Store, mesh_id: str, owner: str | None, wanted: int, quota: int) -> None:
    """Check that an owner is refused ``plane(200)`` beside ``mesh_id``, and nobody else is."""
    before = files_in(store[0].folder)
    with pytest.raises(ProblemError) as caught:
        add(store, plane(200), owner)
    problem = caught.value.problem
    assert (problem.code, problem.status) == ("quota_exceeded", 507)
    assert (problem.limit, problem.actual) == (quota, wanted)
    assert problem.setting == "quota_bytes"
    assert files_in(store[0].folder) == before

    assert add(store, plane(50), owner) == (mesh_id, CatalogChange(is_new=False))
    other, change = add(store, plane(200), "bob")
    assert change.is_new
    assert not add(store, plane(200), owner)[1].is_new, "it is Bob's, and counts for him"
    anyio.run(store[1].delete, other)
    anyio.run(store[1].delete, mesh_id)
    assert add(store, plane(200), owner)[1].is_new


def test_of_two_uploads_at_the_same_time_the_quota_takes_one(tmp_path: Path) -> None:
    quota = sum(sizes(tmp_path, 50, 72)) - 1
    with opened(tmp_path / "store", quota=quota) as (store, catalog):
        ends: list[str] = []

        async def add_one(faces: int) -> None:
            async with scratch_folder(store) as folder:
                written = store.write_aside(plane(faces), folder / "mesh", "alice")
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
        assert sorted(ends) == ["added", "quota_exceeded"]
        assert len(catalog.ids) == 1
        assert catalog.total <= quota


def test_a_mesh_is_healed_although_the_quota_is_less_by_now(tmp_path: Path) -> None:
    with opened(tmp_path / "store") as store:
        mesh_id, _ = add(store, plane(50), "alice")
    (tmp_path / "store" / "meshes" / mesh_id / "faces.npy").write_bytes(b"")

    with opened(tmp_path / "store", quota=1) as store:
        assert add(store, plane(50), "alice")[1].is_healed
        with pytest.raises(ProblemError):
            add(store, plane(18), "alice")


def test_nothing_is_evicted_to_make_room_in_a_quota(tmp_path: Path) -> None:
    (size,) = sizes(tmp_path, 50)
    with opened(tmp_path / "store", evicts=True, quota=size + 100) as store:
        mesh_id, _ = add(store, plane(50), "alice")
        with pytest.raises(ProblemError):
            add(store, plane(72), "alice")
        assert list(store[1].ids) == [mesh_id]


@pytest.mark.parametrize("restarts", [False, True])
def test_the_least_recently_used_go_first(tmp_path: Path, restarts: bool) -> None:
    kinds = (50, 72, 98)
    room = sum(sizes(tmp_path, *kinds))
    root = tmp_path / "store"
    with opened(root, room, evicts=True) as store:
        ids = [add(store, plane(faces))[0] for faces in kinds]
        for number, mesh_id in enumerate(ids):
            os.utime(root / "meshes" / mesh_id, (number, number))
        store[1].use(ids[0])
        if not restarts:
            assert add(store, plane(128))[1].evicted == ids[1:]
    if restarts:
        with opened(root, room, evicts=True) as store:
            assert add(store, plane(128))[1].evicted == ids[1:]
            assert sorted(store[0].sizes()) == sorted([ids[0], add(store, plane(128))[0]])
    assert files_in(root / "tmp") == set()


def test_what_is_held_does_not_go(tmp_path: Path) -> None:
    first, second, third = sizes(tmp_path, 50, 72, 98)
    with opened(tmp_path / "store", first + second, evicts=True) as store:
        held, _ = add(store, plane(50))
        other, _ = add(store, plane(72))
        with store[1].pinned(held):
            with pytest.raises(ProblemError):
                add(store, plane(98))
            assert set(store[0].sizes()) == {held, other}, "nothing goes in vain"
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
        assert store[0].sizes() == {mesh_id: small}


def test_two_that_write_one_mesh(tmp_path: Path) -> None:
    with opened(tmp_path) as store:
        meshes, catalog = store

        async def run() -> list[bool]:
            async with scratch_folder(meshes) as folder:
                both = [meshes.write_aside(plane(), folder / name, None) for name in "ab"]
                kept = await asyncio.gather(*map(catalog.add, both))
                return [each.is_new for each in kept]

        assert sorted(anyio.run(run)) == [False, True]
        assert len(meshes.sizes()) == 1
        assert catalog.total == sum(meshes.sizes().values())
        assert files_in(tmp_path / "tmp") == set()


def test_uploads_at_the_same_time_do_not_exceed_the_bound(tmp_path: Path) -> None:
    kinds = (50, 72, 98, 128)
    room = sum(sizes(tmp_path, *kinds)[:2])
    with opened(tmp_path / "store", room) as store:
        meshes, catalog = store

        async def run() -> list[Any]:
            async with scratch_folder(meshes) as folder:
                written = [
                    meshes.write_aside(plane(faces), folder / str(faces), None) for faces in kinds
                ]
                return await asyncio.gather(*map(catalog.add, written), return_exceptions=True)

        kept = anyio.run(run)
        refused = [each for each in kept if isinstance(each, ProblemError)]
        assert len(refused) >= 2
        assert len(meshes.sizes()) == len(kinds) - len(refused) >= 1
        assert catalog.total == sum(meshes.sizes().values()) <= room
        assert files_in(tmp_path / "store" / "tmp") == set()


@pytest.mark.service
def test_over_http(tmp_path: Path) -> None:
    room = sum(sizes(tmp_path, 50, 72))
    store = tmp_path / "store"
    with serving(store, store_bytes=room) as client:
        first = upload_sample(client, "plane", 50)
        upload_sample(client, "plane", 72)
        sample = {"sample": "plane", "faces": 32}
        problem = check_problem(client.post("/v1/meshes", params=sample), 507, "storage_full")
        assert (problem["limit"], problem["setting"]) == (room, "store_bytes")
        assert problem["actual"] > room
        assert files_in(store / "tmp") == set()
        assert distances(client, first).status_code == 200, "as is used after the other"

    with serving(store, store_bytes=room, store_evict="lru") as client:
        job = client.post(
            f"/v1/meshes/{first}/distances",
            json={"sources": [{"vertex": 1}]},
            headers={"Prefer": "respond-async"},
        ).headers["location"]
        wait_until(lambda: client.get(job).json()["status"] == "successful")
        third = upload_sample(client, "plane", 32)
        assert {mesh["id"] for mesh in client.get("/v1/meshes").json()["meshes"]} == {first, third}
        client.get(f"/v1/meshes/{third}/arrays/faces")
        for faces in (98, 18):
            upload_sample(client, "plane", faces)

        check_problem(client.get(f"/v1/meshes/{first}"), 404, "mesh_not_found")
        assert client.get(f"{job}/results").status_code == 200, "a job keeps its answer"
        assert len(list((store / "results" / first).glob("*.body"))) == 1
        total = client.app.state.service.mesh_catalog.total
        assert total == sum(MeshStore(store).sizes().values()) <= room


def test_a_mesh_removed_while_it_is_inspected_is_not_damaged(tmp_path: Path) -> None:
    with opened(tmp_path / "store") as store:
        for comes_back in (False, True):
            mesh_id, _ = add(store, plane(50))
            findings = store[0].inspect(mesh_id)
            assert next(findings) is None
            anyio.run(store[1].delete, mesh_id)
            if comes_back:
                add(store, plane(50))
            assert not any(findings)
        assert not any(store[0].inspect(mesh_id))


def test_a_mesh_removed_before_its_upload_ends_is_to_be_written_again(tmp_path: Path) -> None:
    with opened(tmp_path / "store") as store:
        mesh_id, _ = add(store, plane(50))
        found = store[0].write_aside(plane(50), tmp_path / "aside", None)
        assert found.folder is None
        anyio.run(store[1].delete, mesh_id)
        assert anyio.run(store[1].add, found) is None


def test_a_mesh_on_its_way_out_is_to_be_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder is gone, and the catalog still has it, while its files are removed."""
    with opened(tmp_path / "store") as (store, catalog):
        mesh_id, _ = add((store, catalog), plane(50))
        found = store.write_aside(plane(50), tmp_path / "aside", None)
        assert found.folder is None

        async def run() -> CatalogChange | None:
            remove, may_end = FolderMeshes.remove, anyio.Event()

            async def remove_slowly(home: FolderMeshes, mesh_id: str) -> None:
                await remove(home, mesh_id)
                await may_end.wait()

            monkeypatch.setattr(FolderMeshes, "remove", remove_slowly)
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
    (folder_meshes, "sync_all"),
    (folder_meshes, "sync"),
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
            left -= str(root) in str(args)
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
                written = store[0].write_aside(plane(), folder / "mesh", None)
                anyio.run(store[1].add, written)
            except Crash:
                has_crashed = True
            else:
                has_crashed = False
        with opened(root) as store:
            there = set(store[0].sizes()) - {kept}
            assert store[1].total == sum(store[0].sizes().values())
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
    mesh_id = store_mesh(tmp_path / "before", plane(), "alice")
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
                written = store[0].write_aside(plane(), root / "tmp" / "crashed" / "mesh", "bob")
                change = anyio.run(store[1].add, written)
            except Crash:
                has_crashed = True
            else:
                has_crashed = False
                assert change == CatalogChange(is_new=False, is_healed=True, evicted=[])
        with opened(root) as store:
            assert list(store[0].sizes()) == [mesh_id]
            assert store[1].total == sum(store[0].sizes().values())
            is_whole = store[0].is_intact(mesh_id)
            found = {path.name: path.read_bytes() for path in (root / folder).iterdir()}
            assert is_whole == (found == expected)
            assert is_whole or any(store[0].inspect(mesh_id))
        seen.add((has_crashed, is_whole))
        if not has_crashed:
            break

    assert step > 30
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


def test_a_device_that_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real one, which np.save would answer with an error that does not say so."""
    fill_disk(monkeypatch, "*.npy")
    with pytest.raises(OSError, match="No space left") as caught:
        MeshStore(tmp_path).write_aside(plane(10_000), tmp_path / "mesh", None)
    assert caught.value.errno == errno.ENOSPC

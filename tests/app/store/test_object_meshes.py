"""Copies of the meshes of an object store."""

import asyncio
from datetime import timedelta
from pathlib import Path

import pytest
from obstore.store import MemoryStore

import geodesic_core as gc
from app.store.layout import FIELDS, RESULTS, TEMPORARY
from app.store.meshes import MeshStore
from app.store.object_meshes import ObjectMeshes
from app.store.object_store import ObjectStore
from app.store.objects import Objects


def machine(objects: Objects, folder: Path) -> ObjectMeshes:
    meshes = ObjectMeshes(objects, folder, 10**9)
    meshes.prepare()
    return meshes


def test_pulls_at_the_same_time_leave_no_lock(tmp_path: Path) -> None:
    objects = Objects(MemoryStore())
    one, two = (machine(objects, tmp_path / name) for name in ("one", "two"))
    written = MeshStore(tmp_path / "one").write_aside(
        gc.samples.plane(20), tmp_path / "scratch", owner=None
    )

    async def main() -> None:
        await one.send(written)
        await one.put(written, is_new=True)
        together = asyncio.Barrier(3)

        async def use() -> None:
            async with two.holding(written.mesh_id):
                await together.wait()  # nobody lets go before all have the copy

        await asyncio.gather(*(use() for _ in range(3)))

    asyncio.run(main())
    assert not two._pulls


def test_what_uploads_left_is_removed_a_day_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service that is killed leaves the file, and a host the arrays."""
    objects = Objects(MemoryStore())
    meshes = machine(objects, tmp_path)
    left = ("uploads/tmp/scratch/upload", f"meshes/{32 * 'a'}/scratch-mesh/vertices.npy")
    for name in left:
        objects.write(name, b"content")
    assert not meshes.found()
    assert [objects.size(name) for name in left] == [7, 7]

    monkeypatch.setattr("app.store.objects._ABANDONED", -timedelta(days=1))
    assert not meshes.found()
    assert [objects.size(name) for name in left] == [None, None]


def test_a_start_removes_what_a_killed_process_left_unfinished(tmp_path: Path) -> None:
    store = ObjectStore(Objects(MemoryStore()), tmp_path, 10**9, "memory")
    pull = tmp_path / TEMPORARY / "a pull"
    pull.mkdir(parents=True)
    files = [
        pull / "vertices.npy",
        tmp_path / TEMPORARY / "a file",
        tmp_path / RESULTS / "mesh" / "key.body",
        tmp_path / FIELDS / "mesh" / "tmp1",
        tmp_path / FIELDS / "mesh" / "key.npz",
    ]
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"content")
    with store.owned():
        assert [file for file in files if file.exists()] == files[-1:]
        assert (tmp_path / TEMPORARY).is_dir()

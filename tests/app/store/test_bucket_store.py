"""A store of objects: the copies of its meshes, and what is left of work that was not finished."""

import asyncio
from pathlib import Path

import pytest
from obstore.store import MemoryStore

import geodesic_core as gc
from app.store.bucket import Bucket
from app.store.bucket_store import BucketStore
from app.store.layout import FIELDS, RESULTS, TEMPORARY
from app.store.meshes import MeshStore


def test_pulls_at_the_same_time_leave_no_lock(tmp_path: Path) -> None:
    objects = Bucket(MemoryStore())
    one, two = (BucketStore(objects, tmp_path / name, 10**9, "memory") for name in ("one", "two"))

    async def main() -> None:
        written = MeshStore(one.folder).write_aside(
            gc.samples.plane(20), one.folder / TEMPORARY / "mesh"
        )
        await one.send_mesh(written)
        await one.meshes.put(written)
        together = asyncio.Barrier(3)

        async def use() -> None:
            async with two.holding(written.mesh_id):
                await together.wait()  # nobody lets go before all have the copy

        await asyncio.gather(*(use() for _ in range(3)))

    with one.owned(), two.owned():
        asyncio.run(main())
    assert not two._copies._pulls


def test_what_uploads_left_is_removed_a_day_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service that is killed leaves the file, and a host the arrays."""
    objects = Bucket(MemoryStore())
    store = BucketStore(objects, tmp_path, 10**9, "memory")
    left = ("uploads/tmp/scratch/upload", f"meshes/{32 * 'a'}/scratch-mesh/vertices.npy")
    for name in left:
        objects.write(name, b"content")
    for sizes in ([7, 7], [None, None]):
        store.claim("a database")
        assert not store.meshes.found()
        assert [objects.size(name) for name in left] == sizes
        monkeypatch.setattr("app.store.bucket.ABANDONED_S", -86_400.0)


def test_a_start_removes_what_a_killed_process_left_unfinished(tmp_path: Path) -> None:
    store = BucketStore(Bucket(MemoryStore()), tmp_path, 10**9, "memory")
    pull = tmp_path / TEMPORARY / "a pull"
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

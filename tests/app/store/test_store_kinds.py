"""Conformance: all kinds of stores go through the same cases, as two machines see them."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from uuid import uuid4

import anyio
import numpy as np
import pytest
from obstore.store import MemoryStore

import geodesic_core as gc
from app.errors import ProblemError
from app.settings import Settings
from app.store.bucket import Bucket
from app.store.bucket_store import BucketStore
from app.store.choice import store_of
from app.store.layout import RESULTS, TEMPORARY, StoreError
from app.store.mesh_index import MeshIndex
from app.store.meshes import MeshStore, WrittenMesh
from app.store.results import SMALL, Result, write_result
from app.store.store import Store
from tests.support.waiting import LONG_S

pytestmark = pytest.mark.file_slice(5)

MESH = gc.samples.plane(20)
NOWHERE = "0" * 32


class Machine:
    """A machine that has the store, and a folder for its workers."""

    def __init__(self, store: Store, folder: Path) -> None:
        self.store = store
        self.folder = folder

    async def write(self, mesh: gc.TriangleMesh = MESH) -> WrittenMesh:
        """Write a mesh as a worker does, and send it where it is to be."""
        scratch = self.folder / TEMPORARY / uuid4().hex
        scratch.mkdir(parents=True)
        written = MeshStore(self.folder).write_aside(mesh, scratch / "mesh")
        if self.store.supply is not None:
            assert await self.store.supply.send_mesh(written)
        return written

    async def put(self, mesh: gc.TriangleMesh = MESH) -> str:
        """Put a new mesh into the store; return its id."""
        written = await self.write(mesh)
        await self.store.meshes.put(written)
        return written.mesh_id

    async def answer(self, name: str, body: bytes) -> Result:
        """Write a result as a worker does, and send it where it is to be."""
        root = self.folder / RESULTS
        result = write_result(root, name, [body], {"A": "b"}, "code", is_cheap=False)
        if self.store.supply is not None:
            await self.store.supply.send_result(result)
        return result

    async def array(self, mesh_id: str, name: str) -> Any:
        return np.load(await self.store.meshes.array_file(mesh_id, name))

    async def body(self, result: Result, start: int = 0) -> bytes:
        """Return the body of a result from an offset on."""
        body = self.store.results.body(result, lambda: None)
        if isinstance(body, Path):
            return body.read_bytes()[start:]
        assert body.size == result.manifest.size
        opened, parts = await body.open(), []
        if start:
            await opened.seek(start)
        while part := await opened.read(1000):
            parts.append(part)
        await opened.aclose()
        return b"".join(parts)


Machines = tuple[Machine, Machine]


@pytest.fixture(
    params=[
        "folder",
        "memory",
        pytest.param("s3", marks=pytest.mark.service),
        pytest.param("gcs", marks=pytest.mark.service),
        pytest.param("azure", marks=pytest.mark.service),
    ]
)
def new_store(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[Path], Store]:
    """A function that opens the same store on one machine more, with this folder."""
    kind = request.param
    if kind == "folder":
        return lambda _folder: store_of(Settings(store=tmp_path / "shared"))
    if kind == "memory":
        objects = Bucket(MemoryStore())
        return lambda folder: BucketStore(objects, folder, 10**9, "memory")
    url = request.getfixturevalue(kind).new_url()
    return lambda folder: store_of(Settings(store=url, copies=folder))


@pytest.fixture
def machines(new_store: Callable[[Path], Store], tmp_path: Path) -> Iterator[Machines]:
    """Two machines of one service, which has claimed the store."""
    found = []
    with ExitStack() as stack:
        for name in ("one", "two"):
            store = new_store(tmp_path / name)
            share = stack.enter_context(store.owned(is_shared=True))
            store.claim("a database")
            share.let_others_in()
            folder = tmp_path / ("shared" if store.supply is None else name)
            (folder / TEMPORARY).mkdir(exist_ok=True)
            found.append(Machine(store, folder))
        yield found[0], found[1]


async def code_of(call: Any) -> str:
    with pytest.raises(ProblemError) as caught:
        await call
    return caught.value.problem.code


@pytest.mark.anyio
async def test_a_mesh_of_one_machine_is_that_of_the_other(machines: Machines) -> None:
    one, two = machines
    mesh_id = await one.put()

    for machine in machines:
        meshes = machine.store.meshes
        manifest = await meshes.manifest(mesh_id)
        assert manifest["id"] == mesh_id
        record = await meshes.record(mesh_id)
        assert record is not None
        assert not record.is_pinned
        assert record.size > MESH.vertices.nbytes
        assert meshes.found() == {mesh_id: record}
        assert await meshes.is_intact(mesh_id)
    np.testing.assert_array_equal(await two.array(mesh_id, "vertices"), MESH.vertices)
    np.testing.assert_array_equal(await two.array(mesh_id, "faces"), MESH.faces)


@pytest.mark.anyio
async def test_arrays_that_a_mesh_does_not_have_are_not_found(machines: Machines) -> None:
    mesh_id = await machines[0].put()
    for name in ("nonsense", "vertex_map"):
        assert await code_of(machines[1].array(mesh_id, name)) == "not_found"


@pytest.mark.anyio
@pytest.mark.parametrize("mesh_id", [NOWHERE, "..", "nonsense", ""])
async def test_a_mesh_that_is_not_there(machines: Machines, mesh_id: str) -> None:
    meshes = machines[0].store.meshes
    assert await code_of(meshes.manifest(mesh_id)) == "mesh_not_found"
    assert await code_of(meshes.array_file(mesh_id, "faces")) == "mesh_not_found"
    if mesh_id == NOWHERE:
        assert await meshes.record(mesh_id) is None
        assert not await meshes.is_intact(mesh_id)
        await meshes.remove(mesh_id)
    assert meshes.found() == {}


@pytest.mark.anyio
async def test_meshes_are_listed_in_pages(machines: Machines) -> None:
    one, two = machines
    index = MeshIndex(two.store.meshes)
    assert await index.page(2, "", None) == ([], None)
    ids = [await one.put(gc.samples.plane(faces)) for faces in (2, 8, 18)]
    first, cursor = await index.page(2, "", None)
    second, end = await index.page(2, cursor or "", None)
    found = [*first, *second]
    assert (len(first), end) == (2, None)
    assert {each["id"] for each in found} == set(ids)
    times = [each["created"] for each in found]
    assert times == sorted(times, reverse=True)
    assert await index.page(2, "", "no such name") == ([], None)
    await two.store.meshes.remove(ids[0])
    assert {each["id"] for each in (await index.page(9, "", None))[0]} == set(ids[1:])


@pytest.mark.anyio
async def test_a_mesh_that_is_not_put_is_not_there(machines: Machines) -> None:
    written = await machines[0].write()
    await machines[0].store.meshes.discard(written)
    for machine in machines:
        assert await machine.store.meshes.record(written.mesh_id) is None
        assert await code_of(machine.store.meshes.manifest(written.mesh_id)) == "mesh_not_found"
        assert machine.store.meshes.found() == {}


@pytest.mark.anyio
async def test_a_removed_mesh_is_gone_for_all_but_those_who_have_it_open(
    machines: Machines,
) -> None:
    one, two = machines
    mesh_id = await one.put()
    opened = np.load(await two.store.meshes.array_file(mesh_id, "vertices"), mmap_mode="r")

    await one.store.meshes.remove(mesh_id)
    two.store.meshes.distrust(mesh_id)  # it need not look again at once
    for machine in machines:
        assert await code_of(machine.store.meshes.manifest(mesh_id)) == "mesh_not_found"
        assert await code_of(machine.store.meshes.array_file(mesh_id, "faces")) == "mesh_not_found"
    np.testing.assert_array_equal(opened, MESH.vertices)
    assert await two.put() == mesh_id
    assert await one.store.meshes.is_intact(mesh_id)


@pytest.mark.anyio
async def test_the_files_of_a_mesh_are_replaced(machines: Machines) -> None:
    one, two = machines
    mesh_id = await one.put()
    before = await two.array(mesh_id, "faces")
    path = Path(await one.store.meshes.array_file(mesh_id, "faces"))
    path.write_bytes(path.read_bytes()[:-1] + b"x")  # of the store, or of the copy

    written = await one.write()
    assert written.folder is not None, "it is not intact here"
    await one.store.meshes.put(written)
    for machine in machines:
        if machine.store.supply is not None:
            await machine.store.supply.drop_copy(mesh_id)
        machine.store.meshes.distrust(mesh_id)
        assert await machine.store.meshes.is_intact(mesh_id)
        np.testing.assert_array_equal(await machine.array(mesh_id, "faces"), before)
        assert list(machine.store.meshes.found()) == [mesh_id]


@pytest.mark.anyio
@pytest.mark.parametrize("size", [0, 100, SMALL, SMALL + 1, 3 * SMALL])
async def test_a_result_of_one_machine_is_read_by_the_other(machines: Machines, size: int) -> None:
    one, two = machines
    content = np.random.default_rng(size).bytes(size)
    written = await one.answer(f"{NOWHERE}/key", content)

    found = await two.store.results.read(written.name)
    assert found is not None
    assert (found.name, found.manifest, found.has_files) == (written.name, written.manifest, True)
    assert found.body == (content if size <= SMALL else None)
    assert await two.body(found) == content
    assert await two.body(found, size // 2) == content[size // 2 :]
    assert await two.store.results.size(written.name) == size
    assert list(two.store.results.found()) == [(written.name, size)]


@pytest.mark.anyio
async def test_a_result_in_memory_is_written(machines: Machines) -> None:
    one, two = machines
    written = await one.answer(f"{NOWHERE}/first", b"content")
    await two.store.results.write(f"{NOWHERE}/second", b"content", written.manifest)
    found = await one.store.results.read(f"{NOWHERE}/second")
    assert found is not None
    assert (found.body, found.manifest) == (b"content", written.manifest)


@pytest.mark.anyio
async def test_a_result_is_written_again(machines: Machines) -> None:
    """The same answer may come with other figures about its computation."""
    one, two = machines
    name = f"{NOWHERE}/key"
    await one.answer(name, b"first")
    await two.answer(name, b"another")
    for machine in machines:
        found = await machine.store.results.read(name)
        assert found is not None
        assert found.body == await machine.body(found) == b"another"
        assert list(machine.store.results.found()) == [(name, 7)]


@pytest.mark.anyio
async def test_a_removed_result_is_gone(machines: Machines) -> None:
    one, two = machines
    names = [f"{NOWHERE}/{key}" for key in ("one", "two")]
    for name in names:
        await one.answer(name, b"content")
    two.store.results.remove(names[0])
    two.store.results.remove(f"{NOWHERE}/nothing")

    with anyio.fail_after(LONG_S):
        while await one.store.results.read(names[0]) is not None:  # it goes in the background
            await anyio.sleep(0.01)
    assert await one.store.results.size(names[0]) is None
    assert await one.store.results.size(names[1]) == 7
    one.store.results.note_use(names[1])


@pytest.mark.anyio
async def test_a_file_that_is_lent_reaches_the_other_machine(machines: Machines) -> None:
    one, two = machines
    relative = Path(TEMPORARY) / "upload" / "file"
    file = one.folder / relative
    file.parent.mkdir()
    file.write_bytes(b"content")
    async with one.store.lent(file):
        if two.store.supply is None:
            assert (two.folder / relative).read_bytes() == b"content"
        else:
            folder = two.folder / TEMPORARY / "upload" / "mesh"
            async with two.store.supply.bringing(two.folder / relative, folder):
                assert (two.folder / relative).read_bytes() == b"content"
            assert not (two.folder / relative).exists()


def test_a_store_that_nobody_has_made_is_refused(
    new_store: Callable[[Path], Store], tmp_path: Path
) -> None:
    store = new_store(tmp_path / "one")
    with pytest.raises(StoreError, match="there is no store at"):
        store.identity()
    with store.owned(is_shared=True):
        store.claim("a database")
        assert store.identity() == store.identity() != ""


def test_all_machines_see_one_identity_of_a_store(machines: Machines) -> None:
    one, two = machines
    assert one.store.identity() == two.store.identity()


def test_two_stores_of_one_service_have_two_identities(tmp_path: Path) -> None:
    stores: list[Store] = [
        *(Store(tmp_path / name) for name in ("one", "two")),
        *(
            BucketStore(Bucket(MemoryStore()), tmp_path / "copies", 10**9, name)
            for name in ("three", "four")
        ),
    ]
    for store in stores:
        with store.owned(is_shared=True):
            store.claim("a database")
    assert len({store.identity() for store in stores}) == len(stores)


@pytest.mark.parametrize("service", ["another database", None])
def test_a_store_that_others_use_is_refused(
    machines: Machines,
    new_store: Callable[[Path], Store],
    tmp_path: Path,
    service: str | None,
) -> None:
    store = new_store(tmp_path / "three")

    def start() -> None:
        with store.owned(is_shared=service is not None):
            store.claim(service)

    with pytest.raises(StoreError, match="GEODESIC_STATE"):
        start()
    for machine in machines:
        machine.store.claim("a database")


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"

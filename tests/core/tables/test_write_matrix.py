"""Matrices in files: the same distances in each format, and after any number of stops."""

import errno
import json
import math
import multiprocessing
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import zarr
from scipy.sparse import load_npz

import geodesic_core as gc
from geodesic_core.search import plan, threads
from geodesic_core.search.order import sweep_order
from geodesic_core.tables.blocks import Blocks
from geodesic_core.tables.formats import sha256_of
from tests.core.fields.test_points import EXACT, random_points
from tests.support import zoo
from tests.support.faults import flip_bytes
from tests.support.meshes import mesh_of
from tests.support.oracles import unfolding
from tests.support.splitting import split_at
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(5)

SUFFIXES = (".npy", ".zarr", ".npz", ".parquet")


def read(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Return the matrix of a file, infinite where it has nothing, by the format's own reader."""
    match path.suffix:
        case ".npy":
            return np.load(path)
        case ".zarr":
            return zarr.open_array(path, mode="r")[:]
    table = np.full(shape, math.inf)
    if path.suffix == ".npz":
        entries = load_npz(path).tocoo()
        table[entries.row, entries.col] = entries.data
    else:
        columns = pyarrow.parquet.read_table(path).to_pydict()
        table[columns["source"], columns["target"]] = columns["distance"]
    return table


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "_BLOCK_ROWS", 3)


@pytest.fixture(scope="module")
def mesh() -> gc.TriangleMesh:
    return gc.samples.sphere(320)


@pytest.mark.slice(2)
@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("suffix", SUFFIXES)
@zoo.each(zoo.SMALL)
def test_distances_are_those_of_the_oracle(case, suffix, tmp_path):
    mesh = mesh_of(case)
    points = random_points(mesh, 11, seed=3)
    vertices, faces, at = split_at(mesh, points)
    expected = unfolding.distance_matrix(vertices, faces)[np.ix_(at, at)]
    out, atol = tmp_path / f"table{suffix}", 1e-12 * mesh.diagonal
    for sources, targets in ((11, None), (11, 4), (4, 11), (11, 11)):
        stops = None if targets is None else points[:targets]
        written = gc.write_matrix(mesh, out, points[:sources], stops)
        cells = expected[:sources, : targets or sources]
        assert written.shape == cells.shape
        table = read(out, cells.shape)
        np.testing.assert_allclose(table, cells, rtol=EXACT, atol=atol)
        if targets is None:
            np.testing.assert_array_equal(table, table.T)
        assert sorted(path.name for path in tmp_path.iterdir()) == [out.name, f"{out.name}.json"]


@pytest.mark.slow
@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "options",
    [
        {"method": "approximate", "relative_error": 1e-2},
        {"method": "fast", "effort": 4},
        {"max_distance": 0.7},
        {"barriers": range(40), "dtype": "float32"},
    ],
    ids=str,
)
@pytest.mark.jit
def test_each_row_is_that_of_a_field(mesh, suffix, options, tmp_path):
    points = [*range(0, 160, 12), gc.SurfacePoint.face(200, (0.2, 0.3, 0.5))]
    out = tmp_path / f"table{suffix}"
    written = gc.write_matrix(mesh, out, points, "all", **options)
    table = read(out, written.shape)
    solve = {"approximate": gc.approximate_distance, "fast": gc.fast_distance}.get(
        options.get("method"), gc.exact_distance
    )
    single = {"method", "dtype"}
    rest = {name: value for name, value in options.items() if name not in single}
    fields = [solve(mesh, point, **rest) for point in points]
    rtol = 1e-7 if "dtype" in options else 1e-13
    np.testing.assert_allclose(table, [field.distances for field in fields], rtol=rtol, atol=1e-15)
    assert written.error_bound == fields[0].error_bound


@pytest.mark.jit
@pytest.mark.usefixtures("small_blocks")
def test_the_file_tells_what_was_asked(mesh, tmp_path):
    facts = {}
    for suffix in SUFFIXES:
        out = tmp_path / f"table{suffix}"
        written = gc.write_matrix(mesh, out, [0, 5, 9], [1, 2], method="approximate")
        facts[suffix] = json.loads((tmp_path / f"{out.name}.json").read_text())
        assert facts[suffix].pop("sha256") == written.sha256
        assert facts[suffix]["error_bound"] == {
            "type": "relative",
            "value": 1e-3,
            "kind": "guaranteed",
        }
        assert facts[suffix]["shape"] == [3, 2]
    schema = pyarrow.parquet.read_schema(tmp_path / "table.parquet")
    assert json.loads(schema.metadata[b"geodesic"]) == facts[".parquet"]
    attributes = zarr.open_array(tmp_path / "table.zarr", mode="r").attrs.asdict()
    assert attributes == facts[".zarr"]


KILLED = """
import sys
import geodesic_core as gc
from geodesic_core.search import plan
from geodesic_core.tables.blocks import Blocks
from geodesic_core.tables.formats import sha256_of

plan._BLOCK_ROWS = 2
mesh = gc.samples.sphere(1280)
print(gc.write_matrix(mesh, sys.argv[1], range(0, 640, 10), threads=2).swept)
"""


def run_killed(out: Path, blocks: int) -> int:
    """Run the script, and kill it when there are so many blocks; return its exit code."""
    process = subprocess.Popen([sys.executable, "-c", KILLED, out], stdout=subprocess.DEVNULL)  # noqa: S603 - this Python
    folder = out.with_name(f".{out.name}.part")
    wait_until(lambda: len(list(folder.glob("*.crc32"))) >= blocks or process.poll() is not None)
    process.kill()
    return process.wait()


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npy", pytest.param(".npz", marks=pytest.mark.full)])
def test_a_process_that_is_killed_goes_on_where_it_was(suffix, tmp_path):
    whole, out = tmp_path / f"whole{suffix}", tmp_path / f"killed{suffix}"
    command = [sys.executable, "-c", KILLED]
    expected = subprocess.run([*command, whole], check=True, capture_output=True, text=True)  # noqa: S603 - this Python
    assert int(expected.stdout) == 64
    for blocks in (1, 9, 20):
        assert run_killed(out, blocks) == -signal.SIGKILL
    last = subprocess.run([*command, out], check=True, capture_output=True, text=True)  # noqa: S603 - this Python
    assert int(last.stdout) <= 24
    assert out.read_bytes() == whole.read_bytes()


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.jit
def test_a_stop_loses_no_block_and_a_damaged_block_is_made_again(
    mesh, suffix, tmp_path, monkeypatch
):
    whole, out = (tmp_path / f"{name}{suffix}" for name in ("whole", "stopped"))
    points = range(0, 160, 4)
    gc.write_matrix(mesh, whole, points, threads=1)
    folder = tmp_path / f".{out.name}.part"
    put = Blocks.put

    def put_until_the_disk_is_full(blocks: Blocks, block: int, array: np.ndarray) -> None:
        if block == 5:
            raise OSError(errno.ENOSPC, "No space left on device")
        put(blocks, block, array)

    monkeypatch.setattr(Blocks, "put", put_until_the_disk_is_full)
    with pytest.raises(OSError, match="No space"):
        gc.write_matrix(mesh, out, points, threads=1)
    monkeypatch.setattr(Blocks, "put", put)
    flip_bytes(folder / "0.npy")
    assert gc.write_matrix(mesh, out, points).swept == len(points) - 3 * 4
    assert sha256_of(out) == sha256_of(whole)


@pytest.mark.jit
@pytest.mark.usefixtures("small_blocks")
def test_files_do_not_depend_on_the_number_of_threads(mesh, tmp_path):
    digests = {
        gc.write_matrix(mesh, tmp_path / "table.npy", range(0, 160, 5), threads=n).sha256
        for n in (1, 2, 5)
    }
    assert len(digests) == 1


@pytest.mark.jit
@pytest.mark.parametrize("method", ["exact", "fast"])
def test_threads_are_as_many_as_memory_allows(mesh, tmp_path, monkeypatch, method):
    counts = []
    share_out = threads.share_out

    def counted(parts, workers, control):
        counts.append(len(workers))
        share_out(parts, workers, control)

    solver = gc.Solver(mesh)
    solver.distance_matrix(0, range(9))
    field = gc.fast_distance(mesh, 0, retain="distances")
    needed = solver.nbytes if method == "exact" else field.stats.peak_bytes
    monkeypatch.setattr(threads, "share_out", counted)
    out, points, digests = tmp_path / "table.npy", range(0, 160, 5), set()
    for limit in (1.5, 5, 50, None):
        memory = None if limit is None else int(limit * needed)
        written = gc.write_matrix(mesh, out, points, method=method, threads=3, memory_limit=memory)
        digests.add(written.sha256)
    assert counts == [1, 2, 3, 3]
    assert len(digests) == 1
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        gc.write_matrix(mesh, out, points, method=method, memory_limit=int(0.4 * needed))


@pytest.mark.jit
def test_part_of_another_table_is_not_mixed_in(mesh, tmp_path):
    out = tmp_path / "table.npy"
    with pytest.raises(gc.errors.Cancelled):
        gc.write_matrix(mesh, out, range(9), cancel=(tmp_path / ".table.npy.part").exists)
    for sources, options in ((range(8), {}), (range(9), {"dtype": "float32"})):
        with pytest.raises(gc.errors.InvalidArgument, match=r"holds part of another table.*remove"):
            gc.write_matrix(mesh, out, sources, **options)
    assert gc.write_matrix(mesh, out, range(9)).shape == (9, 9)


def hold(mesh: gc.TriangleMesh, out: Path, has_begun, may_end) -> None:
    """Write a table, and stop in the middle of it until told."""

    def cancel() -> bool:
        if out.with_name(f".{out.name}.part").exists():
            has_begun.set()
            may_end.wait()
        return False

    gc.write_matrix(mesh, out, range(9), cancel=cancel)


def test_a_file_that_cannot_be_written_is_refused(mesh):
    with pytest.raises(gc.errors.InvalidArgument, match=r"table\.npy cannot be written: "):
        gc.write_matrix(mesh, "/proc/table.npy", range(9))


@pytest.mark.jit
@pytest.mark.slow
def test_two_processes_do_not_write_one_table(mesh, tmp_path):
    out, context = tmp_path / "table.npy", multiprocessing.get_context("spawn")
    has_begun, may_end = context.Event(), context.Event()
    other = context.Process(target=hold, args=(mesh, out, has_begun, may_end))
    other.start()
    has_begun.wait()
    with pytest.raises(gc.errors.InvalidArgument, match=r"another process is writing table\.npy"):
        gc.write_matrix(mesh, out, range(9))
    may_end.set()
    other.join()
    assert other.exitcode == 0
    assert np.load(out).shape == (9, 9)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"out": "table.csv"}, r"suffix of out is '\.csv'; it must be '\.npy'.* or '\.parquet'"),
        ({"out": "missing/table.npy"}, "there is no folder .*missing"),
        ({"sources": []}, "there are no sources"),
        ({"targets": []}, "there are no targets"),
        ({"sources": "some"}, "sources is 'some'"),
        ({"method": "quick"}, "method is 'quick'"),
        ({"method": "fast", "effort": 3}, "effort is 3"),
        ({"method": "approximate", "relative_error": 0}, "relative_error is 0"),
        ({"dtype": "float16"}, "dtype is 'float16'"),
        ({"threads": 0}, "threads is 0"),
        ({"max_distance": -1}, "max_distance is -1"),
        ({"barriers": [-1]}, "barrier 0 is face -1"),
    ],
)
def test_bad_arguments_are_named_before_anything_is_written(mesh, changed, message, tmp_path):
    arguments = {"out": "table.npy", "sources": [0, 1]} | changed
    out = tmp_path / arguments.pop("out")
    with pytest.raises(gc.errors.InvalidArgument, match=message):
        gc.write_matrix(mesh, out, **arguments)
    assert list(tmp_path.iterdir()) == []


def test_blocks_do_not_grow_with_the_table(mesh, monkeypatch):
    monkeypatch.setattr(plan, "_BLOCK_BYTES", 1 << 14)
    held = []
    for count in (20, 80, 160):
        planned = plan.Plan.of(
            mesh, [mesh.point(i) for i in range(count)], None, gc.Control(), in_order=False
        )
        held.append(planned.block_rows * planned.width * 8)
    assert max(held) <= 1 << 14


def test_the_order_of_sweeps_is_one_and_keeps_those_left_together():
    rng = np.random.default_rng(1)
    positions = rng.random((200, 3)) * (10, 1, 1)
    order = sweep_order(positions)
    np.testing.assert_array_equal(np.sort(order), np.arange(200))

    def reach(order: np.ndarray) -> float:
        placed = positions[order]
        return sum(np.linalg.norm(placed[k:] - placed[k], axis=1).max() for k in range(200))

    assert reach(order) < 0.7 * reach(np.arange(200))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_of_other_data_is_not_replaced(suffix, tmp_path):
    mesh = gc.samples.plane(2)
    out = tmp_path / f"table{suffix}"
    zarr.create_group(out).create_array("other", shape=(1,), dtype="f8")
    held = sorted(out.rglob("*"))
    with pytest.raises(gc.GeodesicError, match="is a folder that may hold other data"):
        gc.write_matrix(mesh, out, "all")
    assert sorted(out.rglob("*")) == held


def test_an_earlier_zarr_array_is_replaced(tmp_path):
    mesh, out = gc.samples.plane(2), tmp_path / "table.zarr"
    gc.write_matrix(mesh, out, "all")
    gc.write_matrix(mesh, out, [0, 1], [3])
    assert zarr.open_array(out, mode="r").shape == (2, 1)

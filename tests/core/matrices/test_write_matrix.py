"""Matrices in files: the same distances in each format, and after any number of stops."""

import errno
import itertools
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
from geodesic_core.matrices import driver, matrix_file, plan, threads
from geodesic_core.matrices.blocks import Blocks
from geodesic_core.matrices.formats import sha256_of
from geodesic_core.matrices.plan import sweep_order
from geodesic_core.search.target_sweep import TargetSweep
from tests.core.fields.test_points import EXACT
from tests.support import zoo
from tests.support.faults import flip_bytes
from tests.support.meshes import mesh_of, random_points
from tests.support.oracles import unfolding
from tests.support.splitting import split_at

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
    monkeypatch.setattr(driver, "_PART_ROWS", 1)


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
        {"method": "fast", "effort": 2},
        {"max_distance": 0.7},
        {"barriers": range(8, 48), "dtype": "float32"},
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
        assert facts[suffix]["sources"] == [0, 5, 9]
        assert facts[suffix]["targets"] == [1, 2]
        assert facts[suffix]["barriers"] == []
    schema = pyarrow.parquet.read_schema(tmp_path / "table.parquet")
    assert json.loads(schema.metadata[b"geodesic"]) == facts[".parquet"]
    attributes = zarr.open_array(tmp_path / "table.zarr", mode="r").attrs.asdict()
    assert attributes == facts[".zarr"]


@pytest.mark.jit
def test_the_facts_hold_all_that_the_table_is_made_from(mesh, tmp_path):
    """By them alone the same table is made again."""
    inside = gc.SurfacePoint.face(np.int64(200), (0.2, 0.3, 0.5))
    on_edge = mesh.point(gc.SurfacePoint.edge(7, 1, 0.25))
    questions = [
        (np.array([3, 7]), None, {}),
        ([9, inside, on_edge, gc.SurfacePoint.vertex(4)], [0], {"method": "fast", "effort": 2}),
        ("all", [inside], {"barriers": [31, 30], "max_distance": 0.75}),
        ([5], "all", {"method": "approximate", "relative_error": None, "absolute_error": 0.01}),
        ("all", None, {"dtype": "float32", "max_distance": 0.5}),
        (range(len(mesh.vertices)), None, {}),
    ]

    def point_of(written):
        if isinstance(written, int):
            return written
        return gc.SurfacePoint.face(written["face"], tuple(written["barycentric"]))

    def side_of(written):
        return written if written == "all" else [point_of(each) for each in written]

    for sources, targets, options in questions:
        out = tmp_path / "table.npy"
        written = gc.write_matrix(mesh, out, sources, targets, **options)
        text = (tmp_path / "table.npy.json").read_text()
        facts = json.loads(text)
        assert facts["sha256"] == written.sha256
        sides = [facts["sources"], facts["targets"]]
        for side, count in zip(sides, written.shape, strict=True):
            assert side == "all" or len(side) == count
        names = "method", "relative_error", "absolute_error", "effort", "max_distance", "barriers"
        asked = {name: facts[name] for name in (*names, "dtype") if name in facts}
        again = gc.write_matrix(mesh, tmp_path / "again.npy", *map(side_of, sides), **asked)
        assert again.sha256 == written.sha256
        assert json.loads((tmp_path / "again.npy.json").read_text()) == facts
        assert len(text.splitlines()) == len(facts) + 2
    assert facts["sources"] == list(range(len(mesh.vertices)))


KILLED = """
import os, signal, sys
import geodesic_core as gc
from geodesic_core.matrices import plan
from geodesic_core.matrices import matrix_file
from geodesic_core.matrices.blocks import Blocks

out, size, rows, blocks = sys.argv[1], *map(int, sys.argv[2:])

def killing(method, is_time):
    def then_kill(self, *arguments):
        method(self, *arguments)
        if is_time(self):
            os.kill(os.getpid(), signal.SIGKILL)
    return then_kill

if rows:
    Blocks.keep = killing(Blocks.keep, lambda kept: len(kept.kept(0)) >= rows)
if blocks:
    Blocks.put = killing(Blocks.put, lambda put: len(list(put.folder.glob("*.crc32"))) >= blocks)
plan._BLOCK_ROWS = size
matrix_file._KEPT_SECONDS = 0.0
mesh = gc.samples.sphere(1280)
print(gc.write_matrix(mesh, out, range(0, 640, 10), threads=2).swept)
"""


def run(
    out: Path, size: int, *, rows: int = 0, blocks: int = 0
) -> subprocess.CompletedProcess[str]:
    """Run the script with blocks of a size, until so many rows of the first or blocks are kept."""
    command = [sys.executable, "-c", KILLED, out, *map(str, (size, rows, blocks))]
    return subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - this Python


def run_to_its_end(out: Path, size: int) -> int:
    """Run the script with blocks of so many rows; return the number of rows that it computed."""
    done = run(out, size)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


class Stopped:
    """A matrix that is stopped by its caller after some rows, in one block."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.rows, self.end = 0, math.inf
        rows = TargetSweep.rows

        def counted(*arguments):
            if self.rows == self.end:  # a call asks `cancel` by the clock, not after each row
                raise gc.errors.Cancelled("cancelled by the test")
            self.rows += 1
            return rows(*arguments)

        monkeypatch.setattr(driver, "_PART_ROWS", 1)
        monkeypatch.setattr(TargetSweep, "rows", counted)

    def write(self, mesh: gc.TriangleMesh, out: Path, after: int, **options) -> None:
        """Write until so many rows more are done."""
        self.end = self.rows + after
        with pytest.raises(gc.errors.Cancelled):
            gc.write_matrix(mesh, out, range(0, 160, 4), threads=1, **options)
        self.end = math.inf


@pytest.mark.jit
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_call_that_is_cancelled_within_a_block_goes_on_after_it(
    mesh, suffix, tmp_path, monkeypatch
):
    """However short the time was: nothing that is done is lost."""
    whole, out, count = tmp_path / f"whole{suffix}", tmp_path / f"stopped{suffix}", 40
    gc.write_matrix(mesh, whole, range(0, 160, 4))
    stopped = Stopped(monkeypatch)
    monkeypatch.setattr(matrix_file, "_KEPT_SECONDS", math.inf)
    folder = Blocks.beside(out)
    for after in (5, 12):
        stopped.write(mesh, out, after)
    kept = len(folder.kept(0))
    assert kept == 17
    began = stopped.rows
    assert gc.write_matrix(mesh, out, range(0, 160, 4)).swept == count - kept
    assert stopped.rows == began + count - kept
    assert sha256_of(out) == sha256_of(whole)
    assert not folder.folder.exists()


@pytest.mark.jit
def test_rows_are_kept_once_their_time_has_come(mesh, tmp_path, monkeypatch):
    """By a clock of the test: each row takes two of its seconds."""
    clock = itertools.count(0, 2)
    monkeypatch.setattr(matrix_file.time, "monotonic", lambda: 0.0)
    kept: list[int] = []

    def keep(_blocks: Blocks, block: int, rows: dict) -> None:
        assert block == 0
        kept.append(len(rows))

    monkeypatch.setattr(driver, "_PART_ROWS", 1)
    monkeypatch.setattr(Blocks, "keep", keep)
    gc.write_matrix(mesh, tmp_path / "table.npy", range(20), threads=1)
    assert kept == []
    monkeypatch.setattr(matrix_file.time, "monotonic", lambda: float(next(clock)))
    gc.write_matrix(mesh, tmp_path / "table.npy", range(20), threads=1)
    assert kept == [3, 6, 9, 12, 15, 18]


@pytest.mark.jit
@pytest.mark.parametrize("at", [0, 3, 20, -1])
def test_kept_rows_that_are_damaged_are_computed_again(mesh, at, tmp_path, monkeypatch):
    whole, out = tmp_path / "whole.npy", tmp_path / "stopped.npy"
    gc.write_matrix(mesh, whole, range(0, 160, 4))
    Stopped(monkeypatch).write(mesh, out, 9)
    path = tmp_path / ".stopped.npy.part" / "0.rows"
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)
    assert gc.write_matrix(mesh, out, range(0, 160, 4)).swept == 40
    assert out.read_bytes() == whole.read_bytes()


@pytest.mark.jit
def test_a_full_disk_does_not_hide_why_a_call_stopped(mesh, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Blocks, "keep", full)
    Stopped(monkeypatch).write(mesh, tmp_path / "table.npy", 3)


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npy", pytest.param(".npz", marks=pytest.mark.full)])
def test_a_process_that_is_killed_goes_on_where_it_was(suffix, tmp_path):
    whole, out = tmp_path / f"whole{suffix}", tmp_path / f"killed{suffix}"
    assert run_to_its_end(whole, 2) == 64
    for blocks in (1, 9, 20):
        assert run(out, 2, blocks=blocks).returncode == -signal.SIGKILL
    assert run_to_its_end(out, 2) <= 24
    assert out.read_bytes() == whole.read_bytes()


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".npy", pytest.param(".npz", marks=pytest.mark.full)])
def test_a_process_that_is_killed_within_a_block_keeps_the_rows_that_are_done(suffix, tmp_path):
    whole, out = tmp_path / f"whole{suffix}", tmp_path / f"killed{suffix}"
    assert run_to_its_end(whole, 64) == 64

    assert run(out, 64, rows=20).returncode == -signal.SIGKILL
    assert not list(tmp_path.glob(".*/*.crc32")), "the only block is not complete"
    assert 0 < run_to_its_end(out, 64) <= 44
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

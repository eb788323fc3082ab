"""Results: what is held, what goes, and what is refused."""

import os
import time
import tracemalloc
import zlib
from pathlib import Path

import anyio
import pytest

from app.errors import ProblemError
from app.store import folder
from app.store.folder import Folder
from app.store.results import (
    SMALL,
    Result,
    ResultFiles,
    ResultStore,
    write_result,
    write_result_file,
)
from tests.support.faults import flip_bytes


def opened(
    root: Path, capacity: int = 100, memory: int = 0, quota: int | None = None
) -> ResultStore:
    files = Folder(root)
    files.is_alone = True
    store = ResultStore(ResultFiles(files), capacity, memory, quota)
    store.prepare()
    return store


@pytest.fixture
def results(tmp_path: Path) -> ResultStore:
    return opened(tmp_path)


def write(root: Path, name: str, size: int = 40, *, is_cheap: bool = False):
    parts = [b"x" * size]
    return write_result(root / "results", name, parts, {"A": "b"}, "code", is_cheap=is_cheap)


def put(results: ResultStore, root: Path, name: str, size: int = 40, **how: bool) -> None:
    results.release(results.add(write(root, name, size, **how)))


def find(results: ResultStore, name: str):
    found = anyio.run(results.find, name)
    if found is not None:
        results.release(found)
    return found


def test_a_result_comes_back(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")

    found = find(results, "m/a")

    assert found is not None
    assert results.body(found).read_bytes() == b"x" * 40
    assert found.manifest.headers == {"A": "b"}
    assert found.key == "a"


def test_the_least_recently_used_go_first(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "m/b")
    find(results, "m/a")
    put(results, tmp_path, "m/c")

    assert [find(results, f"m/{key}") is not None for key in "abc"] == [True, False, True]
    assert len(list((tmp_path / "results" / "m").iterdir())) == 4


def test_what_is_being_sent_stays(results: ResultStore, tmp_path: Path) -> None:
    sent = results.add(write(tmp_path, "m/a", 90))
    put(results, tmp_path, "m/b")

    assert results.body(sent).exists()
    results.release(sent)
    put(results, tmp_path, "m/c")
    assert not results.body(sent).exists()


def test_a_changed_result_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    flip_bytes(tmp_path / "results" / "m" / "a.body")

    assert find(results, "m/a") is None
    assert find(results, "m/a") is None


def test_a_broken_manifest_is_not_served(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    (tmp_path / "results" / "m" / "a.json").write_bytes(b"{")

    assert find(results, "m/a") is None


def test_the_answer_of_a_job_stays_where_a_start_has_to_make_room(
    results: ResultStore, tmp_path: Path
) -> None:
    for key, second in (("job", 1), ("new", 2)):
        put(results, tmp_path, f"m/{key}")
        os.utime(tmp_path / "results" / "m" / f"{key}.json", (second, second))

    restarted = opened(tmp_path, 50, 0)
    restarted.pin("m/job", "")
    restarted.make_room()

    assert find(restarted, "m/job") is not None
    assert find(restarted, "m/new") is None


def test_results_survive_a_restart(results: ResultStore, tmp_path: Path) -> None:
    for key, second in (("old", 1), ("new", 2)):
        put(results, tmp_path, f"m/{key}")
        os.utime(tmp_path / "results" / "m" / f"{key}.json", (second, second))
    (tmp_path / "results" / "m" / "incomplete.body").write_bytes(b"x")
    (tmp_path / "results" / "m" / "tmpabc").write_bytes(b"x")

    restarted = opened(tmp_path, 50, 0)
    restarted.make_room()

    assert find(restarted, "m/old") is None
    assert find(restarted, "m/new") is not None
    names = sorted(path.name for path in (tmp_path / "results" / "m").iterdir())
    assert names == ["new.body", "new.json"]


def test_results_of_a_mesh_are_forgotten(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    put(results, tmp_path, "n/a")

    results.forget_mesh("m")

    assert find(results, "m/a") is None
    assert find(results, "n/a") is not None


def test_small_results_are_in_memory_as_far_as_they_fit(tmp_path: Path) -> None:
    results = opened(tmp_path, 10**6, 2 * 4096 + 100)
    for key in "abc":
        put(results, tmp_path, f"m/{key}")
    put(results, tmp_path, "m/large", 2**17)

    found = {key: find(results, f"m/{key}").body for key in ("c", "b", "large", "a")}
    assert found == {"c": b"x" * 40, "b": b"x" * 40, "large": None, "a": b"x" * 40}
    flip_bytes(tmp_path / "results" / "m" / "a.body")
    assert find(results, "m/a").body == b"x" * 40, "read a moment ago"
    results.forget_mesh("m")
    assert find(results, "m/a") is None


def test_the_memory_of_small_results_is_counted_whole(tmp_path: Path) -> None:
    memory = 2**22
    results = opened(tmp_path, 10**6, memory)
    headers = {"Geodesic-Method": "exact", "Geodesic-Error": "0.0", "Geodesic-Vertices": "12"}

    def answer(number: int) -> Result:
        body = [b"%0136d" % number]
        return write_result(
            tmp_path, f"m/{number:064x}", body, dict(headers), "code", is_cheap=True
        )

    tracemalloc.start()
    for number in range(3000):
        results.release(results.add(answer(number)))
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert memory / 4 < taken < memory
    assert find(results, f"m/{2999:064x}") is not None


def test_what_is_held_stays_until_it_is_released(results: ResultStore, tmp_path: Path) -> None:
    put(results, tmp_path, "m/a")
    results.pin("m/a", "")
    other = results.add(write(tmp_path, "m/b", 61))
    with pytest.raises(ProblemError):
        results.pin_within_quota("m/b", "")
    results.release(other)
    results.forget_mesh("m")

    assert find(results, "m/a") is not None
    assert find(results, "m/b") is None
    results.unpin("m/a", "")
    put(results, tmp_path, "m/c", 61)
    assert find(results, "m/a") is None


@pytest.mark.usefixtures("results")
def test_a_failed_result_leaves_nothing(tmp_path: Path) -> None:
    parts: list = [b"x" * 2**17, None]
    with pytest.raises(TypeError):
        write_result(tmp_path / "results", "m/a", parts, {}, "code", is_cheap=False)
    assert not list((tmp_path / "results").glob("m/*"))


@pytest.fixture
def roomy(tmp_path: Path) -> ResultStore:
    return opened(tmp_path, 10**6, 2 * 4096 + 100)


def test_what_is_small_and_found_at_once_has_no_files(roomy: ResultStore, tmp_path: Path) -> None:
    put(roomy, tmp_path, "m/small", is_cheap=True)
    put(roomy, tmp_path, "m/large", 2**17, is_cheap=True)

    assert find(roomy, "m/small").body == b"x" * 40
    assert roomy.nbytes == 2**17
    names = sorted(path.name for path in (tmp_path / "results").glob("m/*"))
    assert names == ["large.body", "large.json"]
    for key in "ab":
        put(roomy, tmp_path, f"m/{key}", is_cheap=True)
    assert find(roomy, "m/small") is None, "memory is bounded, too"
    roomy.forget_mesh("m")
    assert find(roomy, "m/a") is None


def test_files_come_when_they_are_needed(roomy: ResultStore, tmp_path: Path) -> None:
    written = write(tmp_path, "m/a", is_cheap=True)
    taken = roomy.add(written)

    filed = anyio.run(roomy.with_files, taken)
    roomy.pin("m/a", "")
    roomy.release(filed)

    assert roomy.body(filed).read_bytes() == b"x" * 40
    assert filed.manifest == taken.manifest
    assert anyio.run(roomy.with_files, filed) is filed
    restarted = opened(tmp_path, 10**6, 0)
    assert find(restarted, "m/a").body == b"x" * 40


def test_what_gets_no_files_is_given_back(roomy: ResultStore, tmp_path: Path) -> None:
    taken = roomy.add(write(tmp_path, "m/a", is_cheap=True))
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "m").write_bytes(b"in the way")

    with pytest.raises(FileExistsError):
        anyio.run(roomy.with_files, taken)
    (tmp_path / "results" / "m").unlink()
    assert find(roomy, "m/a") is not None
    roomy.forget_mesh("m")
    assert find(roomy, "m/a") is None, "what is in use would stay"


def test_a_large_result_is_read_once_by_each_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clients read it in many ranges, each of which finds it again."""
    root, reads = tmp_path / "results", list[Path]()
    read = folder.checksum_of
    monkeypatch.setattr(folder, "checksum_of", lambda path: reads.append(path) or read(path))
    body = bytes(3 * SMALL)
    write = lambda file: file.write(body)  # noqa: E731
    result = write_result_file(root, "m/a", write, {}, "code", lambda: None)
    assert (result.manifest.size, result.manifest.crc32) == (len(body), zlib.crc32(body))
    store = opened(tmp_path, 10**6, 10**6)
    for _ in range(3):
        assert anyio.run(store.find, "m/a") == result
    assert len(reads) == 1
    flip_bytes(root / "m" / "a.body")
    assert anyio.run(opened(tmp_path, 10**6).find, "m/a") is None


def test_a_large_result_that_another_service_has_evicted_is_not_there(tmp_path: Path) -> None:
    store = opened(tmp_path, 10**6, 10**6)
    put(store, tmp_path, "m/a", 3 * SMALL)
    (tmp_path / "results" / "m" / "a.body").unlink()
    assert find(store, "m/a") is None
    assert store.nbytes == 0


def test_what_was_used_before_the_clock_was_set_back_goes_first(tmp_path: Path) -> None:
    for name in ("m/a", "m/b"):
        write(tmp_path, name)
    years_ahead = time.time() + 10 * 365 * 86_400
    os.utime(tmp_path / "results" / "m" / "b.json", (years_ahead, years_ahead))
    results = opened(tmp_path, 50)
    results.make_room()
    assert [path.name for path in tmp_path.glob("results/m/*.body")] == ["a.body"]


def test_room_is_reserved_among_pinned_results(tmp_path: Path) -> None:
    store = opened(tmp_path, 100, 0)
    store.add(write(tmp_path, "m/pinned", 40))
    store.pin("m/pinned", "")
    store.add(write(tmp_path, "m/other", 30))
    with store.reserving("", 50):
        with pytest.raises(ProblemError):
            store.pin_within_quota("m/other", "")
        with pytest.raises(ProblemError) as refused, store.reserving("", 11):
            pass
        problem = refused.value.problem
        assert (problem.code, problem.limit, problem.actual) == ("storage_full", 100, 101)
        assert problem.setting == "results_bytes"
        with store.reserving("", 0) as reserve:
            reserve(6)
            reserve(4)
            with pytest.raises(ProblemError) as refused:
                reserve(1)
            assert refused.value.problem.code == "storage_full"
        with store.reserving("", 10):
            pass
    store.pin_within_quota("m/other", "")


def test_the_answers_of_one_caller_s_jobs_leave_room_for_others(tmp_path: Path) -> None:
    """Both what is pinned and what is reserved count; a shared answer counts for each caller."""
    store = opened(tmp_path, 100, 0, quota=50)
    for name in ("m/a", "m/b", "m/c"):
        store.add(write(tmp_path, name, 30))
    store.pin_within_quota("m/a", "alice")
    store.pin_within_quota("m/a", "alice")
    with pytest.raises(ProblemError) as refused:
        store.pin_within_quota("m/b", "alice")
    problem = refused.value.problem
    assert (problem.code, problem.status) == ("quota_exceeded", 507)
    assert (problem.limit, problem.actual) == (50, 60)
    assert problem.setting == "quota_results_bytes"
    with store.reserving("alice", 20):
        with pytest.raises(ProblemError):
            store.refuse_without_room("alice", 1)
        with pytest.raises(ProblemError):
            store.pin_within_quota("m/b", "alice")
        store.pin_within_quota("m/a", "bob")
        store.refuse_without_room("bob", 20)
    store.unpin("m/a", "alice")
    store.unpin("m/a", "alice")
    store.pin_within_quota("m/b", "alice")

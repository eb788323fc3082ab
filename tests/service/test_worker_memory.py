"""Tasks that take more memory than their worker may."""

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.engine import memory
from app.settings import LEAST_WORKER_MEMORY
from tests.support.service import (
    TWO_TRIANGLES,
    ServiceClient,
    check_problem,
    distances,
    serving,
    upload_sample,
)

PLY = b"""ply
format binary_little_endian 1.0
element vertex 15000000
property char x
property char y
property char z
element face 1
property list uchar char vertex_indices
end_header
"""


LIMITED = """
import sys
import numpy as np
from app.engine.memory import limit_memory, refuse_beyond_limit

limit_memory(100_000_000)
limit_memory(150_000_000)  # a limit is never raised
mapped = np.memmap(sys.argv[1], "u1", "w+", shape=300_000_000)
for size, fits in ((50_000_000, True), (125_000_000, False), (50_000_000, True)):
    try:
        np.ones(size, "u1")
    except MemoryError:
        assert not fits
    else:
        assert fits
for size in (50_000_000, 125_000_000):
    try:
        refuse_beyond_limit(size)
    except MemoryError:
        assert size == 125_000_000
    else:
        assert size == 50_000_000
print(mapped.sum())
"""


def test_allocating_fails_beyond_the_limit_and_mapping_does_not(tmp_path: Path) -> None:
    ran = subprocess.run(  # noqa: S603 - this Python, and the text above
        [sys.executable, "-c", LIMITED, str(tmp_path / "mapped")],
        capture_output=True,
        text=True,
        check=False,
    )

    assert (ran.stdout, ran.stderr) == ("0\n", "")


def test_elsewhere_there_is_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a system without the files by which Linux tells of a process."""
    monkeypatch.setattr(Path, "is_file", lambda path: not path.is_relative_to("/proc"))
    monkeypatch.setattr(resource, "setrlimit", lambda *_: pytest.fail("must not be set"))

    memory.limit_memory(1)
    memory.refuse_beyond_limit(2**60)


@pytest.fixture(scope="module")
def tight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    """A service whose worker has as little memory as there can be."""
    memory = {"worker_memory_bytes": LEAST_WORKER_MEMORY, "query_memory_bytes": LEAST_WORKER_MEMORY}
    with serving(tmp_path_factory.mktemp("tight"), **memory) as client:
        client.wait_until_idle()
        yield client


def test_an_upload_that_takes_too_much_is_refused_and_the_worker_lives(
    tight: ServiceClient,
) -> None:
    workers = tight.workers()
    vertices = b"\0\0\0\1\0\0\0\1\0" * 5_000_000  # 45 MB, which become 360 as numbers
    data = PLY + vertices + b"\3\0\1\2"

    for _ in range(2):
        response = tight.post("/v1/meshes", params={"format": "ply"}, content=data)
        problem = check_problem(response, 422, "memory_limit")
        assert problem["limit"] == LEAST_WORKER_MEMORY
        assert problem["setting"] == "worker_memory_bytes"

    assert tight.post("/v1/meshes", json=TWO_TRIANGLES).status_code in (200, 201)
    assert tight.workers() == workers


def test_json_that_takes_too_much_is_refused_and_the_worker_lives(tight: ServiceClient) -> None:
    workers = tight.workers()
    vertices = b",".join([b"[0,0,0]"] * 2_000_000)
    response = tight.post(
        "/v1/meshes",
        content=b'{"vertices":[%s],"faces":[[0,1,2]]}' % vertices,
        headers={"Content-Type": "application/json"},
    )

    problem = check_problem(response, 422, "memory_limit")
    assert problem["setting"] == "worker_memory_bytes"
    assert tight.workers() == workers


def test_a_query_that_takes_too_much_is_refused_and_the_next_is_not(tight: ServiceClient) -> None:
    mesh_id = upload_sample(tight, "knot", 150_000)
    workers = tight.workers()

    # For so many levels nearly all windows are kept: half a gigabyte.
    lines = {"sources": [{"vertex": 0}], "count": 500}
    response = tight.post(f"/v1/meshes/{mesh_id}/isolines", json=lines)

    problem = check_problem(response, 422, "memory_limit")
    assert problem["limit"] == LEAST_WORKER_MEMORY
    assert problem["setting"] == "worker_memory_bytes"
    assert distances(tight, mesh_id, targets=[{"vertex": 1}]).status_code == 200
    assert tight.workers() == workers

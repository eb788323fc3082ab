"""A head whose records are in Redis: they outlive its machine."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.cluster import HOST, TOKEN, Command, ProcessCluster, running_cluster
from tests.support.redis import SECRET, Redis
from tests.support.waiting import wait_until

pytest.importorskip("ray")


@pytest.fixture
def cluster(redis_server: Redis, tmp_path: Path) -> Iterator[ProcessCluster]:
    with running_cluster(tmp_path / "store", GEODESIC_REDIS=redis_server.url()) as cluster:
        yield cluster


def hosts(cluster: ProcessCluster) -> int:
    asked = cluster.run("cluster", "status")
    asked.process.wait()
    return asked.said.count("workers busy")


@pytest.mark.full
def test_a_head_on_another_machine_knows_the_hosts(
    cluster: ProcessCluster, redis_server: Redis
) -> None:
    place = f"{redis_server.host}:{redis_server.port}"
    listening = f"the head listens at {HOST}:{cluster.port}; its records stay in the Redis"
    assert f"{listening} at {place} when it stops\n" in cluster.head.said
    node = cluster.add_node()
    wait_until(lambda: hosts(cluster) == 1 and len(node.workers()) == 2)
    workers = node.workers()

    cluster.head.kill()
    port = str(cluster.port)
    cluster.head = cluster.run(
        "head", "--host", HOST, "--port", port, "--dir", str(cluster.folder / "another")
    )
    wait_until(lambda: hosts(cluster) == 1)
    assert workers == node.workers()
    assert SECRET not in cluster.head.said


@pytest.mark.full
def test_a_head_whose_redis_dies_ends(cluster: ProcessCluster, redis_server: Redis) -> None:
    redis_server.close()

    assert cluster.head.process.wait() == 1
    assert "error: Ray has stopped on this machine" in cluster.head.said


def test_a_head_that_has_no_redis_says_so(tmp_path: Path) -> None:
    arguments = ["--host", HOST, "--port", "16379", "--dir", str(tmp_path / "h")]
    settings = {"GEODESIC_REDIS": "redis://127.0.0.1:1", "GEODESIC_CLUSTER_TOKEN": TOKEN}
    refused = Command(["head", *arguments], tmp_path / "log", settings)

    assert refused.process.wait() == 1
    assert refused.said.startswith("error: the Redis at 127.0.0.1:1 cannot be used: ")
    assert refused.said.count("\n") == 1

"""Two replicas and two nodes, with an S3 server and PostgreSQL: what all of them do once."""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.against import NODES, ClusterClient, serving_cluster
from tests.support.postgres import Server as Postgres
from tests.support.processes import stopped
from tests.support.s3 import S3
from tests.support.service import NPY, TWO_TRIANGLES, distances, serving, upload_sample
from tests.support.waiting import wait_until

pytest.importorskip("ray")
pytestmark = pytest.mark.full

FACES = 200_000
CHUNK = 2**23
"""Bytes that are pulled at once"""
LONG = {**NPY, "Accept-Encoding": "identity"}


@dataclass
class Site:
    """A cluster, and a mesh that its store had before the cluster was there."""

    client: ClusterClient
    s3: S3
    url: str
    mesh_id: str

    def at_once(self, bodies: list[Any]) -> list[Any]:
        """Ask for distances at the same time, each replica in turn."""
        servers = self.client.cluster.servers
        asks = [
            partial(distances, servers[n % 2].client, self.mesh_id, LONG, **body)
            for n, body in enumerate(bodies)
        ]
        with ThreadPoolExecutor(len(asks)) as pool:
            answers = [asked.result() for asked in [pool.submit(ask) for ask in asks]]
        assert {answer.status_code for answer in answers} == {200}
        return answers


@pytest.fixture(scope="module")
def site(
    s3_server: S3, postgres: Postgres, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Site]:
    url, state = s3_server.new_url(), postgres.new_database()
    folder = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in s3_server.environment.items():
            patch.setenv(name, value)
        with serving(url, state=state, copies=folder / "alone") as alone:  # type: ignore[arg-type]
            mesh_id = upload_sample(alone, "sphere", FACES)
    with serving_cluster(s3_server, url, state, folder) as client:
        yield Site(client, s3_server, url, mesh_id)


def from_vertex(vertex: int, **members: Any) -> dict[str, Any]:
    return {"sources": [{"vertex": vertex}], **members}


def test_a_mesh_is_pulled_once_by_each_host_however_many_ask(site: Site) -> None:
    before = site.s3.reads(site.url)
    site.at_once([from_vertex(vertex, targets=[{"vertex": 1}]) for vertex in range(2, 6)])

    read = site.s3.reads(site.url) - before
    arrays = {name: size for name, size in site.s3.sizes(site.url).items() if name.endswith(".npy")}
    assert sum(arrays.values()) > 30 * FACES
    expected = Counter({name: NODES * ceil(size / CHUNK) for name, size in arrays.items()})
    assert Counter({name: read[name] for name in arrays}) == expected


def test_an_answer_is_computed_once_though_both_replicas_are_asked(site: Site) -> None:
    one, two = site.at_once([from_vertex(77)] * 2)

    assert one.content == two.content
    # An answer tells what it took. They tell the same, or one was stored when it was looked for.
    took = {timing for answer in (one, two) for timing in computing(answer)}
    assert len(took) == 1
    field = gc.exact_distance(gc.samples.sphere(FACES), 77).distances
    np.testing.assert_array_equal(np.frombuffer(one.content[-field.nbytes :]), field)


def computing(answer: Any) -> list[str]:
    """Return what an answer tells of its computation; nothing where the store had it."""
    phases = answer.headers["server-timing"].split(", ")
    return [phase for phase in phases if phase.startswith("compute;dur=")]


def test_answers_are_sent_to_the_store_and_nothing_is_left_behind(site: Site) -> None:
    assert site.client.post("/v1/meshes", json=TWO_TRIANGLES).status_code in (200, 201)
    answers = {distances(site.client, site.mesh_id, LONG, **from_vertex(5)).content for _ in "12"}
    assert len(answers) == 1
    names = site.s3.names(site.url)
    assert not any(name.startswith("uploads/") for name in names)
    assert any(name.startswith(f"results/{site.mesh_id}/") for name in names)


def test_work_that_waits_for_both_replicas_is_begun_once(site: Site) -> None:
    """Both ask while no worker does anything, so that neither can have been first."""
    workers = site.client.workers()
    with ThreadPoolExecutor(1) as pool:
        with stopped(workers):
            asked = pool.submit(site.at_once, [from_vertex(99)] * 2)
            wait_until(lambda: site.client.load.busy == 1)
        one, two = asked.result()
    assert one.content == two.content
    assert len({timing for answer in (one, two) for timing in computing(answer)}) == 1

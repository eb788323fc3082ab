"""A store whose files are damaged while a service runs on it."""

import asyncio
import os
import time
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from structlog.testing import capture_logs

import geodesic_core as gc
from app.service import scrub
from app.store import verified
from app.store.atomic import atomic_write
from app.store.meshes import MeshStore
from tests.support.faults import FAULTS, MANIFEST_FAULTS, Fault, flip_bytes
from tests.support.service import check_problem, distances, serving, upload_sample
from tests.support.waiting import wait_until

pytestmark = pytest.mark.file_slice(3)

FACES = 200
NPY = {"Accept": "application/x-npy"}
SOURCE = {"sources": [{"vertex": 7}]}


@pytest.fixture
def client(client: Any) -> Any:
    """The shared service, with the mesh of these tests intact."""
    upload_sample(client, "plane", FACES)
    yield client
    upload_sample(client, "plane", FACES)


def file_of(client: Any, mesh_id: str, name: str) -> Path:
    store: Path = client.app.state.service.settings.store
    return store / "meshes" / mesh_id / name


def details(lines: Sequence[Any]) -> list[str]:
    """Return the damage that the log tells of."""
    return [line["detail"] for line in lines if line["event"] == "store damaged"]


def upload(client: Any) -> str:
    """Upload the mesh that is in the store already."""
    response = client.post("/v1/meshes", params={"sample": "plane", "faces": FACES})
    assert response.status_code == 200, response.text
    return str(response.json()["id"])


def check_array(client: Any, mesh_id: str, name: str, array: Any) -> None:
    response = client.get(f"/v1/meshes/{mesh_id}/arrays/{name}")
    assert response.status_code == 200
    assert "immutable" in response.headers["cache-control"]
    np.testing.assert_array_equal(np.load(BytesIO(response.content)), array)


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS.keys())
def test_a_damaged_array_is_not_served_and_an_upload_heals_it(client: Any, fault: Fault) -> None:
    mesh_id = upload(client)
    sample = gc.samples.plane(FACES)
    vertices, faces = sample.vertices, sample.faces
    check_array(client, mesh_id, "vertices", vertices)
    expected = distances(client, mesh_id, NPY, **SOURCE).content

    fault(file_of(client, mesh_id, "vertices.npy"))
    for headers in ({}, {"Range": "bytes=0-99"}):
        response = client.get(f"/v1/meshes/{mesh_id}/arrays/vertices", headers=headers)
        problem = check_problem(response, 500, "mesh_damaged")
        assert "its array vertices has changed since it was written" in problem["detail"]
        assert "upload it again" in problem["hint"]
        assert "etag" not in response.headers
    check_array(client, mesh_id, "faces", faces)
    other = {"sources": [{"vertex": 8}]}
    check_problem(distances(client, mesh_id, **other), 500, "mesh_damaged")
    assert upload(client) == mesh_id

    check_array(client, mesh_id, "vertices", vertices)
    assert distances(client, mesh_id, NPY, **SOURCE).content == expected
    np.testing.assert_array_equal(
        np.load(BytesIO(distances(client, mesh_id, NPY, **other).content)),
        gc.exact_distance(gc.TriangleMesh(vertices, faces), 8).distances,
    )
    assert not any(MeshStore(client.app.state.service.settings.folder).inspect(mesh_id))


@pytest.mark.parametrize("fault", MANIFEST_FAULTS.values(), ids=MANIFEST_FAULTS.keys())
def test_a_damaged_manifest_is_not_served_and_an_upload_heals_it(client: Any, fault: Fault) -> None:
    mesh_id = upload(client)
    report = client.get(f"/v1/meshes/{mesh_id}").json()

    fault(file_of(client, mesh_id, "manifest.json"))
    paths = [f"/v1/meshes/{mesh_id}", f"/v1/meshes/{mesh_id}/arrays/faces"]
    for response in (*map(client.get, paths), distances(client, mesh_id)):
        problem = check_problem(response, 500, "mesh_damaged")
        assert "its manifest has changed since it was written" in problem["detail"]
    assert upload(client) == mesh_id

    healed = client.get(f"/v1/meshes/{mesh_id}").json()
    assert {**healed, "created": ""} == {**report, "created": ""}
    assert distances(client, mesh_id).status_code == 200


def test_results_and_fields_of_a_damaged_mesh_are_computed_again(tmp_path: Path) -> None:
    """They may have come from it, where the disk changed it without a trace."""
    with serving(tmp_path, results_memory_bytes=1) as client:
        mesh_id = upload_sample(client, "plane", 45_000)
        other = upload_sample(client, "plane", 50)
        assert distances(client, mesh_id).headers["server-timing"] != "kept"
        assert distances(client, mesh_id).headers["server-timing"] == "kept"
        before = distances(client, mesh_id).content
        flip_bytes(tmp_path / "meshes" / mesh_id / "faces.npy")
        upload_sample(client, "plane", 45_000)
        total = client.app.state.service.mesh_catalog.total

        assert not list((tmp_path / "results").glob(f"{mesh_id}/*"))
        assert not list((tmp_path / "fields").glob(f"{mesh_id}/*"))
        again = distances(client, mesh_id)
        assert again.headers["server-timing"] != "kept"
        assert again.content == before
        files = [path for path in (tmp_path / "meshes").rglob("*") if path.is_file()]
        assert total == sum(path.stat().st_size for path in files)
        assert distances(client, other).status_code == 200


def test_files_are_not_read_on_the_event_loop(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    read, loops = verified.read_checksum, []

    def read_noted(path: str) -> int | None:
        try:
            loops.append(asyncio.get_running_loop())
        except RuntimeError:
            loops.append(None)
        return read(path)

    monkeypatch.setattr(verified, "read_checksum", read_noted)
    mesh_id = upload_sample(client, "plane", 512)
    for _ in range(2):
        assert client.get(f"/v1/meshes/{mesh_id}/arrays/vertices").status_code == 200
    assert loops == [None], "it is read once, and where no loop runs"


# The scrub


@pytest.fixture
def scrubs_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """One round after the other, without a rest."""
    for name in ("_DELAY_S", "_PERIOD_S", "_REST", "_SHORTEST_REST_S"):
        monkeypatch.setattr(scrub, name, 0.0)


@pytest.fixture
def lines() -> Iterator[Sequence[Any]]:
    """The log, whose end is shown where the test fails."""
    with capture_logs() as lines:
        yield lines
    print(*lines[-20:], sep="\n")  # noqa: T201 - pytest shows it


@pytest.mark.usefixtures("scrubs_at_once")
def test_the_scrub_removes_what_was_left_unfinished_a_day_ago(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        mesh_id = upload_sample(client, "plane", 50_000)
        assert distances(client, mesh_id, NPY).status_code == 200
        complete = set(tmp_path.glob("results/*/*"))
        days_ago = time.time() - 2 * 86_400
        for path in complete:
            os.utime(path, (days_ago, days_ago))

        with atomic_write(tmp_path / "results" / mesh_id / "new.body"):
            being_written = set(tmp_path.glob("results/*/*")) - complete
            left = [tmp_path / name / mesh_id / "tmp12345678" for name in ("results", "fields")]
            for path in left:
                path.parent.mkdir(exist_ok=True, parents=True)  # a field is written later
                path.touch()
                os.utime(path, (days_ago, days_ago))
            wait_until(lambda: not any(path.exists() for path in left))

            assert len(being_written) == 1
            assert set(tmp_path.glob("results/*/*")) == complete | being_written


@pytest.mark.usefixtures("scrubs_at_once")
def test_the_scrub_finds_what_is_damaged(tmp_path: Path, lines: Sequence[Any]) -> None:
    with serving(tmp_path, results_memory_bytes=1) as client:
        damaged, whole = (upload_sample(client, "plane", faces) for faces in (45_000, 50_000))
        for mesh_id in (damaged, whole):
            assert distances(client, mesh_id).status_code == 200
            assert distances(client, mesh_id, NPY, sources=[{"vertex": 1}]).status_code == 200
        bodies = list((tmp_path / "results" / whole).glob("*.body"))
        assert not details(lines)
        flip_bytes(bodies[0])
        flip_bytes(tmp_path / "meshes" / damaged / "vertices.npy")

        wait_until(lambda: not bodies[0].exists())
        wait_until(lambda: not list((tmp_path / "results" / damaged).glob("*")))

        assert bodies[1].exists()
        name = f"{whole}/{bodies[0].stem}"
        assert f"result {name} is damaged: it has changed since it was written" in details(lines)
        # Of what, depends on the file that the scrub was at when the bytes were flipped.
        assert any(detail.startswith(f"mesh {damaged} is damaged: ") for detail in details(lines))
        assert not any(detail.startswith(f"mesh {whole}") for detail in details(lines))
        check_problem(distances(client, damaged), 500, "mesh_damaged")
        upload_sample(client, "plane", 45_000)
        assert distances(client, damaged).status_code == 200
        assert distances(client, whole).status_code == 200

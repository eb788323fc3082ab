"""Certificates beside distances: the library's, what is refused, and the file for the checker."""

import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import DistancesQuery, MeshSize
from app.schemas.requests import DistancesRequest
from app.store.meshes import OpenMesh
from geodesic_core import verify
from tests.support.service import (
    NPY,
    check_problem,
    context,
    distances,
    serving,
    stored_mesh,
    upload_sample,
)

EXACT: dict = {}
APPROXIMATE = {"method": "approximate", "relative_error": 0.05}
FAST = {"method": "fast", "effort": 1}
CHECKER = Path(verify.__file__)
CURVE = {"polyline": [{"vertex": 0}, {"vertex": 1}]}


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 500)


def check(folder: Path, *sources: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(CHECKER), "knot.npz", "proof.npz", *sources]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603


def numbers(values: list) -> np.ndarray:
    return np.array([np.inf if value is None else value for value in values])


def solved(mesh: gc.TriangleMesh, method: dict, limit: float | None = None) -> gc.DistanceField:
    if method == FAST:
        return gc.fast_distance(mesh, [3, 9], 1, max_distance=limit)
    if method:
        return gc.approximate_distance(mesh, [3, 9], 0.05, max_distance=limit)
    return gc.exact_distance(mesh, [3, 9], max_distance=limit)


@pytest.mark.parametrize("limit", [None, 0.5])
@pytest.mark.parametrize("method", [EXACT, APPROXIMATE, FAST])
def test_it_is_the_library_s(
    client: TestClient, knot: str, method: dict, limit: float | None
) -> None:
    field = solved(stored_mesh(client, knot), method, limit)
    certificate = field.certify()
    body = {"sources": [3, 9], "max_distance": limit, **method}

    include = ["upper", "lower", "violations"]
    answer = distances(client, knot, certify=True, include=include, **body).json()

    np.testing.assert_array_equal(numbers(answer["distances"]), field.distances)
    np.testing.assert_array_equal(numbers(answer["lower"]), certificate.lower)
    np.testing.assert_array_equal(numbers(answer["upper"]), certificate.upper)
    np.testing.assert_array_equal(answer["violations"], certificate.violations)
    bound = field.error_bound
    assert answer["error_bound"] == {"type": "absolute", "value": bound.value, "kind": "certified"}
    assert answer["certificate"] == {
        "holds": True,
        "relative_gap": certificate.relative_gap,
        "worst_face": certificate.worst_face,
        "worst_violation": certificate.worst_violation,
    }


def test_others_are_answered_as_before(client: TestClient, knot: str) -> None:
    """Both come from the same field in the cache."""
    before = distances(client, knot, sources=[5]).json()
    distances(client, knot, sources=[5], certify=True)
    after = distances(client, knot, sources=[5], include=["nearest_source"]).json()

    assert after["error_bound"] == before["error_bound"]
    assert before["error_bound"]["kind"] == "guaranteed"
    assert not {"certificate", "lower", "upper"} & after.keys()


def test_targets_at_vertices_have_bounds(client: TestClient, knot: str) -> None:
    certificate = gc.exact_distance(stored_mesh(client, knot), 0).certify()

    answer = distances(client, knot, targets=[7, 40], certify=True, include=["lower"]).json()

    assert answer["lower"] == certificate.lower[[7, 40]].tolist()


def test_barriers_are_those_of_the_proof(client: TestClient, plane: str) -> None:
    wall = list(range(100, 120))
    certificate = gc.exact_distance(stored_mesh(client, plane), 0, barriers=wall).certify()

    answer = distances(client, plane, barriers=wall, certify=True, include=["lower"]).json()

    np.testing.assert_array_equal(numbers(answer["lower"]), certificate.lower)


def test_bounds_are_columns_of_tables(client: TestClient, knot: str) -> None:
    lower = gc.exact_distance(stored_mesh(client, knot), 0).certify().lower

    link = f"/v1/meshes/{knot}/distances?format=csv"
    body = {"sources": [0], "certify": True, "include": ["lower"]}
    names, *rows = client.post(link, json=body).text.splitlines()

    assert names == "vertex,distance,lower"
    assert [float(row.split(",")[2]) for row in rows] == lower.tolist()


@pytest.mark.parametrize(
    ("body", "place"),
    [
        ({"sources": [{"vertex": 3}, CURVE]}, "/certify"),
        ({"certify": "yes"}, "/certify"),
        ({"certify": False, "include": ["lower"]}, "/include"),
        ({"certify": False, "include": ["violations"]}, "/include"),
        ({"targets": [3, {"face": 7, "barycentric": [0.2, 0.3, 0.5]}]}, "/targets/1"),
    ],
)
def test_refused(client: TestClient, knot: str, body: dict, place: str) -> None:
    refused = distances(client, knot, **{"certify": True} | body)
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]


@pytest.mark.parametrize("method", [EXACT, APPROXIMATE])
def test_the_checker_proves_the_file(
    client: TestClient, knot: str, tmp_path: Path, method: dict
) -> None:
    mesh = stored_mesh(client, knot)
    np.savez(tmp_path / "knot.npz", vertices=mesh.vertices, faces=mesh.faces)
    solved(mesh, method).certify().save(tmp_path / "expected.npz")

    link = f"/v1/meshes/{knot}/distances?format=npz"
    response = client.post(link, json={"sources": [3, 9], "certify": True, **method})
    assert response.headers["content-type"] == "application/x-npz"
    assert '"holds":true' in response.headers["geodesic-certificate"]
    assert "geodesic-distances" not in response.headers
    (tmp_path / "proof.npz").write_bytes(response.content)

    assert response.content == (tmp_path / "expected.npz").read_bytes()
    found = check(tmp_path, "--source", "3", "--source", "9")
    assert found.stdout.startswith(f"proved    {len(mesh.vertices)} lower bounds")
    assert (found.returncode, found.stderr) == (0, "")
    assert check(tmp_path, "--source", "40").returncode == 1


def test_only_proofs_come_as_archives_and_whole(client: TestClient, knot: str) -> None:
    link = f"/v1/meshes/{knot}/distances?format=npz"
    check_problem(client.post(link, json={"sources": [0]}), 406, "not_acceptable")
    proof = {"sources": [0], "certify": True}
    for query, body, place in (
        ("&dtype=float32", proof, "/query/dtype"),
        ("", proof | {"include": ["lower"]}, "/include"),
    ):
        problem = check_problem(client.post(link + query, json=body), 422, "invalid_request")
        assert [fault["pointer"] for fault in problem["errors"]] == [place]
    check_problem(distances(client, knot, NPY, **proof, include=["upper"]), 422, "invalid_request")
    by_face = proof | {"include": ["violations"]}
    for name in ("csv", "ply", "npy", "npz"):
        refused = client.post(f"/v1/meshes/{knot}/distances?format={name}", json=by_face)
        (fault,) = check_problem(refused, 422, "invalid_request")["errors"]
        assert fault["pointer"] == "/include"
        assert fault["message"].endswith("ask for json")


# Paths


INSIDE = {"face": 7, "barycentric": [0.2, 0.3, 0.5]}


@pytest.mark.parametrize(
    ("ends", "start"),
    [((3, 200), "3"), ((INSIDE, 200), "f7:0.2,0.3,0.5"), ((200, INSIDE), "f7:0.2,0.3,0.5")],
)
def test_a_path_is_proved_to_be_shortest(
    client: TestClient, knot: str, tmp_path: Path, ends: tuple, start: str
) -> None:
    mesh, link = stored_mesh(client, knot), f"/v1/meshes/{knot}/path"
    body = {"source": ends[0], "target": ends[1], "certify": True}

    answer = client.post(link, json=body).json()

    bound = answer["error_bound"]
    assert (bound["type"], bound["kind"]) == ("absolute", "certified")
    assert bound["value"] <= 1e-9 * answer["length"]
    assert answer["certificate"]["holds"]
    assert 0 < answer["certificate"]["relative_gap"] <= 1e-9
    plain = client.post(link, json=body | {"certify": False}).json()
    assert plain["points"] == answer["points"]
    assert "certificate" not in plain
    np.savez(tmp_path / "knot.npz", vertices=mesh.vertices, faces=mesh.faces)
    proof = client.post(link + "?format=npz", json=body)
    assert '"holds":true' in proof.headers["geodesic-certificate"]
    (tmp_path / "proof.npz").write_bytes(proof.content)
    assert check(tmp_path, "--source", start).returncode == 0
    assert check(tmp_path, "--source", "40").returncode == 1


@pytest.mark.parametrize(
    ("body", "places"),
    [
        ({"method": "fast"}, ["/certify"]),
        ({"method": "approximate"}, ["/certify"]),
        ({"waypoints": [9]}, ["/certify"]),
        ({"source": INSIDE, "target": INSIDE}, ["/source", "/target"]),
    ],
)
def test_paths_without_proof_are_refused(
    client: TestClient, knot: str, body: dict, places: list
) -> None:
    asked = {"source": 3, "target": 200, "certify": True} | body
    refused = client.post(f"/v1/meshes/{knot}/path", json=asked)
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == places


def test_there_is_no_proof_of_no_path(client: TestClient, knot: str) -> None:
    body = {"source": 3, "target": 200, "certify": True, "max_distance": 0.1}
    response = client.post(f"/v1/meshes/{knot}/path?format=npz", json=body)
    assert response.status_code == 200
    assert response.headers["geodesic-reason"] == "beyond_max_distance"
    with np.load(BytesIO(response.content)) as nothing:
        assert list(nothing) == []


# As work


def test_its_values_count(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=2 * 121) as client:
        mesh_id = upload_sample(client, "plane", 200)

        refused = distances(client, mesh_id, certify=True, include=["lower", "upper"])
        assert check_problem(refused, 413, "result_too_large")["actual"] == 3 * 121
        refused = distances(client, mesh_id, certify=True, include=["violations"])
        assert check_problem(refused, 413, "result_too_large")["actual"] == 121 + 200


def test_it_is_long_work() -> None:
    size = MeshSize(10_000, 20_000, 0.01)
    request = DistancesRequest.model_validate({"sources": [0], "certify": True})
    proof = DistancesQuery.ask("m" * 32, size, request)
    plain = DistancesQuery.ask("m" * 32, size, request.model_copy(update={"certify": False}))
    assert plain.rough_seconds() + 0.3 < proof.rough_seconds()
    assert not proof.is_small


def test_the_proof_can_be_stopped_and_is_told_as_progress() -> None:
    opened = OpenMesh(("id", b""), gc.Solver(gc.samples.knot(500)), [])
    shares: list[float] = []
    asked = context()
    plain = DistancesRequest.model_validate({"sources": [0]})
    proof = plain.model_copy(update={"certify": True})
    DistancesQuery("id", plain).answer(opened, asked)  # from now on the field is in the cache

    DistancesQuery("id", proof).answer(opened, replace(asked, progress=shares.append))
    assert shares == sorted(shares)
    assert len(shares) > 2
    assert shares[-1] == 1.0
    stopped = replace(asked, cancel=lambda: True)
    with pytest.raises(gc.errors.Cancelled):
        DistancesQuery("id", proof).answer(opened, stopped)
    short = replace(asked, memory_limit=1)
    with pytest.raises(gc.errors.MemoryLimitExceeded):
        DistancesQuery("id", proof).answer(opened, short)

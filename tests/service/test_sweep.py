"""The steps of a sweep over HTTP: the library's to the bit, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.service import check_problem, serving, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
PLACE = gc.SurfacePoint.face(40, (0.2, 0.3, 0.5))


def nulls(array: np.ndarray) -> list[Any]:
    """Return an array as JSON has it: without numbers that are infinite, or no index."""
    values = array.astype(object)
    values[~np.isfinite(array) | (array < 0)] = None
    return list(values.tolist())


def test_the_steps_are_the_library_s(client: TestClient, terrain: str) -> None:
    mesh = stored_mesh(client, terrain)
    walls = list(range(len(mesh.faces) // 2, len(mesh.faces)))
    body = {"sources": [INSIDE, 5], "steps": 40, "barriers": walls}
    found = client.post(f"/v1/meshes/{terrain}/sweep", json=body).json()

    own = gc.sweep_steps(mesh, [PLACE, 5], 40, walls)
    assert (found["kind"], len(found["sources"])) == ("sweep", 2)
    assert len(found["fronts"]) == len(own) <= 41
    for name in ("fronts", "created", "crossed", "waiting", "trimmed", "distances", "settled"):
        assert found[name] == nulls(getattr(own, name)), name
    for name, column in vars(own.windows).items():
        assert found["windows"][name] == nulls(column), name
    assert None in found["windows"]["pseudosources"]
    assert None in found["distances"], "inside the walls"


def test_what_cannot_be_followed_is_refused(
    client: TestClient, terrain: str, tmp_path: Path
) -> None:
    large = upload_sample(client, "sphere", 20_000)
    problem = check_problem(
        client.post(f"/v1/meshes/{large}/sweep", json={"sources": [0]}), 422, "limit_exceeded"
    )
    assert (problem["limit"], problem["actual"]) == (gc.SweepSteps.most_faces, 20_480)
    assert "simplify" in problem["hint"]
    for body in ({"sources": []}, {"sources": [0], "steps": 0}, {"sources": [0], "steps": 1001}):
        refused = client.post(f"/v1/meshes/{terrain}/sweep", json=body)
        check_problem(refused, 422, "invalid_request")
    with serving(tmp_path, max_json_values=1000) as small:
        mesh = upload_sample(small, "terrain", 200)
        answer = small.post(f"/v1/meshes/{mesh}/sweep", json={"sources": [0]})
        problem = check_problem(answer, 413, "result_too_large")
        assert "simplify" in problem["hint"]

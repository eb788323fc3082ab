"""A store whose files are damaged while a service runs on it."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.faults import edit_counts, flip_bytes
from tests.support.service import NPY, check_problem, distances, serving, upload_sample

pytestmark = pytest.mark.file_slice(3)

FACES = 45_000
"""Their answers are larger than those that memory holds"""


def test_a_damaged_array_is_not_served_and_an_upload_heals_it(tmp_path: Path) -> None:
    """Its results and fields are computed again: nobody knows what came before the damage."""
    with serving(tmp_path) as client:
        mesh_id, other = (upload_sample(client, "plane", faces) for faces in (FACES, 50))
        before = distances(client, mesh_id, NPY).content
    flip_bytes(tmp_path / "meshes" / mesh_id / "vertices.npy")
    with serving(tmp_path) as client:
        link = f"/v1/meshes/{mesh_id}/arrays/vertices"
        for headers in ({}, {"Range": "bytes=0-99"}):
            response = client.get(link, headers=headers)
            problem = check_problem(response, 500, "mesh_damaged")
            assert "its array vertices has changed since it was written" in problem["detail"]
            assert "upload it again" in problem["hint"]
            assert "etag" not in response.headers
        assert client.get(f"/v1/meshes/{mesh_id}/arrays/faces").status_code == 200
        new = {"sources": [{"vertex": 7}]}
        check_problem(distances(client, mesh_id, **new), 500, "mesh_damaged")
        assert distances(client, mesh_id, NPY).headers["server-timing"] == "kept"
        assert upload_sample(client, "plane", FACES) == mesh_id

        assert not list((tmp_path / "results").glob(f"{mesh_id}/*"))
        assert not list((tmp_path / "fields").glob(f"{mesh_id}/*"))
        again = distances(client, mesh_id, NPY)
        assert again.headers["server-timing"] != "kept"
        assert again.content == before
        np.testing.assert_array_equal(
            np.load(BytesIO(client.get(link).content)), gc.samples.plane(FACES).vertices
        )
        files = [path for path in (tmp_path / "meshes").rglob("*") if path.is_file()]
        total = client.app.state.service.mesh_catalog.total  # type: ignore[attr-defined]
        assert total == sum(path.stat().st_size for path in files)
        assert distances(client, other).status_code == 200


def test_a_damaged_manifest_is_not_served_and_an_upload_heals_it(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        mesh_id = upload_sample(client, "plane", 200)
        report = client.get(f"/v1/meshes/{mesh_id}").json()
    edit_counts(tmp_path / "meshes" / mesh_id / "manifest.json")
    with serving(tmp_path) as client:
        for path in ("", "/arrays/faces"):
            response = client.get(f"/v1/meshes/{mesh_id}{path}")
            problem = check_problem(response, 500, "mesh_damaged")
            assert "its manifest has changed since it was written" in problem["detail"]
        check_problem(distances(client, mesh_id), 500, "mesh_damaged")
        assert upload_sample(client, "plane", 200) == mesh_id

        healed = client.get(f"/v1/meshes/{mesh_id}").json()
        assert {**healed, "created": ""} == {**report, "created": ""}
        assert distances(client, mesh_id).status_code == 200

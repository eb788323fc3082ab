"""Matrices of all vertices: no object for each, unless the format shows one."""

import json
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from app.encoding import JSON, NPY, Representation, encode
from app.queries import KINDS, MeshSize
from app.queries.matrix import _Side
from app.store.meshes import OpenMesh
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from tests.support.service import context

MESH = gc.samples.knot(2000)
COUNT = len(MESH.vertices)
SIZE = MeshSize(COUNT, len(MESH.faces), 1.0)


@pytest.mark.parametrize(
    "sides",
    [
        {"sources": [0, 9], "targets": "all"},
        {"sources": "all", "targets": [0, 9]},
        {"sources": [0], "targets": "all", "layout": "sparse", "max_distance": 0.5},
    ],
)
def test_what_grows_with_the_mesh_are_arrays(
    monkeypatch: pytest.MonkeyPatch, sides: dict[str, Any]
) -> None:
    calls = []

    def counted(do: Any) -> Any:
        return lambda *given: (calls.append(1), do(*given))[1]

    monkeypatch.setattr(TriangleMesh, "point", counted(TriangleMesh.point))
    monkeypatch.setattr(_Side, "described", counted(_Side.described))
    kind = KINDS["matrix"]
    request = kind.model.model_validate({"method": "fast", **sides})
    query = kind.ask("m" * 32, SIZE, request)

    answer = query.answer(OpenMesh.of(MESH), context())
    form = Representation(NPY if "layout" not in sides else "application/x-npz")
    assert sum(map(len, encode(answer, form)[0])) > 0
    assert len(calls) < 30


def test_all_vertices_are_described_where_json_shows_them() -> None:
    kind = KINDS["matrix"]
    request = kind.model.model_validate({"sources": [7], "targets": "all", "method": "fast"})
    answer = kind.ask("m" * 32, SIZE, request).answer(OpenMesh.of(MESH), context())
    document = json.loads(b"".join(encode(answer, Representation(JSON))[0]))
    assert [point["vertex"] for point in document["targets"]] == list(range(COUNT))
    positions = [point["position"] for point in document["targets"]]
    np.testing.assert_array_equal(positions, MESH.vertices)
    assert [point["component"] for point in document["targets"]] == MESH.components.tolist()
    assert document["sources"] == [document["targets"][7]]

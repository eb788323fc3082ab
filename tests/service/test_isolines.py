"""Isolines over HTTP: the library's, on the circles they have to be, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.queries import IsolinesQuery
from app.store.meshes import OpenMesh
from geodesic_core.fields.sweeps import WholeSweep
from tests.support.service import check_problem, context, serving, stored_mesh, upload_sample

INSIDE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
METHODS = ({}, {"method": "approximate", "relative_error": 0.05})


@pytest.fixture(scope="module")
def knot(client: TestClient) -> str:
    return upload_sample(client, "knot", 3000)


def isolines(client: TestClient, mesh_id: str, query: str = "", **body: Any) -> Any:
    body.setdefault("sources", [{"vertex": 0}])
    request = {name: value for name, value in body.items() if value is not ...}
    return client.post(f"/v1/meshes/{mesh_id}/isolines{query}", json=request)


def check_lines(found: list[dict[str, Any]], expected: list[gc.SurfaceCurve]) -> None:
    assert len(found) == len(expected)
    for line, isoline in zip(found, expected, strict=True):
        assert line["closed"] is isoline.closed
        assert line["length"] == isoline.length
        assert line["points"] == isoline.points.tolist()
        assert line["faces"] == isoline.faces.tolist()
        assert len(line["points"]) - len(line["faces"]) == (0 if line["closed"] else 1)


@pytest.mark.parametrize("method", METHODS, ids=["exact", "approximate"])
def test_lines_are_the_library_s(client: TestClient, knot: str, method: dict) -> None:
    mesh = stored_mesh(client, knot)
    sources = [gc.Source(gc.SurfacePoint.face(40, (0.2, 0.3, 0.5)), 0.25), gc.Source(700)]
    if method:
        field = gc.approximate_distance(mesh, sources, 0.05, retain="windows")
    else:
        field = gc.exact_distance(mesh, sources, retain="windows")
    sources = [INSIDE | {"start_distance": 0.25}, {"vertex": 700}]
    levels = [2.0, 0.1, 2.0, 99.0]

    named = isolines(
        client, knot, sources=sources, levels=levels, chord_error=1e-3, **method
    ).json()
    spaced = isolines(client, knot, sources=sources, count=3, **method).json()

    assert [each["level"] for each in named["isolines"]] == levels
    for each, expected in zip(
        named["isolines"], field.isolines(levels, chord_error=1e-3), strict=True
    ):
        check_lines(each["lines"], expected)
    assert named["isolines"][3]["lines"] == []
    assert named["chord_error"] == 1e-3
    assert [each["level"] for each in spaced["isolines"]] == field.levels(3).tolist()
    for each, expected in zip(spaced["isolines"], field.isolines(field.levels(3)), strict=True):
        check_lines(each["lines"], expected)
    assert 0 < spaced["chord_error"] == pytest.approx(1e-3 * mesh.report.mean_edge_length, rel=0.1)
    for answer in (named, spaced):
        assert answer["mesh_id"] == knot
        assert answer["method"] == method.get("method", "exact")
        assert answer["error_bound"]["value"] == field.error_bound.value
        assert answer["sources"][0]["face"] == 40
        assert [source["start_distance"] for source in answer["sources"]] == [0.25, 0]
        assert answer["stats"]["windows_created"] == field.stats.windows_created


def test_lines_end_at_barriers(client: TestClient, plane: str) -> None:
    wall = list(range(100, 116))
    field = gc.exact_distance(stored_mesh(client, plane), 0, barriers=wall)

    (level,) = isolines(client, plane, levels=[1.5], barriers=wall).json()["isolines"]

    check_lines(level["lines"], field.isolines([1.5])[0])
    (free,) = isolines(client, plane, levels=[1.5]).json()["isolines"]
    assert free["lines"] == [], "the far corner is at √2"


def test_lines_end_at_max_distance(client: TestClient, plane: str) -> None:
    answer = isolines(client, plane, levels=[0.4, 0.6], max_distance=0.5).json()

    near, far = answer["isolines"]
    assert [line["closed"] for line in near["lines"]] == [False]
    assert far["lines"] == []
    levels = isolines(client, plane, count=4, max_distance=0.5).json()["isolines"]
    np.testing.assert_allclose([each["level"] for each in levels], [0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(("method", "sweeps"), list(zip(METHODS, (2, 1), strict=True)))
def test_the_grant_is_in_force_throughout(
    method: dict, sweeps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = OpenMesh(("", b""), gc.Solver(gc.samples.knot(3000)), [])
    request = IsolinesQuery.model.model_validate({"sources": [INSIDE], "count": 4, **method})
    query = IsolinesQuery("m", IsolinesQuery.normalized(request))
    watched: list[dict[str, Any]] = []
    run, checks = WholeSweep.run_for, 0

    def watch(sweep: WholeSweep, control: Any, **keep: Any) -> Any:
        watched.append({"cancel": control.cancel, "memory_limit": control.memory_limit})
        return run(sweep, control, **keep)

    def cancel() -> bool:
        nonlocal checks
        checks += 1
        return checks == stop_at

    monkeypatch.setattr(WholeSweep, "run_for", watch)
    stop_at = -1
    query.answer(opened, context(cancel, memory=10**9))

    assert watched == [{"cancel": cancel, "memory_limit": 10**9}] * sweeps
    assert checks >= sweeps + 1 + 2 * 4, "each sweep, all faces, and cutting and joining each level"
    for stop_at in range(1, checks + 1):
        checks = 0
        with pytest.raises(gc.errors.Cancelled):
            query.answer(opened, context(cancel))
        assert checks == stop_at


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"count": ...}, "/levels"),
        ({"levels": [0.5]}, "/count"),
        ({"count": 0}, "/count"),
        ({"count": -1}, "/count"),
        ({"count": 1.5}, "/count"),
        ({"count": True}, "/count"),
        ({"count": ..., "levels": []}, "/levels"),
        ({"count": ..., "levels": 0.5}, "/levels"),
        ({"count": ..., "levels": [0.5, 0]}, "/levels/1"),
        ({"count": ..., "levels": [-1]}, "/levels/0"),
        ({"count": ..., "levels": ["0.5"]}, "/levels/0"),
        ({"count": ..., "levels": [None]}, "/levels/0"),
        ({"count": ..., "levels": [True]}, "/levels/0"),
        ({"max_distance": 0}, "/count"),
        ({"max_distance": -1}, "/max_distance"),
        ({"chord_error": 0}, "/chord_error"),
        ({"chord_error": 1e-300}, "/chord_error"),
        ({"chord_error": "fine"}, "/chord_error"),
        ({"sources": []}, "/sources"),
        ({"sources": None}, "/sources"),
        ({"source": {"vertex": 0}}, "/source"),
        ({"targets": []}, "/targets"),
        ({"method": "heat"}, "/method"),
        ({"relative_error": 0.1}, "/relative_error"),
        ({"method": "approximate", "absolute_error": 0}, "/absolute_error"),
        ({"barriers": [200]}, "/barriers/0"),
    ],
)
def test_refused_isolines(client: TestClient, plane: str, change: dict, place: str) -> None:
    refused = isolines(client, plane, **{"count": 2} | change)
    problem = check_problem(refused, 422, "invalid_request")
    assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_sources_off_the_mesh_are_refused(client: TestClient, plane: str) -> None:
    refused = isolines(client, plane, count=1, sources=[{"vertex": 0}, {"vertex": 121}])
    problem = check_problem(refused, 422, "invalid_point")
    assert [fault["pointer"] for fault in problem["errors"]] == ["/sources/1/vertex"]


def test_limits(tmp_path: Path) -> None:
    with serving(tmp_path, max_json_values=1000, max_levels=5, max_sources=3) as client:
        mesh_id = upload_sample(client, "plane", 200)

        assert isolines(client, mesh_id, levels=[0.3, 0.2]).status_code == 200
        for request in ({"count": 6}, {"levels": [0.5] * 6}):
            problem = check_problem(isolines(client, mesh_id, **request), 422, "limit_exceeded")
            assert (problem["actual"], problem["limit"]) == (6, 5)
            assert problem["setting"] == "max_levels"
        many = isolines(client, mesh_id, sources=[{"vertex": 0}] * 4, count=1)
        check_problem(many, 422, "limit_exceeded")
        fine = isolines(client, mesh_id, levels=[0.3, 0.2], chord_error=1e-8)
        problem = check_problem(fine, 413, "result_too_large")
        assert problem["actual"] > problem["limit"] == 1000
        assert "chord_error" in problem["hint"]

"""Estimates of queries, against their real cost."""

import pickle
import tracemalloc
from time import process_time
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.encoding import JSON, Representation
from app.queries import (
    DistancesQuery,
    IsolinesQuery,
    LocateQuery,
    MatrixQuery,
    NearestQuery,
    PathQuery,
    PathsQuery,
    Query,
    estimate,
)
from app.schemas.points import StrictModel
from app.store.meshes import OpenMesh
from tests.support.service import check_problem, context, stored_mesh, upload_sample

MESHES = {"knot": 8000, "sphere": 5000, "plane": 10_000}
RNG = np.random.default_rng(8)
SOME, MANY = ([{"vertex": i} for i in RNG.integers(0, 2000, n).tolist()] for n in (40, 700))
INSIDE = {"face": 1040, "barycentric": [0.2, 0.3, 0.5]}
CORNER = {"face": 1040, "barycentric": [1, 0, 0]}
ROUGH = {"method": "approximate", "relative_error": 0.01}
FAST = {"method": "fast", "effort": 8}
PAIRS = {"layout": "pairs"}
FEW = {"sources": SOME[:9], "targets": SOME[9:18]}
JSON_ONLY: tuple[str, ...] = ("json",)

# The body, the formats, by which factor the response may be off
QUERIES: dict[str, tuple[str, dict[str, Any], tuple[str, ...], float]] = {
    "all": ("distances", {"sources": [INSIDE]}, ("json", "octets", "csv", "ply"), 1.05),
    "near": ("distances", {"sources": SOME[:3], "max_distance": 0.3}, ("json", "npy"), 1.15),
    "rough": ("distances", {"sources": SOME[:2], **ROUGH}, JSON_ONLY, 1.05),
    "quick": ("distances", {"sources": SOME[:2], "method": "fast"}, JSON_ONLY, 1.05),
    "deep": ("distances", {"sources": [INSIDE], "include": ["gradient"], **FAST}, JSON_ONLY, 1.1),
    "named": ("distances", {"sources": SOME[:9], "include": ["nearest_source"]}, JSON_ONLY, 1.05),
    "slopes": ("distances", {"sources": SOME[:2], "include": ["gradient"]}, JSON_ONLY, 1.1),
    "some": ("distances", {"sources": SOME[:1], "targets": MANY}, ("json", "npy"), 1.05),
    "dense": ("matrix", {"sources": SOME, "targets": MANY}, ("json", "npy", "octets"), 1.05),
    "sparse": ("matrix", {"sources": SOME, "targets": MANY, "layout": "sparse"}, ("json",), 1.05),
    "npz": ("matrix", {"sources": SOME, "targets": MANY, "layout": "sparse"}, ("npz",), 1.05),
    "pairs": ("matrix", {"sources": MANY[:40], "targets": SOME, **PAIRS}, ("json",), 1.05),
    "rough dense": ("matrix", {"sources": SOME, "targets": MANY, **ROUGH}, JSON_ONLY, 1.05),
    "quick sparse": ("matrix", {**FEW, "layout": "sparse", **FAST}, ("npz",), 1.05),
    "quick pairs": ("matrix", {**FEW, **PAIRS, **FAST}, JSON_ONLY, 1.05),
    "hub": ("matrix", {"sources": [INSIDE] * 40, "targets": SOME, **PAIRS}, ("npy",), 1.05),
    "nearest": ("nearest", {"source": INSIDE, "candidates": MANY, "k": 50}, ("json", "csv"), 1.05),
    "path": ("path", {"source": INSIDE, "target": {"vertex": 1900}}, ("json", "npy", "csv"), 3),
    "legs": ("path", {"source": INSIDE, "target": SOME[0], "waypoints": SOME[1:4]}, JSON_ONLY, 3),
    "rough path": ("path", {"source": INSIDE, "target": {"vertex": 1900}, **ROUGH}, JSON_ONLY, 3),
    "lines": ("isolines", {"sources": [INSIDE], "count": 10}, ("json", "obj", "svg"), 3),
    "some lines": ("isolines", {"sources": SOME[:2], "levels": [0.2, 0.3]}, JSON_ONLY, 3),
    "rough lines": ("isolines", {"sources": SOME[:2], "count": 5, **ROUGH}, JSON_ONLY, 3),
    "fine": ("isolines", {"sources": [INSIDE], "count": 3, "chord_error": 1e-6}, JSON_ONLY, 3),
    "paths": ("paths", {"source": INSIDE, "targets": MANY}, ("json", "geojson"), 3),
    "rough paths": ("paths", {"source": INSIDE, "targets": SOME, **ROUGH}, JSON_ONLY, 3),
    "quick path": ("path", {"source": INSIDE, "target": {"vertex": 1900}, **FAST}, JSON_ONLY, 3),
    "quick paths": ("paths", {"source": INSIDE, "targets": SOME, **FAST}, JSON_ONLY, 3),
    "curve": ("distances", {"sources": [{"polyline": [CORNER] * 9}]}, JSON_ONLY, 1.05),
    "curve paths": ("paths", {"source": {"polyline": [CORNER]}, "targets": SOME}, JSON_ONLY, 3),
    "locate": ("locate", {"points": [[0.1 * i, 0.3, 0.2] for i in range(30)]}, JSON_ONLY, 1.15),
}  # fmt: skip
KINDS: dict[str, type[Query[Any]]] = {
    "distances": DistancesQuery,
    "isolines": IsolinesQuery,
    "locate": LocateQuery,
    "matrix": MatrixQuery,
    "nearest": NearestQuery,
    "path": PathQuery,
    "paths": PathsQuery,
}


def query_of(name: str) -> Query[Any]:
    operation, body, _, _ = QUERIES[name]
    kind = KINDS[operation]
    request: StrictModel = kind.model.model_validate(body)
    return kind("m", kind.normalized(request))


@pytest.fixture(scope="module")
def ids(client: TestClient) -> dict[str, str]:
    return {name: upload_sample(client, name, faces) for name, faces in MESHES.items()}


@pytest.mark.slice(5)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("name", QUERIES)
def test_bytes_of_the_response(
    client: TestClient, ids: dict[str, str], name: str, mesh: str
) -> None:
    operation, body, formats, factor = QUERIES[name]
    link = f"/v1/meshes/{ids[mesh]}/{operation}"
    for written in formats:
        estimated = client.post(f"{link}?format={written}&estimate=true", json=body).json()
        real = client.post(f"{link}?format={written}", json=body)

        assert real.status_code == 200
        assert estimated["media_type"] == real.headers["content-type"].partition(";")[0]
        assert estimated["kind"] == "estimate"
        assert estimated["mesh_id"] == ids[mesh]
        assert 1 / factor <= estimated["response_bytes"] / len(real.content) <= factor


ENDS = [{"vertex": i} for i in range(6)]


@pytest.mark.parametrize(
    ("operation", "body"),
    [
        ("distances", {"sources": ENDS[:1], "max_distance": 0.5}),
        ("distances", {"sources": ENDS[:1], "targets": ENDS}),
        ("path", {"source": {"vertex": 0}, "target": {"vertex": 4}}),
        ("path", {"source": {"vertex": 0}, "target": {"vertex": 4}, "method": "approximate"}),
        ("paths", {"source": {"vertex": 0}, "targets": ENDS, "max_distance": 0.5}),
        *(
            ("matrix", {"sources": ENDS, "targets": ENDS[::-1], **limit, "layout": layout})
            for layout in ("dense", "sparse", "pairs")
            for limit in ({}, {"max_distance": 0.5})
        ),
        ("matrix", {"sources": ENDS[:1] * 12, "targets": ENDS * 2, **PAIRS}),
        ("nearest", {"source": {"vertex": 0}, "candidates": ENDS[3:]}),
        ("nearest", {"source": {"vertex": 0}, "candidates": ENDS, "k": 5, "max_distance": 0.5}),
        ("locate", {"points": [[0, 0, 9]] * 9, "max_distance": 1}),
    ],
)
def test_what_is_out_of_reach_is_not_counted(
    client: TestClient, apart: str, operation: str, body: dict[str, Any]
) -> None:
    link = f"/v1/meshes/{apart}/{operation}"

    estimated = client.post(f"{link}?estimate=true", json=body).json()

    size = len(client.post(link, json=body).content)
    assert 1 / 1.1 <= estimated["response_bytes"] / size <= 1.1


# Positions are looked for without any state; what is said of paths comes on top of it.
STATEFUL = [name for name, (operation, *_) in QUERIES.items() if operation != "locate"]
ALLOCATED = [name for name in STATEFUL if QUERIES[name][0] != "paths"]


def allocated_by(query: Query[Any], opened: OpenMesh) -> int:
    """Return the bytes that are allocated at most, by all threads, while a query is answered."""
    tracemalloc.start()
    try:
        query.answer(opened, context())
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slice(3)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("name", ALLOCATED)
def test_bytes_of_memory(client: TestClient, ids: dict[str, str], name: str, mesh: str) -> None:
    surface, query = stored_mesh(client, ids[mesh]), query_of(name)
    new_mesh = lambda: OpenMesh(("", b""), gc.Solver(surface), [])  # noqa: E731
    query.answer(new_mesh(), context())  # loads kernels, whose memory is not the answer's
    estimated = estimate(query, Representation(JSON), new_mesh(), lambda: False)

    # Threads of the service allocate too, now and then: not three times in a row.
    peak = min(allocated_by(query, new_mesh()) for _ in range(3))
    assert 1 / 3 <= estimated.memory_bytes / peak <= 3


@pytest.mark.slice(2)
@pytest.mark.parametrize("name", STATEFUL)
def test_memory_that_suffices(
    client: TestClient, ids: dict[str, str], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three times the estimate does, a third does not."""
    for module in ("app.queries.matrix", "geodesic_core.matrices.threads"):
        monkeypatch.setattr(f"{module}.available_cores", lambda: 1)
    opened = OpenMesh(("", b""), gc.Solver(stored_mesh(client, ids["sphere"])), [])
    query = query_of(name)
    estimated = estimate(query, Representation(JSON), opened, lambda: False)

    with pytest.raises(gc.errors.MemoryLimitExceeded):
        query.answer(opened, context(memory=estimated.memory_bytes // 3))
    query.answer(opened, context(memory=3 * estimated.memory_bytes))


@pytest.mark.parametrize("name", ["rough", "rough lines", "rough paths", "rough dense"])
def test_on_rough_meshes_an_approximate_answer_costs_what_an_exact_one_does(
    client: TestClient, ids: dict[str, str], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = OpenMesh(("", b""), gc.Solver(stored_mesh(client, ids["knot"])), [])
    query = query_of(name)
    exact = {"method": "exact", "relative_error": None}
    as_exact = type(query)("m", query.request.model_copy(update=exact))
    merged = estimate(query, Representation(JSON), opened, lambda: False)
    monkeypatch.setitem(vars(opened.mesh), "is_rough", True)

    found, expected = (
        estimate(each, Representation(JSON), opened, lambda: False) for each in (query, as_exact)
    )

    assert (found.seconds, found.memory_bytes) == (expected.seconds, expected.memory_bytes)
    assert found.memory_bytes != merged.memory_bytes


def test_seconds_grow_with_the_work(client: TestClient, ids: dict[str, str]) -> None:
    def seconds(mesh: str, operation: str, **body: Any) -> float:
        link = f"/v1/meshes/{ids[mesh]}/{operation}?estimate=true"
        answer = client.post(link, json=body).json()
        assert answer["seconds"] > 0
        return float(answer["seconds"])

    large = upload_sample(client, "knot", 32_000)
    ids = ids | {"large": large}
    one = {"sources": SOME[:1]}
    everywhere = seconds("knot", "distances", **one)
    assert 4 * everywhere <= seconds("large", "distances", **one) <= 8 * everywhere
    assert seconds("knot", "distances", **one, max_distance=0.1) < everywhere / 4
    assert seconds("large", "distances", **one, **ROUGH) < seconds("large", "distances", **one)
    quick = [
        seconds("large", "distances", **one, **FAST | {"effort": effort}) for effort in (1, 2, 4, 8)
    ]
    assert quick == sorted(set(quick))
    assert quick[1] < seconds("large", "distances", **one, **ROUGH)
    row = seconds("large", "matrix", **one, targets=SOME)
    assert 5 * row <= seconds("large", "matrix", sources=MANY, targets=SOME) <= 40 * row
    ends = {"source": INSIDE, "target": {"vertex": 1900}}
    leg = seconds("large", "path", **ends)
    assert leg < seconds("large", "path", **ends, waypoints=SOME[:5]) <= 8 * leg
    few = seconds("large", "nearest", source=INSIDE, candidates=MANY, k=1)
    assert few < seconds("large", "nearest", source=INSIDE, candidates=MANY, k=len(MANY))


def test_seconds_of_all_kinds_are_off_by_one_factor(
    client: TestClient, ids: dict[str, str]
) -> None:
    """That factor is the machine's; each kind is allowed five times as much, or as little."""
    opened = OpenMesh(("", b""), gc.Solver(stored_mesh(client, ids["knot"])), [])
    factors = {}
    one_sweep = "all", "rough", "quick", "rough path", "quick path", "rough paths", "quick paths"
    for name in (*one_sweep, "pairs", "quick sparse", "quick pairs", "nearest", "legs", "lines"):
        query = query_of(name)
        estimated = estimate(query, Representation(JSON), opened, lambda: False).seconds
        factors[name] = min(processor_seconds(query, opened) for _ in range(3)) / estimated

    assert max(factors.values()) / min(factors.values()) < 25, factors


def processor_seconds(query: Query[Any], opened: OpenMesh) -> float:
    """Return how long the processor works on an answer, whatever else it has to do."""
    start = process_time()
    query.answer(opened, context())
    return process_time() - start


@pytest.mark.usefixtures("one_replica")
def test_an_estimate_is_not_kept_and_computes_nothing(
    client: TestClient, ids: dict[str, str]
) -> None:
    body = {"sources": [{"vertex": 77, "start_distance": 0.125}]}
    link = f"/v1/meshes/{ids['knot']}/distances"

    estimated = client.post(f"{link}?estimate=true", json=body)
    real = client.post(link, json=body)

    assert estimated.headers["cache-control"] == "no-store"
    assert estimated.headers["content-type"] == "application/json"
    assert "etag" not in estimated.headers
    assert "compute" in real.headers["server-timing"], "no result was there"
    assert client.post(f"{link}?estimate=false", json=body).headers["server-timing"] == "kept"
    assert client.post(f"{link}?estimate=true", json=body).json() == estimated.json()


def test_a_get_is_estimated_as_its_post(client: TestClient, ids: dict[str, str]) -> None:
    link = f"/v1/meshes/{ids['knot']}/path"
    body = {"source": {"vertex": 3}, "target": {"vertex": 700}}

    got = client.get(f"{link}?from=v3&to=v700&estimate=true")

    assert got.headers["cache-control"] == "no-store"
    assert got.json() == client.post(f"{link}?estimate=true", json=body).json()
    for query, code, place in (
        ("from=v3&to=v-7&estimate=true", "invalid_point", "/query/to"),
        ("from=v3&to=e0-1400:0.5&estimate=true", "invalid_point", "/query/to"),
        ("from=v3&to=v7&estimate=perhaps", "invalid_request", "/query/estimate"),
        ("from=v3&to=v7&estimate=true&via=7.0", "invalid_point", "/query/via/0"),
    ):
        problem = check_problem(client.get(f"{link}?{query}"), 422, code)
        assert [fault["pointer"] for fault in problem["errors"]] == [place]


def test_estimates_are_refused_as_answers_are(client: TestClient, ids: dict[str, str]) -> None:
    for operation, body, status, code in (
        ("distances", {"sources": []}, 422, "invalid_request"),
        ("distances", {"sources": [{"vertex": 10**6}]}, 422, "invalid_point"),
        ("distances", {"sources": [{"position": [0, 0, 1e60]}]}, 422, "invalid_point"),
        ("locate", {"points": [[0, 0, 0], [0, 0, 1e60]]}, 422, "invalid_point"),
        ("locate", {"points": []}, 422, "invalid_request"),
    ):
        for query in ("", "?estimate=true"):
            link = f"/v1/meshes/{ids['knot']}/{operation}{query}"
            check_problem(client.post(link, json=body), status, code)
    link = f"/v1/meshes/{ids['knot']}/distances?format=npy&estimate=true"
    body = {"sources": [{"vertex": 0}], "include": ["nearest_source"]}
    check_problem(client.post(link, json=body), 422, "invalid_request")
    link = f"/v1/meshes/{ids['knot']}/nearest?format=npy&estimate=true"
    body = {"source": INSIDE, "candidates": SOME}
    check_problem(client.post(link, json=body), 406, "not_acceptable")
    link = f"/v1/meshes/{'0' * 32}/distances?estimate=true"
    check_problem(client.post(link, json={"sources": SOME}), 404, "mesh_not_found")


@pytest.mark.parametrize("name", QUERIES)
def test_queries_reach_workers_as_they_are(name: str) -> None:
    query = query_of(name)

    revived = pickle.loads(pickle.dumps(query))  # noqa: S301 - our own

    assert revived == query
    assert type(revived) is type(query)

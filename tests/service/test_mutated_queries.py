"""Mutated queries of every kind: each is answered as documented, and the next good one to the bit.

With ``--full`` there are 1000 for each operation.
"""

import json
import re
from collections.abc import Iterator, Mapping
from io import BytesIO
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import geodesic_core as gc
from tests.service.test_examples import DOCUMENT, OPERATIONS, QUERIES
from tests.support.mutations import NUMBERS, TEXT, mutated, mutated_json
from tests.support.service import NPY, ServiceClient, check_problem, stored_mesh

BATCHES, CASES = 20, 50
PROBLEM = Draft202012Validator(
    {"$ref": "#/components/schemas/ProblemDocument", "components": DOCUMENT["components"]}
)
MORE_SEEDS: Mapping[str, tuple[Any, ...]] = {
    "computeDistances": (
        {
            "sources": [
                {"position": [0.3, 0.4, 0], "max_distance": 1},
                {"polyline": [{"vertex": 0}, {"vertex": 1}], "start_distance": 0.25},
            ],
            "max_distance": 0.5,
            "barriers": [7, 8],
            "include": ["nearest_source", "gradient"],
        },
    ),
    "computeIsolines": (
        {"values": [0.5, None, -1], "levels": [0], "include": ["locations"]},
        {"sources": [{"vertex": 0}], "count": 5, "method": "approximate", "absolute_error": 0.1},
    ),
    "computeBorders": (
        {"sources": [{"vertex": 0}, {"vertex": 9}], "chord_error": 0.01, "barriers": [7]},
    ),
    "computeBoundaries": ({"barriers": [7], "include": ["locations"]},),
    "computePath": ({"source": {"vertex": 0}, "target": {"vertex": 9}, "max_distance": 9},),
    "computePathSteps": ({"source": 0, "target": 9, "waypoints": [7], "barriers": [5]},),
    "followSweep": ({"sources": [0, {"edge": [0, 1], "t": 0.5}], "steps": 9, "barriers": [5]},),
    "computePaths": (
        {"source": {"polyline": [{"vertex": 0}, {"vertex": 1}]}, "targets": [{"vertex": 9}]},
    ),
    "computeMatrix": (
        {
            "sources": [{"vertex": 0}],
            "targets": [{"vertex": 9}],
            "layout": "pairs",
            "barriers": [5],
        },
    ),
    "findNearest": (
        {
            "source": {"vertex": 0},
            "candidates": [{"vertex": 9}, {"face": 3, "barycentric": [1, 0, 0]}],
        },
    ),
    "computeLogMap": (
        {"source": 0, "x_axis": {"vertex": 9}, "rescale": False, "max_distance": 0.5},
        {"source": {"edge": [0, 1], "t": 0.5}, "x_axis": [1, 0, 0], "barriers": [7]},
    ),
    "traceLines": (
        {
            "starts": [{"vertex": 7}, {"face": 3, "barycentric": [0.2, 0.3, 0.5]}],
            "directions": [[1, 0, 0], [0, 1, 0]],
            "lengths": [0.5],
            "at_vertices": "stop",
            "barriers": [7],
        },
    ),
    "samplePoints": (
        {
            "radius": 0.5,
            "starts": [3, {"face": 0, "barycentric": [0.2, 0.3, 0.5]}],
            "iterations": 2,
            "include": ["distances"],
            "barriers": [7],
        },
    ),
    "computeCells": (
        {
            "sources": [0, {"polyline": [3, {"edge": [0, 1], "t": 0.5}]}],
            "max_distance": 1.5,
            "chord_error": 0.1,
            "barriers": [7],
        },
    ),
    "findMean": ({"points": [0, {"face": 0, "barycentric": [0.2, 0.3, 0.5]}], "weights": [1, 2]},),
    "findLoops": (
        {"through": {"edge": [0, 1], "t": 0.5}, "barriers": [7], "include": ["locations"]},
        {"curves": [{"polyline": [0, {"vertex": 1}], "closed": True}]},
    ),
    "cutMesh": (
        {
            "curves": [
                {"polyline": [0, {"face": 0, "barycentric": [0.2, 0.3, 0.5]}], "closed": True}
            ],
            "separate": False,
        },
    ),
    "locatePoints": ({"points": [[0.5, 0.5, 1]], "max_distance": 0.5},),
}
"""What the examples of the interface document do not have"""

PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "format": ("json", "npy", "npz", "octets", "obj", "ply", "csv", "JSON"),
    "dtype": ("float32", "float64", "float16"),
}
HEADERS: Mapping[str, tuple[str, ...]] = {
    "Content-Type": (
        *(
            "application/json; charset=utf-16",
            "text/plain",
            "application/x-npy",
            "",
            "json",
            "a/b;",
        ),
        *("application/problem+json", "multipart/form-data", "application/json" + "x" * 999),
    ),
    "Content-Encoding": ("gzip", "br", "identity", "gzip, gzip"),
    "Accept": ("application/x-npy", "text/csv", "image/*;q=0.1", "a/b", "*/*;q=0", ";;", "text/"),
    "Accept-Encoding": ("gzip", "zstd", "identity;q=0", "*;q=0", "gzip;q=nan", ",,"),
    "Prefer": ("respond-async", "respond-async, wait=1", "wait=99999999999999999999", ";", '"'),
    "Idempotency-Key": ("", "x", "x" * 256, "\xff"),
    "Range": ("bytes=0-9", "bytes=-5", "bytes=9-0", "bytes=", "lines=1-2", "bytes=0-,0-,0-"),
    "If-None-Match": ("*", '"x"', "W/"),
    "X-Timeout-Ms": NUMBERS,
}
POINTS = ("v0", "v120", "e0-1:0.3", "f7:0.2,0.3,0.5", "p0.1,0.2,0", "0")


class Sent(NamedTuple):
    """A request for a query."""

    body: bytes | None
    """None of a query that ``GET`` asks"""
    parameters: list[tuple[str, str]]
    headers: dict[str, str]

    def send(self, client: ServiceClient, operation_id: str, mesh_id: str) -> Any:
        method, template, _ = OPERATIONS[operation_id]
        link = template.replace("{mesh_id}", mesh_id)
        headers = {name: value.encode("latin-1", "replace") for name, value in self.headers.items()}
        return client.request(
            method, link, content=self.body, params=self.parameters, headers=headers
        )


def seeds(operation_id: str) -> list[Any]:
    described = OPERATIONS[operation_id][2]["requestBody"]["content"]["application/json"]
    values = [example["value"] for example in described["examples"].values()]
    return [*values, *MORE_SEEDS[operation_id]]


def one_case(operation_id: str, number: int) -> Sent:
    random = Random(f"{operation_id} {number}")
    sent = Sent(None, [], {})
    if operation_id == "getPath":
        sent.parameters.extend(mutated_path(random))
    else:
        tree = random.choice(seeds(operation_id))
        kind = random.random()
        body = json.dumps(tree).encode() if kind < 0.2 else mutated_json(random, tree)
        if kind > 0.85:
            body = mutated(random, json.dumps(tree).encode(), TEXT)
        sent = sent._replace(body=body, headers={"Content-Type": "application/json"})
    if random.random() < 0.3:
        name = random.choice([*PARAMETERS, "none"])
        sent.parameters.append((name, random.choice(PARAMETERS.get(name, ("1",)))))
    while random.random() < 0.3:
        name = random.choice(list(HEADERS))
        value = random.choice(HEADERS[name])
        if name == "Idempotency-Key" and value == "x":
            value = f"{operation_id} {number}"
        sent.headers[name] = value
    return sent


def mutated_path(random: Random) -> Iterator[tuple[str, str]]:
    """Yield query parameters of a path, a few of them damaged."""
    names = ["from", "to", *random.choices(("via", "from", "method"), k=2)]
    for name in names:
        value = random.choice(POINTS)
        if name == "method":
            value = random.choice(("exact", "approximate", "fast"))
        if random.random() < 0.5:
            value = mutated(random, value.encode(), TEXT).decode("utf-8", "replace")[:2000]
        if random.random() < 0.95:
            yield name, value


def check_answer(operation_id: str, sent: Sent, response: Any) -> None:
    """Check that an answer is as documented, and that a refusal names the element at fault."""
    described = OPERATIONS[operation_id][2]["responses"]
    assert str(response.status_code) in described, response.status_code
    if response.status_code < 400:
        if response.status_code == 200 and response.headers["content-type"] == "application/json":
            json.loads(response.content, parse_constant=pytest.fail)
        return
    problem = check_problem(response, response.status_code, response.json()["code"])
    PROBLEM.validate(problem)
    assert problem["code"] in described[str(response.status_code)]["description"].split(", ")
    if response.status_code >= 500:
        assert problem["code"] == "deadline_exceeded"
        assert "X-Timeout-Ms" in sent.headers
    if problem["code"] in ("invalid_request", "invalid_point"):
        check_place(problem, sent)


def check_place(problem: Any, sent: Sent) -> None:
    """Check that a refusal points to a member of the request, or to where one is missing."""
    faults = problem.get("errors", [])
    assert faults or re.search(r"at line \d+ column \d+", problem["detail"]), problem["detail"]
    for fault in faults:
        if not fault["pointer"].startswith(("/header/", "/query/")):
            assert sent.body is not None
            is_missing = fault["message"].startswith(
                ("Field required", "give levels", "give sources, or values", "give at least one of")
            )
            assert is_there(json.loads(sent.body), fault["pointer"]) != is_missing, fault


def is_there(document: Any, pointer: str) -> bool:
    """Whether a JSON pointer leads to a value; all but its last part must lead to one."""
    *parts, last = pointer.split("/")
    if not parts:
        return True
    for part in parts[1:]:
        document = document[int(part) if isinstance(document, list) else _plain(part)]
    if isinstance(document, list):
        return int(last) < len(document)
    return _plain(last) in document


def _plain(part: str) -> str:
    return part.replace("~1", "/").replace("~0", "~")


@pytest.fixture(scope="module")
def mesh(client: ServiceClient, plane: str) -> gc.TriangleMesh:
    return stored_mesh(client, plane)


@pytest.fixture
def undisturbed(client: ServiceClient, plane: str, mesh: gc.TriangleMesh) -> Iterator[None]:
    """Have the same workers before and after, and a good query answered right to the bit."""
    client.wait_until_idle()
    workers = client.workers()
    yield
    for job in client.get("/v1/jobs", params={"limit": 1000}).json()["jobs"]:
        client.delete(f"/v1/jobs/{job['id']}")
    client.wait_until_idle()
    assert client.workers() == workers
    start = np.random.default_rng().random()  # such as was not asked for before
    source = {"vertex": 7, "start_distance": start}
    link = f"/v1/meshes/{plane}/distances"
    answer = client.post(link, json={"sources": [source]}, headers=NPY).content
    expected = gc.exact_distance(mesh, gc.Source(gc.SurfacePoint.vertex(7), start)).distances
    np.testing.assert_array_equal(np.load(BytesIO(answer)), expected)


@pytest.mark.slice(7)
@pytest.mark.usefixtures("undisturbed")
@pytest.mark.parametrize(
    ("operation_id", "batch"), [(name, batch) for name in QUERIES for batch in range(BATCHES)]
)
def test_a_mutated_query_is_answered_as_documented(
    client: ServiceClient, plane: str, operation_id: str, batch: int
) -> None:
    for number in range(batch * CASES, (batch + 1) * CASES):
        sent = one_case(operation_id, number)
        response = sent.send(client, operation_id, plane)
        try:
            check_answer(operation_id, sent, response)
        except BaseException as error:
            error.add_note(f"case {number} of {operation_id}: {str(sent)[:2000]}")
            error.add_note(f"{response.status_code}: {response.text[:2000]}")
            raise

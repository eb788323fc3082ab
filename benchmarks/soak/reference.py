"""The plan of a soak, with right answers from the library alone: no service, store or cache."""

import gzip
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from random import Random
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import FORMATS, JSON, Representation, encode
from app.queries import KINDS, ExecutionContext, MeshSize
from app.store.meshes import OpenMesh
from benchmarks.soak.plan import Expected, Plan, Request, Upload, digest_of

FILES = ("obj", "off", "ply", "stl", "glb")
OPERATIONS = {
    "distances": "computeDistances",
    "path": "computePath",
    "paths": "computePaths",
    "isolines": "computeIsolines",
    "matrix": "computeMatrix",
    "nearest": "findNearest",
    "locate": "locatePoints",
}
MISSING = "0" * 32
JSON_BODY = {"Content-Type": JSON}


@dataclass(frozen=True)
class Scale:
    """The size of a plan."""

    meshes: Mapping[str, int]
    """Faces of the samples that are there from the beginning"""
    large_faces: int
    variants: int
    rounds: int
    """Questions of each form on each mesh"""


WHOLE = Scale(
    {"knot": 600, "plane": 2_000, "obstacles": 5_000, "terrain": 12_000, "sphere": 40_000},
    large_faces=100_000,
    variants=60,
    rounds=8,
)
SHORT = Scale({"knot": 600, "terrain": 3_000}, large_faces=20_000, variants=6, rounds=1)


def make_plan(scale: Scale) -> Plan:
    """Return the same plan each time."""
    random = Random(21)  # noqa: S311 - the same questions in each run
    meshes, queries, opened = [], [], []
    for name, faces in scale.meshes.items():
        sample = gc.samples.SAMPLES[name](faces)
        body = {"vertices": sample.vertices.tolist(), "faces": sample.faces.tolist()}
        mesh = OpenMesh.of(sample)
        opened.append(mesh)
        meshes.append(_upload(mesh, "", json.dumps(body).encode(), JSON_BODY, random))
        queries += [each for _ in range(scale.rounds) for each in _queries(mesh, random)]
    large = OpenMesh.of(gc.samples.sphere(scale.large_faces))
    path = f"?sample=sphere&faces={scale.large_faces}"
    meshes.append(_upload(large, path, b"", {}, random))
    return Plan(
        meshes,
        [_variant(number, random) for number in range(scale.variants)],
        queries,
        [other for mesh in opened for other in _others(mesh)],
        list(_wrong(opened[0])),
        large.name[0],
    )


# Uploads


def _upload(
    opened: OpenMesh, parameters: str, body: bytes, headers: Mapping[str, str], random: Random
) -> Upload:
    expected = Expected(201, headers={"Location": f"/v1/meshes/{opened.name[0]}"})
    request = Request("createMesh", "POST", f"/v1/meshes{parameters}", body, headers, expected)
    ends = random.sample(range(len(opened.mesh.vertices)), 2)
    query = {"source": {"vertex": ends[0]}, "target": {"vertex": ends[1]}}
    return Upload(request, opened.name[0], _query(opened, "path", query))


def _variant(number: int, random: Random) -> Upload:
    """Return a mesh of its own, in one of several file formats, every other one compressed."""
    name = random.choice(sorted(gc.samples.SAMPLES))
    sample = gc.samples.SAMPLES[name](int(500 * 2 ** random.uniform(0, 5)))
    kind = FILES[number % len(FILES)]
    mesh = trimesh.Trimesh((1.0 + number / 128) * sample.vertices, sample.faces, process=False)
    written = mesh.export(file_type=kind)
    body = written.encode() if isinstance(written, str) else bytes(written)
    opened, headers = OpenMesh.of(gc.load_mesh(body, kind)), {}
    if number % 2:
        body, headers = gzip.compress(body, 1), {"Content-Encoding": "gzip"}
    return _upload(opened, f"?format={kind}", body, headers, random)


# Queries


def _queries(opened: OpenMesh, random: Random) -> Iterator[Request]:
    """Yield a question of each form."""
    vertices, triangles = opened.mesh.vertices, opened.mesh.faces
    radius = float((vertices.max(axis=0) - vertices.min(axis=0)).max()) / 4

    def vertex() -> dict[str, Any]:
        return {"vertex": random.randrange(len(vertices))}

    def inside() -> dict[str, Any]:
        weight = random.random()
        weights = [weight, (1 - weight) / 4, 0.75 * (1 - weight)]
        return {"face": random.randrange(len(triangles)), "barycentric": weights}

    def position() -> list[float]:
        return [float(x) for x in vertices[random.randrange(len(vertices))] * 1.01]

    def some(make: Callable[[], Any], count: int) -> list[Any]:
        return [make() for _ in range(count)]

    def ask(kind: str, form: str = "json", dtype: str = "float64", **body: Any) -> Request:
        return _query(opened, kind, body, form, dtype)

    approximate: dict[str, Any] = {"method": "approximate", "relative_error": 0.01}
    fast: dict[str, Any] = {"method": "fast", "effort": 1}
    barriers = random.sample(range(len(triangles)), 5)
    yield ask("path", source=vertex(), target=vertex())
    yield ask("path", source=inside(), target=vertex(), waypoints=[vertex()])
    yield ask("path", source=vertex(), target=inside(), **approximate)
    yield ask("path", "npy", source=vertex(), target=vertex())
    yield ask("path", source=vertex(), target=vertex(), barriers=barriers)
    yield _written_path(opened, *some(vertex, 2))
    yield ask("paths", source=vertex(), targets=some(vertex, 4))
    yield ask("distances", sources=[vertex()])
    yield ask("distances", "npy", sources=some(vertex, 3))
    yield ask("distances", "npy", "float32", sources=[vertex()], **approximate)
    yield ask("distances", "csv", sources=[inside()], targets=some(vertex, 20))
    yield ask("distances", sources=[vertex()], include=["nearest_source"], max_distance=radius)
    yield ask("distances", sources=[vertex()], **approximate)
    yield ask("distances", "npy", sources=some(vertex, 2), **fast)
    yield ask("paths", source=inside(), targets=some(vertex, 3), **fast)
    yield ask("distances", "ply", sources=[vertex()], barriers=barriers)
    yield ask("isolines", sources=[vertex()], count=5)
    yield ask("isolines", "obj", sources=[vertex()], levels=[radius / 2, radius])
    yield ask("isolines", "csv", sources=[vertex()], count=3, **approximate)
    yield ask("matrix", sources=some(vertex, 3), targets=some(vertex, 5))
    yield ask("matrix", "npy", sources=some(vertex, 4), targets=some(vertex, 4), layout="pairs")
    yield ask(
        "matrix",
        sources=some(vertex, 3),
        targets=some(vertex, 30),
        layout="sparse",
        max_distance=radius,
    )
    yield ask("nearest", source=vertex(), candidates=some(vertex, 20), k=3)
    yield ask("nearest", "csv", source=inside(), candidates=some(vertex, 9), k=9)
    yield ask("locate", points=some(position, 10))
    yield ask("locate", "csv", points=some(position, 3), max_distance=radius)


def _query(
    opened: OpenMesh,
    kind: str,
    body: Mapping[str, Any],
    form: str = "json",
    dtype: str = "float64",
) -> Request:
    """Return a query with the answer that this process gives."""
    mesh_id, parameters = opened.name[0], f"?format={form}&dtype={dtype}"
    return Request(
        OPERATIONS[kind],
        "POST",
        f"/v1/meshes/{mesh_id}/{kind}{parameters}",
        json.dumps(body).encode(),
        JSON_BODY,
        _answer(opened, kind, body, Representation(FORMATS[form], dtype)),
    )


def _written_path(
    opened: OpenMesh, source: Mapping[str, int], target: Mapping[str, int]
) -> Request:
    link = f"/v1/meshes/{opened.name[0]}/path?from=v{source['vertex']}&to=v{target['vertex']}"
    body = {"source": source, "target": target}
    expected = _answer(opened, "path", body, Representation(JSON))
    return Request("getPath", "GET", link, expected=expected)


def _answer(
    opened: OpenMesh, kind: str, body: Mapping[str, Any], representation: Representation
) -> Expected:
    report = opened.mesh.report
    size = MeshSize(report.vertices, report.faces, report.mean_edge_length)
    query_class = KINDS[kind]
    request = query_class.model.model_validate(body)
    query = query_class.ask(opened.name[0], size, request)
    if len(query.barriers):
        opened = query.with_barriers(opened)
    context = ExecutionContext(lambda: False, lambda _: None)
    parts, headers = encode(query.answer(opened, context), representation)
    return Expected(digest=digest_of(b"".join(parts)), headers=headers)


# Requests that need no worker


def _others(opened: OpenMesh) -> Iterator[Request]:
    link = f"/v1/meshes/{opened.name[0]}"
    yield Request("getMesh", "GET", link)
    vertices = _npy_digest(opened.mesh.vertices)
    yield Request("getMeshArray", "GET", f"{link}/arrays/vertices", expected=vertices)
    some = Expected(status=206, digest=digest_of(b"\x93NUMPY"))
    first = {"Range": "bytes=0-5"}
    yield Request("getMeshArray", "GET", f"{link}/arrays/faces", headers=first, expected=some)
    for operation, path in (
        ("getAbout", "/v1"),
        ("listMeshes", "/v1/meshes?limit=20"),
        ("listJobs", "/v1/jobs"),
        ("getLiveness", "/livez"),
        ("getReadiness", "/readyz"),
        ("getMetrics", "/metrics"),
        ("getOpenapi", "/openapi.json"),
        ("getProblem", "/problems/queue_full"),
    ):
        yield Request(operation, "GET", path)


def _npy_digest(array: NDArray[np.float64]) -> Expected:
    file = BytesIO()
    np.save(file, np.ascontiguousarray(array))
    return Expected(digest=digest_of(file.getvalue()))


# Wrong requests


def _wrong(opened: OpenMesh) -> Iterator[Request]:
    """Yield requests to a mesh of Alice's that must be refused, with the code of each."""
    link, path = f"/v1/meshes/{opened.name[0]}", "computePath"
    ends: dict[str, Any] = {"source": {"vertex": 0}, "target": {"vertex": 1}}
    beyond = {**ends, "target": {"vertex": 10**9}}

    def post(
        operation: str,
        path: str,
        status: int,
        code: str,
        body: Any = ends,
        headers: Mapping[str, str] = JSON_BODY,
    ) -> Request:
        sent = body if isinstance(body, bytes) else json.dumps(body).encode()
        return Request(operation, "POST", path, sent, headers, Expected(status, code))

    def get(operation: str, path: str, status: int, code: str, **headers: str) -> Request:
        expected = Expected(status, code)
        return Request(operation, "GET", path, headers=headers, expected=expected)

    yield post(path, f"{link}/path", 400, "malformed_body", b'{"source":')
    yield get("none", "/v1/nothing", 404, "not_found")
    yield get("getMesh", f"/v1/meshes/{MISSING}", 404, "mesh_not_found")
    yield post(path, f"/v1/meshes/{MISSING}/path", 404, "mesh_not_found")
    yield get("getJob", f"/v1/jobs/{MISSING}", 404, "job_not_found")
    yield get("computeDistances", f"{link}/distances", 405, "method_not_allowed")
    yield post(path, f"{link}/path", 406, "not_acceptable", headers={**JSON_BODY, "Accept": "a/b"})
    yield post(path, f"{link}/path", 415, "unsupported_media_type", headers={"Content-Type": "a/b"})
    array = f"{link}/arrays/vertices"
    yield get("getMeshArray", array, 416, "range_not_satisfiable", Range="bytes=99999999-")
    yield post(path, f"{link}/path", 422, "invalid_request", {**ends, "unknown": 1})
    yield post(path, f"{link}/path", 422, "invalid_point", beyond)
    too_many = {"sources": [0] * 10_001}
    yield post("computeDistances", f"{link}/distances", 422, "limit_exceeded", _points(too_many))
    one_face = {"vertices": [[0, 0, 0]], "faces": [[0, 0, 7]]}
    yield post("createMesh", "/v1/meshes", 422, "invalid_mesh", one_face)
    yield post("createMesh", "/v1/meshes?format=ply", 422, "invalid_mesh", b"ply\nformat")
    secret = {"Authorization": "Bearer wrong-0123456789abcdef"}
    yield get("none", "/v1", 401, "unauthorized", **secret)
    yield get("none", "/v1", 421, "host_not_allowed", Host="evil.example")
    headers = {**JSON_BODY, "Origin": "https://evil.example"}
    yield post(path, f"{link}/path", 403, "origin_not_allowed", headers=headers)


def _points(body: Mapping[str, Sequence[int]]) -> Mapping[str, Any]:
    return {name: [{"vertex": vertex} for vertex in each] for name, each in body.items()}

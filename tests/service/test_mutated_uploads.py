"""Mutated mesh files over HTTP, as they are, compressed, and as JSON: the library's word holds.

With ``--full`` there are 200 of each format, each as it is and compressed. Those of the library
alone are more: `tests.core.io.test_mutated_files`.
"""

import gzip
import json
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import pytest

import geodesic_core as gc
from app.engine.mesh_json import read_json_mesh
from app.errors import ProblemError
from app.store.layout import TEMPORARY
from geodesic_core.errors import InvalidMesh
from tests.core.io.test_mutated_files import one_case
from tests.service.test_examples import OPERATIONS
from tests.service.test_mutated_queries import PROBLEM
from tests.support.mesh_seeds import SEEDS, json_mesh, type_of
from tests.support.mutations import BYTES, TEXT, mutated, mutated_json
from tests.support.service import ServiceClient, check_problem

BATCHES, CASES = 8, 50
FORMATS = [*SEEDS, "json"]
FREE_BYTES, MOST_TIMES = 2**20, 100
"""What a compressed body may hold: so many bytes in any case, and so many times its own"""
PACKED = (b"\x1f\x8b", b"BZh", b"\xfd7zXZ\0", b"PK\x03\x04")
"""What a packed file begins with: it is refused in a compressed body"""
STATUSES = OPERATIONS["createMesh"][2]["responses"]


def mesh_file(name: str, number: int) -> bytes:
    if name != "json":
        return one_case(name, number)
    random = Random(f"{name} {number}")
    if random.random() < 0.7:
        return mutated_json(random, json_mesh())
    return mutated(random, json.dumps(json_mesh()).encode(), TEXT)


def expected(name: str, data: bytes) -> gc.TriangleMesh | InvalidMesh | ProblemError:
    """Return what the library makes of a file."""
    try:
        if name == "json":
            faces, vertices, lengths = read_json_mesh(data)
            if lengths is not None:
                return gc.TriangleMesh.from_lengths(faces, lengths, vertices)
            return gc.TriangleMesh(vertices, faces)
        return gc.load_mesh(data, type_of(name), max_faces=5_000_000)
    except (InvalidMesh, ProblemError) as error:
        return error


def post(client: ServiceClient, name: str, data: bytes, **headers: str) -> Any:
    own = {"Content-Type": "application/octet-stream"} | headers
    if name == "json":
        own["Content-Type"] = "application/json"
    parameters = {} if name == "json" else {"format": type_of(name)}
    return client.post("/v1/meshes", params=parameters, content=data, headers=own)


def check_upload(client: ServiceClient, name: str, data: bytes, response: Any) -> None:
    """Check that an upload is stored as the library reads it, or refused in its words."""
    found = expected(name, data) if data else InvalidMesh("empty")
    if isinstance(found, gc.TriangleMesh):
        assert response.status_code in (200, 201), response.text
        document = response.json()
        assert (document["vertices"], document["faces"]) == (len(found.vertices), len(found.faces))
        if response.status_code == 201:  # else they are those of the file that came first
            assert document["warnings"] == list(found.warnings)
        again = post(client, name, data)
        assert (again.status_code, again.json()["id"]) == (200, document["id"])
        return
    problem = check_refusal(response)
    if isinstance(found, ProblemError):
        assert (problem["code"], problem["detail"]) == (found.problem.code, found.problem.detail)
    elif data:
        assert (problem["code"], problem["detail"]) == ("invalid_mesh", str(found))


def check_refusal(response: Any) -> Any:
    problem = check_problem(response, response.status_code, response.json()["code"])
    PROBLEM.validate(problem)
    assert problem["code"] in STATUSES[str(response.status_code)]["description"].split(", ")
    assert response.status_code < 500
    return problem


def decompressed(data: bytes) -> tuple[bytes, bool]:
    """Return what gzip has compressed, up to where it is damaged, and whether it is whole."""
    content = bytearray()
    with gzip.open(BytesIO(data)) as source:
        try:
            while block := source.read1():
                content += block
        except (gzip.BadGzipFile, EOFError, zlib.error):
            return bytes(content), False
    return bytes(content), True


def check_compressed(client: ServiceClient, name: str, sent: bytes, response: Any) -> None:
    """Check an upload with ``Content-Encoding: gzip``: neither damaged, too large nor packed."""
    content, is_whole = decompressed(sent)
    is_too_large = len(content) > FREE_BYTES + MOST_TIMES * len(sent)
    refusals = set[str]()
    if is_too_large:
        refusals.add("upload_too_large")
    if not is_whole:
        refusals.add("malformed_body")
    elif not is_too_large and content.startswith(PACKED):
        refusals.add("unsupported_media_type")
    if refusals:
        assert check_refusal(response)["code"] in refusals
    else:
        check_upload(client, name, content, response)


@pytest.fixture
def undisturbed(client: ServiceClient) -> Iterator[None]:
    """Have the same workers before and after; leave no mesh and no file behind."""
    client.wait_until_idle()
    workers, meshes = client.workers(), ids(client)
    yield
    for mesh_id in ids(client) - meshes:
        assert client.delete(f"/v1/meshes/{mesh_id}").status_code == 204
    client.wait_until_idle()
    assert client.workers() == workers
    store: Path = client.app.state.service.settings.store  # type: ignore[attr-defined]
    assert not list((store / TEMPORARY).iterdir())


def ids(client: ServiceClient) -> set[str]:
    listed = client.get("/v1/meshes", params={"limit": 1000}).json()
    return {mesh["id"] for mesh in listed["meshes"]}


@pytest.mark.slice(2)
@pytest.mark.usefixtures("undisturbed")
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    ("name", "batch"), [(name, batch) for name in FORMATS for batch in range(BATCHES)]
)
def test_a_mutated_upload_is_stored_or_refused_as_the_library_says(
    client: ServiceClient, name: str, batch: int, compressed: bool
) -> None:
    for number in range(batch * CASES, (batch + 1) * CASES)[compressed::2]:
        data = mesh_file(name, number)
        try:
            if not compressed:
                check_upload(client, name, data, post(client, name, data))
                continue
            sent, random = gzip.compress(data, mtime=0), Random(number)
            if number % 4 == 1:
                sent = mutated(random, sent, BYTES)
            response = post(client, name, sent, **{"Content-Encoding": "gzip"})
            check_compressed(client, name, sent, response)
        except BaseException as error:
            error.add_note(f"case {number} of {name}: {data[:2000]!r}")
            raise

"""The examples of the interface document, sent as they are written, to a service that runs."""

import json
import re
from base64 import b64decode
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from openapi_spec_validator import validate
from starlette.testclient import TestClient

from app.http.openapi import complete
from tests.app.http.test_openapi import COMMITTED
from tests.support.service import Serve, wait_until

DOCUMENT = json.loads(COMMITTED.read_bytes())
OPERATIONS = {
    operation["operationId"]: (method, template, operation)
    for template, path in DOCUMENT["paths"].items()
    for method, operation in path.items()
}
JOB = OPERATIONS["getJob"][2]["parameters"][0]["examples"]["successful"]["value"]
CHANGING = {
    "created",
    "started",
    "finished",
    "request_id",
    "seconds",
    "limits",
    "page",
    "worst_face",
}
"""Members that two answers need not share; there may be a page or none, and rounding decides which
of many faces is the worst."""
OF_THE_DAY = {"listMeshes", "listJobs", "getMetrics"}
"""Operations whose answers depend on all that came before."""


def names_in(described: Any) -> Iterator[str]:
    """Yield the names of all examples in a part of the document."""
    if isinstance(described, dict):
        if isinstance(described.get("examples"), dict):
            yield from described["examples"]
        for part in described.values():
            yield from names_in(part)
    elif isinstance(described, list):
        for part in described:
            yield from names_in(part)


QUERIES = [
    operation_id
    for operation_id, (_, _, operation) in OPERATIONS.items()
    if operation["tags"] == ["queries"]
]
OTHERS = [operation_id for operation_id in OPERATIONS if operation_id not in QUERIES]


@pytest.fixture(scope="module")
def documented(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    with serve(tmp_path_factory.mktemp("documented")) as client:
        client.headers["Accept-Encoding"] = "identity"
        yield client


def test_the_document_is_openapi() -> None:
    validate(DOCUMENT)


def test_the_service_hands_out_the_committed_document(documented: TestClient) -> None:
    assert documented.get("/openapi.json").json() == DOCUMENT


def test_every_operation_has_an_example_that_succeeds() -> None:
    for operation_id, (_, _, operation) in OPERATIONS.items():
        assert any(example_of(operation, name)[1][0] < "400" for name in names_in(operation)), (
            operation_id
        )


def test_an_example_of_a_parameter_that_is_not_there_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    example = {"a": {"summary": "a", "parameters": {"colour": 1}, "response": {"status": 200}}}
    (tmp_path / "getAbout.json").write_text(json.dumps(example))
    monkeypatch.setattr("app.http.openapi.EXAMPLES", tmp_path)
    about = {"operationId": "getAbout", "responses": {"200": {"description": "well"}}}
    document = {"paths": {"/v1": {"get": about}}, "components": {"schemas": {}}}

    with pytest.raises(ValueError, match="getAbout has no parameter colour"):
        complete(document)


def example_of(operation: Mapping[str, Any], name: str) -> tuple[Any, tuple[str, Any, Any]]:
    """Return an example's request (parameters, media type, body) and answer (status, …)."""
    given = {
        (parameter["in"], parameter["name"]): parameter["examples"][name]["value"]
        for parameter in operation.get("parameters", ())
        if name in parameter.get("examples", ())
    }
    body = shown(operation.get("requestBody", {}), name)
    for status, response in operation["responses"].items():
        answer = shown(response, name)
        if answer is not None:
            return (given, body), (status, *answer)
    return (given, body), (min(operation["responses"]), None, None)


def shown(place: Mapping[str, Any], name: str) -> tuple[str, Any] | None:
    for media_type, content in place.get("content", {}).items():
        if name in content.get("examples", ()):
            return media_type, content["examples"][name]["value"]
    return None


def send(client: TestClient, operation_id: str, name: str, job: str = "") -> Any:
    """Send an example as it is written, but for the id of a job."""
    method, template, operation = OPERATIONS[operation_id]
    (given, body), _ = example_of(operation, name)
    where: dict[str, dict[str, Any]] = {"path": {}, "query": {}, "header": {}}
    for (place, parameter), value in given.items():
        where[place][parameter] = job if parameter == "job_id" and value == JOB else value
    headers = {parameter: str(value) for parameter, value in where["header"].items()}
    content = None
    if body is not None:
        headers["Content-Type"] = body[0]
        content = body[1] if isinstance(body[1], str) else json.dumps(body[1])
    path = template.format(**where["path"])
    return client.request(method, path, params=where["query"], headers=headers, content=content)


@pytest.mark.parametrize("operation_id", QUERIES)
def test_queries_are_answered_as_documented(documented: TestClient, operation_id: str) -> None:
    replay_all(documented, operation_id)


@pytest.mark.parametrize("operation_id", OTHERS)
def test_all_else_is_answered_as_documented(documented: TestClient, operation_id: str) -> None:
    replay_all(documented, operation_id)


def replay_all(client: TestClient, operation_id: str) -> None:
    for name in dict.fromkeys(names_in(OPERATIONS[operation_id][2])):
        replay(client, operation_id, name, set_up(client, operation_id))


def set_up(client: TestClient, operation_id: str) -> str:
    """Make what the examples speak of: the tent, and the job that measures it; return its id."""
    for job in client.get("/v1/jobs").json()["jobs"]:
        client.delete(f"/v1/jobs/{job['id']}")
    for mesh in client.get("/v1/meshes").json()["meshes"]:
        client.delete(f"/v1/meshes/{mesh['id']}")
    if operation_id == "createMesh":
        return JOB
    assert send(client, "createMesh", "json").status_code == 201
    if OPERATIONS[operation_id][2]["tags"] != ["jobs"]:
        return JOB
    job_id = send(client, "computeDistances", "job").json()["id"]
    wait_until(lambda: client.get(f"/v1/jobs/{job_id}").json()["status"] == "successful")
    return str(job_id)


def replay(client: TestClient, operation_id: str, name: str, job_id: str) -> None:
    """Send an example, and check that the answer is the documented one."""
    operation = OPERATIONS[operation_id][2]
    _, (status, media_type, expected) = example_of(operation, name)

    response = send(client, operation_id, name, job_id)

    assert response.status_code == int(status), response.text
    described = operation["responses"][status]
    check_headers(response, described)
    if media_type is None:
        assert response.content == b""
        return
    assert response.headers["content-type"].partition(";")[0] == media_type
    answer = read(response, media_type)
    check_schema(described["content"][media_type].get("schema", {}), answer)
    if operation_id == "watchJob":
        answer, expected = (events_of(text) for text in (answer, expected))
        for event in answer:
            check_schema({"$ref": "#/components/schemas/JobDocument"}, event)
    if status == "202":
        job_id = answer["id"]
    if operation_id not in OF_THE_DAY:
        check_alike(json.loads(json.dumps(answer).replace(job_id, JOB)), expected)


def check_headers(response: Any, described: Mapping[str, Any]) -> None:
    sent = {name for name in DOCUMENT["components"]["headers"] if name in response.headers}
    names = set(described["headers"])
    assert sent - {"Cache-Control"} <= names, "each is described"
    always = {"X-Request-ID", "ETag", "Location", "Preference-Applied", "Server-Timing"}
    always |= {"Content-Range", "Accept-Ranges", "Cache-Control"}
    assert names & always <= sent, "each is sent"


def read(response: Any, media_type: str) -> Any:
    if media_type.endswith(("/json", "+json")):
        return response.json()
    if media_type in ("application/x-npy", "application/octet-stream"):
        return response.content.decode("latin-1")
    return response.text


def check_schema(schema: Mapping[str, Any], answer: Any) -> None:
    root = {**schema, "components": DOCUMENT["components"]}
    faults = list(Draft202012Validator(root).iter_errors(answer))
    assert not faults, faults


def events_of(text: str) -> list[Any]:
    return [json.loads(line[5:]) for line in text.splitlines() if line.startswith("data:")]


def check_alike(answer: Any, expected: Any) -> None:
    """Check that two answers are the same, numbers within 1e-9."""
    if isinstance(expected, dict):
        assert set(answer) == set(expected)
        for name in set(expected) - CHANGING:
            check_alike(answer[name], expected[name])
    elif isinstance(expected, list):
        assert len(answer) == len(expected)
        for each, other in zip(answer, expected, strict=True):
            check_alike(each, other)
    elif isinstance(expected, str) and isinstance(answer, str):
        check_texts_alike(answer, expected)
    elif expected is None:
        assert answer is None
    else:
        assert answer == pytest.approx(expected, rel=1e-9, abs=1e-9)


def check_texts_alike(answer: str, expected: str) -> None:
    if "NUMPY" in answer:
        both = answer.encode("latin-1"), b64decode(expected)
        if both[0] == both[1]:  # or only a range, which cannot be read
            return
        found, known = (np.load(BytesIO(data)) for data in both)
        assert (found.dtype, found.shape) == (known.dtype, known.shape)
        np.testing.assert_allclose(found, known, rtol=1e-9)
        return
    number = r"-?\d+\.\d+(?:e[-+]\d+)?"
    assert re.sub(number, "#", answer) == re.sub(number, "#", expected)
    numbers, known = (
        np.array(re.findall(number, text), dtype=float) for text in (answer, expected)
    )
    np.testing.assert_allclose(numbers, known, rtol=1e-9, atol=1e-9)

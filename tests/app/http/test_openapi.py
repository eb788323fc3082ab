from collections.abc import Iterator
from typing import Any

from app.cli.openapi import openapi_text
from app.errors import PROBLEM_JSON
from tests.support.paths import ROOT

COMMITTED = ROOT / "openapi" / "openapi.json"


def test_committed_document_is_the_generated_one() -> None:
    assert COMMITTED.read_text() == openapi_text(), (
        "run: python -m app.cli.openapi > openapi/openapi.json"
    )


def responses_of(document: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the responses of all operations with their status, references resolved."""
    for path in document["paths"].values():
        for operation in path.values():
            for status, response in operation["responses"].items():
                yield status, resolved(response, document)


def resolved(response: Any, document: Any) -> dict[str, Any]:
    """Return a response, or the shared one that it refers to, with its own description."""
    name = response.get("$ref", "").rpartition("/")[2]
    return {**document["components"]["responses"].get(name, {}), **response}


def test_every_operation_is_described(client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    operations = [operation for path in paths.values() for operation in path.values()]

    assert len({operation["operationId"] for operation in operations}) == len(operations)
    for operation in operations:
        assert operation["summary"]
        assert operation["description"]


def test_errors_are_problems(client) -> None:
    for status, response in responses_of(client.get("/openapi.json").json()):
        if status >= "400":
            assert list(response["content"]) == [PROBLEM_JSON]


def test_whatever_can_fail_says_so(client) -> None:
    for path in client.get("/openapi.json").json()["paths"].values():
        for operation in path.values():
            assert "internal_error" in operation["responses"]["500"]["description"]


def test_headers_are_described(client) -> None:
    document = client.get("/openapi.json").json()
    paths = document["paths"]
    query = paths["/v1/meshes/{mesh_id}/distances"]["post"]
    sent = {parameter["name"].lower() for parameter in query["parameters"]}
    assert {"prefer", "idempotency-key", "x-timeout-ms", "range"} <= sent

    answers = {status: resolved(each, document) for status, each in query["responses"].items()}
    assert {"ETag", "Server-Timing", "Accept-Ranges"} <= set(answers["200"]["headers"])
    assert {"Location", "Preference-Applied"} <= set(answers["202"]["headers"])
    assert "Content-Range" in answers["206"]["headers"]
    assert "WWW-Authenticate" in answers["401"]["headers"]
    assert all("Retry-After" in answers[status]["headers"] for status in ("429", "503"))
    for path in paths.values():
        for operation in path.values():
            names = {each["name"] for each in operation.get("parameters", ())}
            assert ("304" in operation["responses"]) == ("If-None-Match" in names)
            assert ("206" in operation["responses"]) == ("Range" in names)
    for _, response in responses_of(document):
        assert "X-Request-ID" in response["headers"]


def test_no_error_of_the_framework_is_left(client) -> None:
    assert "HTTPValidationError" not in client.get("/openapi.json").text


def test_both_codes_of_a_status_are_named(client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    responses = paths["/v1/meshes/{mesh_id}/distances"]["post"]["responses"]

    assert responses["413"]["description"] == "upload_too_large, result_too_large"


def test_no_code_of_a_status_is_named_twice(client) -> None:
    for path in client.get("/openapi.json").json()["paths"].values():
        for operation in path.values():
            for status, response in operation["responses"].items():
                codes = response["description"].split(", ")
                assert status < "400" or len(set(codes)) == len(codes), codes

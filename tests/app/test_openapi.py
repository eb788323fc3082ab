from pathlib import Path

from app.errors import PROBLEM_JSON
from app.openapi import openapi_text

COMMITTED = Path(__file__).parents[2] / "openapi" / "openapi.json"


def test_committed_document_is_the_generated_one() -> None:
    assert COMMITTED.read_text() == openapi_text(), (
        "run: python -m app.openapi > openapi/openapi.json"
    )


def test_every_operation_is_described(client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    operations = [operation for path in paths.values() for operation in path.values()]

    assert len({operation["operationId"] for operation in operations}) == len(operations)
    for operation in operations:
        assert operation["summary"]
        assert operation["description"]


def test_errors_are_problems(client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    for path in paths.values():
        for operation in path.values():
            for status, response in operation["responses"].items():
                if status >= "400":
                    assert list(response["content"]) == [PROBLEM_JSON]


def test_no_error_of_the_framework_is_left(client) -> None:
    assert "HTTPValidationError" not in client.get("/openapi.json").text


def test_both_codes_of_a_status_are_named(client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    responses = paths["/v1/meshes/{mesh_id}/distances"]["post"]["responses"]

    assert responses["413"]["description"] == "upload_too_large, result_too_large"

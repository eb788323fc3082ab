"""The OpenAPI document: FastAPI's, completed with problems, headers and examples.

It is generated ahead of time by ``python -m app.cli.openapi``: that takes a quarter of a second.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from app.encoding import JSON
from app.errors import PROBLEM_JSON
from app.http.middleware.admission import is_open
from app.http.responses import documented, problems

_SOURCES = Path(__file__).parents[2] / "openapi"
_PACKAGED = Path(__file__).parents[1] / "openapi.json"
DOCUMENT = _PACKAGED if _PACKAGED.is_file() else _SOURCES / "openapi.json"
"""The document: inside the package where it is installed from a wheel."""
EXAMPLES = _SOURCES / "examples"
"""Folder of examples: a file for each operation id, with requests and answers by name."""

_FASTAPI_VALIDATION = "Validation Error"  # FastAPI adds it to each operation with parameters
_TEXT, _NUMBER = {"type": "string"}, {"type": "integer"}
_EVERYWHERE = (
    "malformed_request",
    "host_not_allowed",
    "rate_limited",
    "header_too_large",
    "internal_error",
    "too_many_connections",
    "deadline_exceeded",
)
"""Codes of the problems that any request can meet"""
SERVERS = [
    {"url": "/", "description": "The service that this document comes from"},
    {"url": "http://127.0.0.1:8000", "description": "`geodesic serve` on this machine"},
]
"""Addresses of the service"""
TAGS = [
    {
        "name": "queries",
        "description": "Distances, paths, log maps, straight lines, isolines, borders, matrices "
        "and nearest points on a stored mesh. Each query answers in JSON, or in other formats by "
        "`Accept` or `format`. With `Prefer: respond-async` it becomes a job. `geodesic docs http` "
        "opens the chapter.",
    },
    {
        "name": "meshes",
        "description": "Upload, list, describe and remove meshes. The id of a mesh is a hash of "
        "its content, so that no mesh is stored twice. `geodesic docs tour` opens the tutorial.",
    },
    {
        "name": "jobs",
        "description": "Queries that are answered in the background: their state and progress, "
        "their answers, and how to stop them. `geodesic docs http#jobs` opens the chapter.",
    },
    {
        "name": "service",
        "description": "The service itself: health, limits, metrics, and the meaning of errors. "
        "`geodesic docs operations` opens the chapter.",
    },
]
"""What the operations are grouped by"""
_JOB_EVENTS = {
    "type": "string",
    "title": "JobEvents",
    "description": "Server-sent events. The `id` of each counts the states of the job, and its "
    "`data` is a `JobDocument` in JSON. Comments between them keep the connection open.",
}
_SECURITY_SCHEME = {
    "type": "http",
    "scheme": "bearer",
    "description": "An API key, if the service requires one.",
}


def _header(meaning: str, schema: Mapping[str, Any] = _TEXT) -> dict[str, Any]:
    return {"description": meaning, "schema": schema}


_HEADERS = {
    "Accept-Ranges": _header("`bytes` where ranges of the answer can be requested, else `none`"),
    "Cache-Control": _header("Caching of the answer: where, and for how long"),
    "ETag": _header("Identifies the content of the answer, in its format and coding"),
    "Last-Modified": _header("When the file of the answer was written"),
    "Content-Range": _header("Range of these bytes, and the total"),
    "Geodesic-Dtype": _header("Type of the numbers in `npy`, `npz` and `octets`: `<f8` or `<f4`"),
    "Geodesic-Shape": _header("Shape of the array in these formats; `rows,columns` for a matrix"),
    "Location": _header("Where the mesh or the job is"),
    "Preference-Applied": _header("`respond-async`"),
    "Retry-After": _header("Seconds to wait before the next attempt", _NUMBER),
    "Server-Timing": _header(
        "Milliseconds of each phase, as `queue;dur=0.1, load;dur=0.0, compute;dur=3.2, "
        "encode;dur=0.3`; `kept` if the store had the answer"
    ),
    "Vary": _header("Headers of the request that the answer depends on"),
    "WWW-Authenticate": _header("`Bearer`, with the error if a key was sent"),
    "X-Request-ID": _header("The id of the request, from the client or newly made; the log has it"),
}
_PROBLEM_OF_STATUS = {
    "401": "Unauthorized",
    "409": "ProblemForNow",
    "429": "ProblemForNow",
    "503": "ProblemForNow",
}
"""The kind of problem that a status answers with, where it is not just a `Problem`"""


def _problem(description: str, *headers: str) -> dict[str, Any]:
    schema = {"$ref": "#/components/schemas/ProblemDocument"}
    return {
        "description": description,
        "headers": documented("X-Request-ID", *headers),
        "content": {PROBLEM_JSON: {"schema": schema}},
    }


_PROBLEMS = {
    "Problem": _problem("A problem"),
    "ProblemForNow": _problem("A problem that will pass", "Retry-After"),
    "Unauthorized": _problem("A key is missing or wrong", "WWW-Authenticate"),
}
_CONDITION = {
    "name": "If-None-Match",
    "in": "header",
    "required": False,
    "description": "The `ETag` of an answer that the client has; 304 if it has not changed",
    "schema": _TEXT,
}
_RANGE = {
    "name": "Range",
    "in": "header",
    "required": False,
    "description": "Bytes of the answer to send, RFC 9110; they come without a content coding",
    "schema": _TEXT,
}


def complete(document: dict[str, Any]) -> dict[str, Any]:
    """Return FastAPI's ``document``, completed."""
    for template, path in document["paths"].items():
        for method, operation in path.items():
            added = list(_EVERYWHERE)
            if not is_open(template):
                added.append("unauthorized")
            if method not in ("get", "head"):
                added.append("origin_not_allowed")
            operation["responses"] = dict(_responses(operation, added))
            if is_open(template):
                operation["security"] = []
            for parameter in operation.get("parameters", []):
                _leave_out_null(parameter["schema"])
            _put_json_first(operation["responses"].values())
            for status, parameter in (("206", _RANGE), ("304", _CONDITION)):
                if status in operation["responses"]:
                    operation.setdefault("parameters", []).append(dict(parameter))
            for name, example in _examples(operation["operationId"]).items():
                _add_example(operation, name, example)
    document["security"] = [{"apiKey": []}, {}]  # a key, or none where the service has none
    components = document["components"]
    for name in ("HTTPValidationError", "ValidationError", "BareVertex", "BareVertexSource"):
        components["schemas"].pop(name, None)
    components["schemas"]["JobEvents"] = _JOB_EVENTS
    for schema in components["schemas"].values():
        for member in schema.get("properties", {}).values():
            _describe_default(member)
    components["securitySchemes"] = {"apiKey": _SECURITY_SCHEME}
    components["headers"] = _HEADERS
    components["responses"] = _PROBLEMS
    return document


def _put_json_first(responses: Iterable[dict[str, Any]]) -> None:
    """Put JSON before other media types: generators of clients take the first."""
    for response in responses:
        content = response.get("content", {})
        if JSON in content:
            response["content"] = {JSON: content[JSON], **content}


def _describe_default(member: dict[str, Any]) -> None:
    """Turn the default of a member into words: generators make members with one required."""
    if "default" in member:
        default = json.dumps(member.pop("default")).strip('"')
        texts = [member.get("description"), f"Default: `{default}`"]
        member["description"] = ". ".join(filter(None, texts))


def _leave_out_null(schema: dict[str, Any]) -> None:
    """Leave `null` out of the schema of a parameter: in an address and in headers there is none."""
    if "anyOf" in schema:
        kinds = [kind for kind in schema.pop("anyOf") if kind != {"type": "null"}]
        schema.update(kinds[0] if len(kinds) == 1 else {"anyOf": kinds})


def _responses(
    operation: Mapping[str, Any], added: Sequence[str]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the answers of an operation by status, with problems as such.

    Parameters
    ----------
    operation
        The operation, with the problems that its route names.
    added
        Codes of further problems.
    """
    answers = {
        status: response
        for status, response in operation["responses"].items()
        if response["description"] != _FASTAPI_VALIDATION
    }
    for status, refusal in problems(*added).items():
        described = answers.get(str(status), {"description": ""})["description"]
        codes = [*described.split(", "), *refusal["description"].split(", ")]
        answers[str(status)] = {"description": ", ".join(dict.fromkeys(filter(None, codes)))}
    for status in sorted(answers):
        if status >= "400":
            kind = _PROBLEM_OF_STATUS.get(status, "Problem")
            codes = answers[status]["description"]
            yield status, {"$ref": f"#/components/responses/{kind}", "description": codes}
            continue
        headers = answers[status].get("headers", {}) | documented("X-Request-ID")
        response = {**answers[status], "headers": headers}
        for content in response.get("content", {}).values():
            if "itemSchema" in content:  # belongs to OpenAPI 3.2, and the document to 3.1
                content.clear()
                content["schema"] = {"$ref": "#/components/schemas/JobEvents"}
        yield status, response


def _examples(operation_id: str) -> dict[str, Any]:
    examples: dict[str, Any] = json.loads((EXAMPLES / f"{operation_id}.json").read_bytes())
    return examples


def _add_example(operation: dict[str, Any], name: str, example: Mapping[str, Any]) -> None:
    """Add an example to an operation: to its parameters, its body and its answer."""
    summary, answer = {"summary": example["summary"]}, example["response"]
    parameters = dict(example.get("parameters", {}))
    for parameter in operation.get("parameters", []):
        if parameter["name"] in parameters:
            shown = {**summary, "value": parameters.pop(parameter["name"])}
            parameter.setdefault("examples", {})[name] = shown
    if parameters:
        raise ValueError(f"{operation['operationId']} has no parameter {', '.join(parameters)}")
    status = str(answer["status"])
    response = operation["responses"][status]
    if "$ref" in response:  # the example is of this operation alone
        kind = response["$ref"].rpartition("/")[2]
        response = deepcopy(_PROBLEMS[kind]) | {"description": response["description"]}
        operation["responses"][status] = response
    bodies = [(operation.get("requestBody"), example.get("body")), (response, answer.get("body"))]
    for part, body in bodies:
        if part is not None and body is not None:
            shown = {**summary, "value": body["value"]}
            content = part["content"][body["media_type"]]
            content.setdefault("examples", {})[name] = shown

"""Problems and results as HTTP responses."""

import re
from collections.abc import Mapping
from datetime import datetime
from functools import partial
from typing import Any

import orjson
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.types import Receive, Scope, Send

from app.encoding import JSON
from app.errors import CODES, PROBLEM_JSON, Problem
from app.jobs import Job
from app.queries import Estimate
from app.schemas.service import ProblemDocument
from app.service.service import Answered
from app.store.results import Result, ResultStore

NEGOTIATED = {"Vary": "Accept, Accept-Encoding, Prefer"}
CACHED = {"Cache-Control": "private, max-age=3600"}
IMMUTABLE = {"Cache-Control": "private, max-age=31536000, immutable"}
UNSTORED = {"Cache-Control": "no-store"}
REVALIDATED = {"Cache-Control": "private, no-cache"}

OF_FILES = ("Accept-Ranges", "Cache-Control", "ETag", "Last-Modified")
"""The headers of answers that are files of the store."""
OF_WORK = (
    "invalid_request",
    "limit_exceeded",
    "memory_limit",
    "worker_died",
    "mesh_damaged",
    "queue_full",
    "engine_unavailable",
    "draining",
    "deadline_exceeded",
    "storage_full",
)
"""The problems that all can meet that a worker does."""
ENDS = ("mesh_not_found", "result_too_large", "invalid_point", *OF_WORK)
"""The problems that a query can meet when its body is right, at once or as a job."""


def problem_response(problem: Problem, instance: str, request_id: str) -> Response:
    """Return ``problem`` as ``application/problem+json``."""
    body = orjson.dumps(problem.document(instance, request_id))
    headers = {"Cache-Control": "no-store", **problem.headers}
    return Response(body, problem.status, headers, PROBLEM_JSON)


def problems(*codes: str) -> dict[int | str, dict[str, Any]]:
    """Describe the problems that an operation can answer with, for OpenAPI."""
    by_status: dict[int | str, list[str]] = {}
    for code in codes:
        by_status.setdefault(CODES[code].status, []).append(code)
    return {
        status: {"model": ProblemDocument, "description": ", ".join(names)}
        for status, names in by_status.items()
    }


def documented(*names: str) -> dict[str, Any]:
    """Describe the headers of an answer, for OpenAPI."""
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}


def server_timing(seconds: Mapping[str, float]) -> dict[str, str]:
    """Return the phases as a ``Server-Timing`` header, in milliseconds."""
    if not seconds:
        return {"Server-Timing": "kept"}
    return {"Server-Timing": ", ".join(f"{k};dur={1e3 * s:.1f}" for k, s in seconds.items())}


def etag_of(name: str) -> str:
    """Return the entity tag for content that its name defines."""
    return f'"{name}"'


def not_modified(request: Request, etag: str, headers: Mapping[str, str]) -> Response | None:
    """Return the 304 for a ``GET`` whose client has what ``etag`` stands for, else ``None``."""
    known = request.headers.get("if-none-match", "")
    tags = [tag.strip().removeprefix("W/") for tag in known.split(",")]
    if request.method == "GET" and (etag in tags or known.strip() == "*"):
        return Response(status_code=304, headers={"ETag": etag, **headers})
    return None


def estimate_response(
    mesh_id: str, estimate: Estimate, media_type: str, seconds: Mapping[str, float]
) -> Response:
    """Return an estimate: what it is of may cost another time tomorrow."""
    members = {"mesh_id": mesh_id, "is_estimate": True, **vars(estimate), "media_type": media_type}
    return Response(orjson.dumps(members), 200, {**UNSTORED, **server_timing(seconds)}, JSON)


def job_document(job: Job) -> dict[str, Any]:
    """Return a job as clients see it."""
    here = f"/v1/jobs/{job.id}"
    members = {
        "id": job.id,
        "kind": job.errand.kind,
        "mesh_id": job.errand.mesh_id,
        "status": job.status,
        "progress": job.progress,
        "created": _written(job.created),
        "started": _written(job.started),
        "finished": _written(job.finished),
        "links": {"self": here, "results": f"{here}/results", "events": f"{here}/events"},
    }
    if job.problem is not None:
        members["problem"] = job.problem.document(f"{here}/results", job.errand.request_id)
    return members


def accepted_response(job: Job) -> Response:
    """Return a job that a query has become."""
    document = job_document(job)
    location = {"Location": document["links"]["self"], "Preference-Applied": "respond-async"}
    return Response(orjson.dumps(document), 202, {**UNSTORED, **location}, JSON)


def _written(moment: datetime | None) -> str | None:
    return None if moment is None else moment.isoformat(timespec="milliseconds")


class StoredFileResponse(FileResponse):
    """A file of the store, or a range of it."""

    chunk_size = 2**18  # by Starlette's own 64 kB, 8 MB took twice as long

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file."""
        asked = Headers(scope=scope).get("range")
        if asked is not None and not _makes_sense(asked):
            # RFC 9110 has such a header ignored, where Starlette answers 400.
            kept = [(name, value) for name, value in scope["headers"] if name != b"range"]
            scope = {**scope, "headers": kept}
        await super().__call__(scope, receive, send)


def result_response(
    request: Request,
    answered: Answered,
    media_type: str,
    store: ResultStore,
    headers: Mapping[str, str],
) -> Response:
    """Return a result of the store: from memory where it is there; else its file, or a range."""
    result, written = answered.result, answered.result.written
    own = {"ETag": etag_of(result.key), **server_timing(answered.seconds)}
    headers = {"Accept-Ranges": "bytes", **written.seal.headers, **own, **headers}
    if written.body is None or "range" in request.headers:
        return _ResultFileResponse(result, media_type, store, headers)
    store.give_back(result)
    return Response(written.body, headers=headers, media_type=media_type)


class _ResultFileResponse(StoredFileResponse):
    """The file of a result, which stays there until it has been sent."""

    def __init__(
        self, result: Result, media_type: str, store: ResultStore, headers: Mapping[str, str]
    ) -> None:
        super().__init__(result.path, headers=headers, media_type=media_type)
        self._give_back = partial(store.give_back, result)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the result, and give it back to the store."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._give_back()


def _makes_sense(ranges: str) -> bool:
    unit, _, specs = ranges.partition("=")
    matches = [re.fullmatch(r"\s*(\d*)-(\d*)\s*", spec) for spec in specs.split(",")]
    return unit.strip().lower() == "bytes" and all(
        match and _is_forward(*match.groups()) for match in matches
    )


def _is_forward(first: str, last: str) -> bool:
    return int(first) <= int(last) if first and last else bool(first or last)

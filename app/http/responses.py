"""Responses: problems, results, estimates and jobs as HTTP has them."""

import os
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from datetime import datetime
from pathlib import Path
from stat import S_IFREG
from typing import Any
from weakref import finalize

import orjson
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.types import Receive, Scope, Send

from app.encoding import JSON
from app.errors import CODES, PROBLEM_JSON, Problem
from app.jobs import Job
from app.schemas.service import ProblemDocument
from app.service.mesh_storing import Manifest, PhaseSeconds
from app.store.meshes import public_arrays
from app.store.objects import RemoteBody, RemoteFile
from app.store.results import Result, ResultStore

NEGOTIATED = {"Vary": "Accept, Accept-Encoding, Prefer"}
CACHED = {"Cache-Control": "private, max-age=3600"}
IMMUTABLE = {"Cache-Control": "private, max-age=31536000, immutable"}
UNSTORED = {"Cache-Control": "no-store"}
REVALIDATED = {"Cache-Control": "private, no-cache"}

FILE_HEADERS = ("Accept-Ranges", "Cache-Control", "ETag", "Last-Modified")
"""Headers of answers that are files of the store"""
WORK_PROBLEMS = (
    "invalid_request",
    "limit_exceeded",
    "memory_limit",
    "worker_died",
    "mesh_damaged",
    "queue_full",
    "engine_unavailable",
    "draining",
    "state_unavailable",
    "store_unavailable",
    "deadline_exceeded",
    "storage_full",
)
"""Codes of the problems that any work can meet"""
QUERY_PROBLEMS = (
    "mesh_not_found",
    "result_too_large",
    "invalid_point",
    "not_embedded",
    *WORK_PROBLEMS,
)
"""Codes of the problems that a well-formed query can meet, at once or as a job"""


def common_headers(request_id: str) -> dict[str, str]:
    """Return the headers of every answer; browsers are not to guess its media type."""
    return {"X-Request-ID": request_id, "X-Content-Type-Options": "nosniff"}


def problem_response(problem: Problem, instance: str, request_id: str, prefix: str) -> Response:
    """Return ``problem`` as ``application/problem+json``."""
    body = orjson.dumps(problem.document(instance, request_id, prefix))
    headers = {"Cache-Control": "no-store", **problem.headers}
    return Response(body, problem.status, headers, PROBLEM_JSON)


def problems(*codes: str, **other_statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the problems that an operation can answer with, for OpenAPI.

    Parameters
    ----------
    codes
        Codes, with the first of their statuses.
    other_statuses
        Further statuses, by code.
    """
    by_status: dict[int | str, list[str]] = {}
    for code in codes:
        by_status.setdefault(CODES[code].status, []).append(code)
    for code, status in other_statuses.items():
        by_status.setdefault(status, []).append(code)
    return {
        status: {"model": ProblemDocument, "description": ", ".join(names)}
        for status, names in by_status.items()
    }


def documented(*names: str) -> dict[str, Any]:
    """Return the headers of an answer, for OpenAPI."""
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}


def server_timing(seconds: PhaseSeconds) -> dict[str, str]:
    """Return the phases as a ``Server-Timing`` header, in ms; ``kept`` for a stored answer."""
    if not seconds:
        return {"Server-Timing": "kept"}
    return {"Server-Timing": ", ".join(f"{k};dur={1e3 * s:.1f}" for k, s in seconds.items())}


def etag_of(name: str) -> str:
    """Return the entity tag for content that ``name`` identifies."""
    return f'"{name}"'


def not_modified(request: Request, etag: str, headers: Mapping[str, str]) -> Response | None:
    """Return a 304 for a ``GET`` whose client has the content of ``etag``, else None."""
    known = request.headers.get("if-none-match", "")
    tags = [tag.strip().removeprefix("W/") for tag in known.split(",")]
    if request.method == "GET" and (etag in tags or known.strip() == "*"):
        return Response(status_code=304, headers={"ETag": etag, **headers})
    return None


def listed_mesh(manifest: Manifest) -> dict[str, Any]:
    """Return the members of a mesh in a list."""
    report = manifest["report"]
    return {
        "id": manifest["id"],
        "name": manifest.get("name"),  # earlier releases stored none
        "vertices": report["vertices"],
        "faces": report["faces"],
        "created": manifest["created"],
    }


def mesh_document(manifest: Manifest, prefix: str) -> dict[str, Any]:
    """Return the document of a mesh: its report, and the links to its arrays."""
    mesh_id = manifest["id"]
    return {
        "id": mesh_id,
        "name": manifest.get("name"),  # earlier releases stored none
        **manifest["report"],
        "warnings": manifest["warnings"],
        "created": manifest["created"],
        "cut_from": manifest.get("cut_from"),
        "arrays": {
            name: f"{prefix}/v1/meshes/{mesh_id}/arrays/{name}" for name in public_arrays(manifest)
        },
    }


def job_document(job: Job, prefix: str) -> dict[str, Any]:
    """Return the document of a job."""
    here = f"{prefix}/v1/jobs/{job.id}"
    members = {
        "id": job.id,
        "kind": job.spec.kind,
        "mesh_id": job.spec.mesh_id,
        "status": job.status,
        "progress": job.progress,
        "created": _rfc3339(job.created),
        "started": _rfc3339(job.started),
        "finished": _rfc3339(job.finished),
        "links": {"self": here, "results": f"{here}/results", "events": f"{here}/events"},
    }
    if job.problem is not None:
        instance, request_id = f"{here}/results", job.spec.request_id
        members["problem"] = job.problem.document(instance, request_id, prefix)
    return members


def accepted_response(job: Job, prefix: str) -> Response:
    """Return the 202 for a query that has become a job."""
    document = job_document(job, prefix)
    location = {"Location": document["links"]["self"], "Preference-Applied": "respond-async"}
    return Response(orjson.dumps(document), 202, {**UNSTORED, **location}, JSON)


def _rfc3339(moment: datetime | None) -> str | None:
    return None if moment is None else moment.isoformat(timespec="milliseconds")


class StoredFileResponse(FileResponse):
    """A file of the store, or a range of it."""

    chunk_size = 2**18  # 8 MB take twice as long in Starlette's chunks of 64 kB

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file."""
        ranges = Headers(scope=scope).get("range")
        if ranges is not None:
            headers = [(name, value) for name, value in scope["headers"] if name != b"range"]
            # Beyond any file; Python reads no numbers of thousands of digits.
            ranges = re.sub("[0-9]{19,}", "9" * 18, ranges)
            # RFC 9110 says to ignore others, where Starlette answers 400. A part of a compressed
            # body cannot be decoded.
            if _is_valid(ranges) and "content-encoding" not in self.headers:
                headers.append((b"range", ranges.encode()))
            scope = {**scope, "headers": headers}
        await super().__call__(scope, receive, send)


def result_response(
    request: Request,
    result: Result,
    seconds: PhaseSeconds,
    media_type: str,
    store: ResultStore,
    headers: Mapping[str, str],
    status: int = 200,
) -> Response:
    """Return an acquired result, from memory or from its file, and release it once it is sent.

    Parameters
    ----------
    request
        The request; with a ``Range`` header, the result must have files.
    result
        The result, which ``store`` has handed out.
    seconds
        Seconds of each phase, for ``Server-Timing``.
    media_type
        Media type of the body.
    store
        The store to release the result to.
    headers
        Further headers, such as those of caching.
    status
        The status of the whole.
    """
    own = {"ETag": etag_of(result.key), **server_timing(seconds)}
    accepted = "none" if "Content-Encoding" in result.manifest.headers else "bytes"
    headers = {"Accept-Ranges": accepted, **result.manifest.headers, **own, **headers}
    if result.body is None or "range" in request.headers:
        return _ResultFileResponse(result, media_type, store, headers)
    store.release(result)
    return Response(result.body, status, headers, media_type)


class _ResultFileResponse(StoredFileResponse):
    """The body of a result, which the store protects until it has been sent."""

    _remote: RemoteFile | None = None

    def __init__(
        self, result: Result, media_type: str, store: ResultStore, headers: Mapping[str, str]
    ) -> None:
        body = store.body(result)
        self._body = None if isinstance(body, Path) else body
        path = body if isinstance(body, Path) else result.key
        status = None if self._body is None else _status_of(self._body)
        super().__init__(path, headers=headers, media_type=media_type, stat_result=status)
        # Once: when it has been sent, or when a cancelled request drops it unsent.
        self._release = finalize(self, store.release, result)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the result, and release it."""
        try:
            if self._body is not None:
                self._remote = await self._body.open()  # now a failure can still be answered
            await super().__call__(scope, receive, send)
        finally:
            if self._remote is not None:
                await self._remote.aclose()
            self._release()

    @asynccontextmanager
    async def _open_file(self) -> AsyncIterator[Any]:
        # Starlette opens the file by this method; all else of ranges is the same for both.
        if self._remote is not None:
            yield self._remote
        else:
            async with super()._open_file() as file:
                yield file


def _status_of(body: RemoteBody) -> os.stat_result:
    """Return the status that a file of this size would have."""
    return os.stat_result((S_IFREG, 0, 0, 1, 0, 0, body.size, 0, 0, 0))


def _is_valid(ranges: str) -> bool:
    unit, _, specs = ranges.partition("=")
    matches = [re.fullmatch(r"\s*([0-9]*)-([0-9]*)\s*", spec) for spec in specs.split(",")]
    return unit.strip().lower() == "bytes" and all(
        match and _is_forward(*match.groups()) for match in matches
    )


def _is_forward(first: str, last: str) -> bool:
    return int(first) <= int(last) if first and last else bool(first or last)

"""Routes of jobs: queries that are answered whether their client waits or not."""

import re
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent

from app.encoding import JSON
from app.errors import ProblemError, problem
from app.http.dependencies import ServiceDep, check_accepted
from app.http.prefix import prefix_of
from app.http.responses import (
    FILE_HEADERS,
    QUERY_PROBLEMS,
    REVALIDATED,
    UNSTORED,
    documented,
    etag_of,
    job_document,
    not_modified,
    problems,
    result_response,
)
from app.jobs import Job
from app.schemas.meshes import ListParameters
from app.schemas.service import JobDocument, JobList

_NUMBER = re.compile("[0-9]{1,18}")
"""A number that SQLite has room for"""

router = APIRouter(prefix="/jobs", tags=["jobs"])


async def get_job_of_path(job_id: str, service: ServiceDep) -> Job:
    """Return the job that the path names."""
    return await service.jobs.find(job_id)


JobDep = Annotated[Job, Depends(get_job_of_path)]


@router.get(
    "",
    operation_id="listJobs",
    summary="List the jobs",
    response_model=JobList,
    response_model_exclude_unset=True,
    responses={
        200: {"description": "The jobs", "headers": documented("Cache-Control")},
        **problems("invalid_request", "state_unavailable"),
    },
)
async def list_jobs(
    parameters: Annotated[ListParameters, Query()],
    request: Request,
    response: Response,
    service: ServiceDep,
) -> dict[str, Any]:
    """List jobs, the newest first, `limit` at a time."""
    response.headers.update(UNSTORED)
    before = _number(parameters.cursor)
    jobs, after = await service.jobs.page(parameters.limit, before)
    cursor = None if after is None else str(after)
    return {
        "jobs": [job_document(job, prefix_of(request.scope)) for job in jobs],
        "next_cursor": cursor,
    }


@router.get(
    "/{job_id}",
    operation_id="getJob",
    summary="State of a job",
    response_model=JobDocument,
    response_model_exclude_unset=True,
    responses={
        200: {"description": "The job", "headers": documented("Cache-Control")},
        **problems("job_not_found", "state_unavailable"),
    },
)
async def get_job(job: JobDep, request: Request, response: Response) -> dict[str, Any]:
    """Return the state of a job; the status is 200 in every state."""
    response.headers.update(UNSTORED)
    return job_document(job, prefix_of(request.scope))


@router.post(
    "/{job_id}/cancel",
    operation_id="cancelJob",
    summary="Stop a job",
    response_model=JobDocument,
    response_model_exclude_unset=True,
    responses=problems("job_not_found", "state_unavailable"),
)
async def cancel_job(job_id: str, request: Request, service: ServiceDep) -> dict[str, Any]:
    """Stop a job that waits or runs; its state becomes `dismissed`.

    A job that has finished stays as it is, with its answer.
    """
    cancelled = await service.jobs.cancel(job_id)
    return job_document(cancelled, prefix_of(request.scope))


@router.delete(
    "/{job_id}",
    operation_id="deleteJob",
    summary="Remove a job and its answer",
    response_model=JobDocument,
    response_model_exclude_unset=True,
    responses=problems("job_not_found", "state_unavailable"),
)
async def delete_job(job_id: str, request: Request, service: ServiceDep) -> dict[str, Any]:
    """Remove a job, and return its last state; one that waits or runs is stopped first."""
    removed = await service.jobs.remove(job_id)
    return job_document(removed, prefix_of(request.scope))


@router.get(
    "/{job_id}/results",
    operation_id="getJobResults",
    summary="Read the answer of a job",
    response_class=Response,
    responses={
        200: {
            "description": "The answer to the query",
            "content": {JSON: {"schema": {}}},
            "headers": documented("Server-Timing", *FILE_HEADERS),
        },
        206: {
            "description": "The requested range",
            "headers": documented("Server-Timing", "Content-Range", *FILE_HEADERS),
        },
        304: {"description": "The answer has not changed", "headers": documented("ETag")},
        **problems(
            "job_not_found",
            "job_not_finished",
            "job_dismissed",
            "not_acceptable",
            *QUERY_PROBLEMS,
            "range_not_satisfiable",
        ),
    },
)
async def get_job_results(job_id: str, request: Request, service: ServiceDep) -> Response:
    """Return the answer in the format and coding of the query, or the problem that the query met.

    A request whose `Accept` or `Accept-Encoding` excludes them gets 406.
    """
    job, result = await service.jobs.result(job_id)
    media_type = job.spec.media_type
    try:
        check_accepted(request, media_type, result.manifest.headers.get("Content-Encoding"))
    except ProblemError:
        service.results.release(result)
        raise
    unchanged = not_modified(request, etag_of(result.key), REVALIDATED)
    if unchanged is not None:
        service.results.release(result)
        return unchanged
    return result_response(request, result, {}, media_type, service.results, REVALIDATED)


@router.get(
    "/{job_id}/events",
    operation_id="watchJob",
    summary="Watch a job",
    response_class=EventSourceResponse,
    responses={
        200: {"description": "Events; the data of each event is a `JobDocument`"},
        **problems("job_not_found", "invalid_request", "state_unavailable"),
    },
)
async def watch_job(
    job: JobDep,
    request: Request,
    service: ServiceDep,
    last_event_id: Annotated[
        str | None,
        Header(max_length=18, description="The id of the last event that the client saw"),
    ] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Send the job, as `GET` returns it, whenever it changes, until it has finished.

    The id of an event counts the states of the job. A client that reconnects with the last id it
    saw gets only later states. A comment is sent every 15 s.
    """
    async for state in service.jobs.watch(job, _version(last_event_id)):
        yield ServerSentEvent(
            data=job_document(state, prefix_of(request.scope)), id=str(state.version)
        )


def _version(event_id: str | None) -> int:
    # Any other text means that nothing was seen, as the specification says.
    return int(event_id) if event_id is not None and _NUMBER.fullmatch(event_id) else 0


def _number(cursor: str | None) -> int | None:
    if not cursor:
        return None
    if not _NUMBER.fullmatch(cursor):
        detail = f"{cursor[:20]!r} is not a next_cursor of a list of jobs"
        raise problem("invalid_request", detail)
    return int(cursor)

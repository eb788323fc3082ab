"""Requests for queries: the body and what comes with it, read from HTTP, and the response."""

from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from typing import Annotated, Any

from fastapi import Depends, Header, Request, Response
from pydantic import Field
from pydantic_core import from_json

from app.errors import over_limit, problem
from app.http.dependencies import (
    TimeoutHeader,
    context_of,
    job_after,
    negotiated,
    note_work,
    refuse_idempotency_key,
    service_of,
    while_connected,
)
from app.http.large_bodies import LARGE, large_bodies_of
from app.http.prefix import prefix_of
from app.http.responses import (
    CACHED,
    NEGOTIATED,
    UNSTORED,
    accepted_response,
    etag_of,
    not_modified,
    result_response,
)
from app.jobs import Job
from app.queries import Query, result_key
from app.schemas.requests import AnswerParameters
from app.service.answering import Answered
from app.settings import Settings

_LEAST_BYTES_OF_VALUE = 7
"""Bytes a value for a body that is full: indices of six digits. To parse denser ones takes long."""


def parse_json(body: bytes, settings: Settings) -> Any:
    """Return the value of a JSON body, or refuse the body.

    The parser stops everything else, so that values are counted before, by their commas.
    """
    most = max(settings.max_query_bytes // _LEAST_BYTES_OF_VALUE, LARGE)
    values = body.count(b",") + 1
    if values > most:
        raise over_limit("limit_exceeded", "values in the body", values, most, "max_query_bytes")
    try:
        return from_json(body)
    except ValueError as error:
        code = "invalid_request" if "number out of range" in str(error) else "malformed_body"
        raise problem(code, f"the body cannot be read as JSON: {error}") from None


class QueryHeaders(TimeoutHeader):
    """The headers of a request for a query."""

    prefer: str | None = Field(
        default=None,
        description=(
            "`respond-async`: answer with a job at once (RFC 7240); `respond-async, wait=2`: only "
            "if the answer is not ready after two seconds"
        ),
    )
    idempotency_key: str | None = Field(
        default=None,
        alias="idempotency-key",
        min_length=1,
        max_length=255,
        description="Freely chosen key of a job: a request that is sent again with the same key "
        "gets the same job. With `Prefer: respond-async` only",
    )


AnswerQuery = Callable[[type[Query[Any]], Any, AnswerParameters], Awaitable[Response]]
"""Answers the query of a kind in a body, with these parameters"""


async def get_answer(
    mesh_id: str, request: Request, headers: Annotated[QueryHeaders, Header()]
) -> AnswerQuery:
    """Return what answers the query of a request, as a dependency."""
    return partial(_answer, mesh_id, request, headers)


AnswerDep = Annotated[AnswerQuery, Depends(get_answer)]


async def _answer(
    mesh_id: str,
    request: Request,
    preferences: QueryHeaders,
    kind: type[Query[Any]],
    body: Any,
    parameters: AnswerParameters,
) -> Response:
    """Validate the query in ``body``, and respond with its answer or a job."""
    service, context = service_of(request), context_of(request, preferences)
    wait_s, key = job_after(preferences.prefer), preferences.idempotency_key
    if wait_s is None:
        refuse_idempotency_key(request)
    size = await service.size(mesh_id)

    def make_query() -> Query[Any]:
        query = kind.ask(mesh_id, size, body, service.settings)
        query = query.answered_as(negotiated(request, parameters, query.offers))
        query.written  # noqa: B018 - computes and caches it
        return query

    query = await large_bodies_of(request).check(request, context.deadline_s, make_query)
    if wait_s == 0:
        job = await service.query_jobs.submit(query, context, key)
        return accepted_response(job, prefix_of(request.scope))
    is_cacheable = request.method == "GET"
    headers = {**NEGOTIATED, **(CACHED if is_cacheable else UNSTORED)}
    if is_cacheable:
        unchanged = not_modified(request, etag_of(result_key(query)), headers)
        if unchanged is not None:
            return unchanged
    as_file = "range" in request.headers
    answering: Coroutine[Any, Any, Answered | Job]
    if wait_s is None:
        answering = service.answering.answer(query, context, as_file=as_file)
    else:
        answering = service.query_jobs.answer_or_submit(
            query, context, wait_s, key, as_file=as_file
        )
    answer = await while_connected(request, answering)
    if isinstance(answer, Job):
        return accepted_response(answer, prefix_of(request.scope))
    result, seconds = answer
    note_work(request, mesh_id, seconds)
    media_type = query.representation.media_type
    return result_response(request, result, seconds, media_type, service.results, headers)

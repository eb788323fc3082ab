"""Query requests: the body and what comes with it, read from HTTP, and the way to a response."""

from collections.abc import Coroutine
from dataclasses import dataclass
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
from app.service.question import Question
from app.service.request_context import RequestContext
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


@dataclass(frozen=True)
class QueryRequest:
    """A request for a query: the mesh, the caller and the preferences, all but the query itself."""

    mesh_id: str
    request: Request
    context: RequestContext
    job_after_s: int | None
    """Seconds of waiting from which the client prefers a job; None: never"""
    idempotency_key: str | None

    async def answer(
        self, kind: type[Query[Any]], body: Any, parameters: AnswerParameters
    ) -> Response:
        """Validate the query in ``body``, and respond with its answer or a job."""
        request, context = self.request, self.context
        service = service_of(request)
        size = await service.size(self.mesh_id)

        def make_query() -> Query[Any]:
            query = kind.ask(self.mesh_id, size, body, service.settings)
            query.written  # noqa: B018 - computes and caches it
            return query

        query = await large_bodies_of(request).check(request, context.deadline_s, make_query)
        representation = negotiated(request, parameters, query.offers)
        media_type = representation.media_type
        question = Question(query, size, representation, context.caller.name)
        wait_s, key = self.job_after_s, self.idempotency_key
        if wait_s == 0:
            job = await service.query_jobs.submit(question, context, key)
            return accepted_response(job, prefix_of(request.scope))
        is_cacheable = request.method == "GET"
        headers = {**NEGOTIATED, **(CACHED if is_cacheable else UNSTORED)}
        if is_cacheable:
            etag = etag_of(result_key(query, representation))
            unchanged = not_modified(request, etag, headers)
            if unchanged is not None:
                return unchanged
        as_file = "range" in request.headers
        answering: Coroutine[Any, Any, Answered | Job]
        if wait_s is None:
            answering = service.answering.answer(question, context.deadline_s, as_file=as_file)
        else:
            answering = service.query_jobs.answer_or_submit(
                question, context, wait_s, key, as_file=as_file
            )
        answer = await while_connected(request, answering)
        if isinstance(answer, Job):
            return accepted_response(answer, prefix_of(request.scope))
        result, seconds = answer
        note_work(request, self.mesh_id, seconds)
        return result_response(request, result, seconds, media_type, service.results, headers)


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


async def get_query_request(
    mesh_id: str, request: Request, headers: Annotated[QueryHeaders, Header()]
) -> QueryRequest:
    """Return the request for a query, as a dependency."""
    context, job_after_s = context_of(request, headers), job_after(headers.prefer)
    if job_after_s is None:
        refuse_idempotency_key(request)
    return QueryRequest(mesh_id, request, context, job_after_s, headers.idempotency_key)


QueryRequestDep = Annotated[QueryRequest, Depends(get_query_request)]

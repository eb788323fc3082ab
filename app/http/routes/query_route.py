"""The route of a query: one model reads headers, query string and body, and an answer is sent.

FastAPI documents these routes. By itself it would work out the kinds of their parameters anew for
each request, which took a fifth of the time of a small one.
"""

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Annotated, Any, get_origin, get_type_hints

from fastapi import Header, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field, ValidationError, create_model
from pydantic_core import from_json

from app.errors import over_limit, problem
from app.http.dependencies import (
    TimeoutHeader,
    context_of,
    job_after,
    negotiated,
    note_work,
    refuse_idempotency_key,
    require_json,
    service_of,
    while_connected,
)
from app.http.large_bodies import LARGE, large_bodies_of
from app.http.prefix import prefix_of
from app.http.query_form import REQUEST, as_json, numbers_in, parts_of
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
from app.queries import Query, check_lengths, result_key
from app.schemas.requests import AnswerParameters, QueryBody
from app.service.answering import Answered
from app.settings import Settings

_PARTS = "header", "query", "body"
"""Parameters of a handler, each a model; problems name them as the beginning of a place"""
FORM = "multipart/form-data"
_LEAST_BYTES_OF_VALUE = 7
"""Bytes a value for a body that is full: indices of six digits. To parse denser ones takes long."""


class _QueryHeaders(TimeoutHeader):
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


QueryHeaders = Annotated[_QueryHeaders, Header()]


class QueryRoute(APIRoute):
    """A route whose handler takes a mesh id, the request, and the models of what the request has.

    These are ``header``, ``query`` and, unless it is a ``GET``, ``body``.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the function that reads a request and calls the handler."""
        kinds = get_type_hints(self.endpoint)
        parts: dict[str, Any] = {name: (kinds[name], ...) for name in _PARTS if name in kinds}
        model = create_model("Request", **parts)
        lists = _lists_of(kinds["query"])

        async def respond(request: Request) -> Response:
            settings, body = service_of(request).settings, b""
            head = {"header": _headers(request), "query": _parameters(request, lists)}
            if "body" not in parts:
                whole = read(model, head, body, settings)
            else:
                form = _form_type(request, kinds["body"])
                if form is None:
                    require_json(request)
                large, deadline_s = large_bodies_of(request), settings.deadline_s
                async with large.reading(request, deadline_s):
                    reading = partial(read, model, head, await request.body(), settings, form)
                    whole = await large.check(request, deadline_s, reading)
            mesh_id = request.path_params["mesh_id"]
            response: Response = await self.endpoint(mesh_id, request, **vars(whole))
            return response

        return respond


async def answer(
    kind: type[Query[Any]],
    mesh_id: str,
    request: Request,
    preferences: _QueryHeaders,
    parameters: AnswerParameters,
    body: Any,
) -> Response:
    """Check the query of a kind in a body, and respond with its answer or a job."""
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
    answered = await while_connected(request, answering)
    if isinstance(answered, Job):
        return accepted_response(answered, prefix_of(request.scope))
    result, seconds, mesh = answered
    note_work(request, mesh_id, seconds)
    status = 200
    if mesh is not None:
        headers["Location"] = f"{prefix_of(request.scope)}/v1/meshes/{mesh.mesh_id}"
        status = 201 if mesh.is_new else 200
    media_type = query.representation.media_type
    return result_response(request, result, seconds, media_type, service.results, headers, status)


def _form_type(request: Request, kind: type[QueryBody]) -> str | None:
    """Return the Content-Type of a form, where a query may be one: because it may have arrays."""
    content_type = request.headers.get("content-type", "")
    is_form = content_type.partition(";")[0].strip().lower() == FORM
    return content_type if is_form and kind.arrays else None


def read(
    model: type[BaseModel],
    head: dict[str, Any],
    body: bytes,
    settings: Settings,
    form: str | None = None,
) -> Any:
    """Return the model of a request, from the values of its head and its body.

    That is JSON, or a form of this Content-Type.

    Raises
    ------
    ProblemError
        The body cannot be read, or has too many values, or too long a list.
    RequestValidationError
        A value does not fit the model.
    """
    if body:
        kind: Any = model.model_fields["body"].annotation
        given = parse_json(body, settings) if form is None else _in_form(form, body, kind, settings)
        head = {**head, "body": given}
        check_lengths(head["body"], kind, settings)
    try:
        return model.model_validate(head)
    except ValidationError as error:
        raise RequestValidationError(error.errors(include_url=False)) from None


def _in_form(content_type: str, body: bytes, kind: type[QueryBody], settings: Settings) -> Any:
    """Return the value of a body that is a form."""
    parts = parts_of(content_type, body, kind.arrays)
    given = parse_json(parts.pop(REQUEST), settings)
    for name, part in parts.items():
        if not isinstance(given, dict) or name in given:
            raise problem("malformed_body", f"the request must be an object without {name}")
        numbers = numbers_in(name, part)
        _refuse_values(len(numbers), settings)
        given[name] = as_json(numbers)
    return given


def parse_json(body: bytes, settings: Settings) -> Any:
    """Return the value of a JSON body, or refuse the body.

    The parser stops everything else, so that values are counted before, by their commas.
    """
    _refuse_values(body.count(b",") + 1, settings)
    try:
        return from_json(body)
    except ValueError as error:
        code = "invalid_request" if "number out of range" in str(error) else "malformed_body"
        raise problem(code, f"the body cannot be read as JSON: {error}") from None


def _refuse_values(values: int, settings: Settings) -> None:
    most = max(settings.max_query_bytes // _LEAST_BYTES_OF_VALUE, LARGE)
    if values > most:
        raise over_limit("limit_exceeded", "values in the body", values, most, "max_query_bytes")


def _headers(request: Request) -> dict[str, str]:
    """Return the headers; repeated ones are joined by commas (RFC 9110)."""
    values: dict[str, str] = {}
    for name, value in request.headers.items():
        values[name] = f"{values[name]}, {value}" if name in values else value
    return values


def _parameters(request: Request, lists: frozenset[str]) -> dict[str, str | list[str]]:
    """Return the query parameters; of repeated ones the last, but all values of ``lists``."""
    if not request.scope["query_string"]:
        return {}
    query = request.query_params
    return {name: query.getlist(name) if name in lists else query[name] for name in query}


def _lists_of(model: type[BaseModel]) -> frozenset[str]:
    fields = model.model_fields.items()
    return frozenset(name for name, field in fields if get_origin(field.annotation) is list)

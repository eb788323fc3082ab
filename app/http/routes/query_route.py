"""The route class of queries: FastAPI documents them, and one pydantic model reads a request.

FastAPI works out the kinds of parameters anew for each request, which took a fifth of the time of a
small one. So each route has one model for headers, parameters and body, made once.
"""

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, get_origin

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError, create_model

from app.http.dependencies import require_json, service_of
from app.http.large_bodies import large_bodies_of
from app.http.routes.query_request import (
    QueryHeaders,
    get_answer,
    parse_json,
)
from app.queries import check_lengths
from app.settings import Settings


class QueryRoute(APIRoute):
    """A route whose handler takes ``answer``, ``parameters`` and, unless ``GET``, ``body``.

    The latter two are models.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the function that reads a request and calls the handler."""
        takes_body = self.body_field is not None
        parameters: Any = self.dependant.query_params[0].field_info.annotation
        parts: dict[str, Any] = {"header": (QueryHeaders, ...), "query": (parameters, ...)}
        if self.body_field is not None:
            parts["body"] = (self.body_field.field_info.annotation, ...)
        model = create_model("Request", **parts)
        lists = _lists_of(parameters)

        async def answer(request: Request) -> Response:
            if takes_body:
                require_json(request)
            head = {"header": _headers(request), "query": _parameters(request, lists)}
            settings = service_of(request).settings
            if takes_body:
                large, deadline_s = large_bodies_of(request), settings.deadline_s
                async with large.reading(request, deadline_s):
                    reading = partial(read, model, head, await request.body(), settings)
                    whole = await large.check(request, deadline_s, reading)
            else:
                whole = read(model, head, b"", settings)
            mesh_id = request.path_params["mesh_id"]
            response: Response = await self.endpoint(
                answer=await get_answer(mesh_id, request, whole.header),
                parameters=whole.query,
                **({"body": whole.body} if takes_body else {}),
            )
            return response

        return answer


def read(model: type[BaseModel], head: dict[str, Any], body: bytes, settings: Settings) -> Any:
    """Return the model of a request, from the values of its head and its JSON body.

    Raises
    ------
    ProblemError
        The body is not JSON, or has too many values, or too long a list.
    RequestValidationError
        A value does not fit the model.
    """
    if body:
        head = {**head, "body": parse_json(body, settings)}
        kind: Any = model.model_fields["body"].annotation
        check_lengths(head["body"], kind, settings)
    try:
        return model.model_validate(head)
    except ValidationError as error:
        raise RequestValidationError(error.errors(include_url=False)) from None


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

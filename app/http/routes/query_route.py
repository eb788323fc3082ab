"""The routes of queries: FastAPI describes them, and pydantic reads what they are asked.

FastAPI finds out anew for each request what kinds its parameters are, which took a fifth of all
that a small one costs the service. So all that a query is asked is one model, made once.
"""

from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, get_origin

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError, create_model

from app.http.dependencies import require_json
from app.http.routes.query_request import (
    AskingHeaders,
    get_asked,
    offload_if_large,
    parse_json,
)


class QueryRoute(APIRoute):
    """A route whose handler takes ``asked``, ``parameters`` and, but for a ``GET``, a ``body``.

    The latter two are models.
    """

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what reads a request, and has the handler answer it."""
        takes_body = self.body_field is not None
        parameters: Any = self.dependant.query_params[0].field_info.annotation
        parts: dict[str, Any] = {"header": (AskingHeaders, ...), "query": (parameters, ...)}
        if self.body_field is not None:
            parts["body"] = (self.body_field.field_info.annotation, ...)
        model = create_model("Request", **parts)
        lists = _lists_of(parameters)

        async def answer(request: Request) -> Response:
            if takes_body:
                require_json(request)
            written = {"header": _headers(request), "query": _parameters(request, lists)}
            body = await request.body() if takes_body else b""
            whole = await offload_if_large(request, partial(read, model, written, body))
            asked = await get_asked(request.path_params["mesh_id"], request, whole.header)
            given = {"body": whole.body} if takes_body else {}
            response: Response = await self.endpoint(asked=asked, parameters=whole.query, **given)
            return response

        return answer


def read(model: type[BaseModel], written: dict[str, Any], body: bytes) -> Any:
    """Return the model of what is ``written`` in a request and of its ``body``, which is JSON.

    Raises
    ------
    ProblemError
        The body is not JSON.
    RequestValidationError
        Something is not as the model has it.
    """
    if body:
        written = {**written, "body": parse_json(body)}
    try:
        return model.model_validate(written)
    except ValidationError as error:
        raise RequestValidationError(error.errors(include_url=False)) from None


def _headers(request: Request) -> dict[str, str]:
    """Return the headers; one that is given again is the same as a list with commas (RFC 9110)."""
    values: dict[str, str] = {}
    for name, value in request.headers.items():
        values[name] = f"{values[name]}, {value}" if name in values else value
    return values


def _parameters(request: Request, lists: frozenset[str]) -> dict[str, str | list[str]]:
    """Return the query string's parameters; of one that is given again the last, or ``lists``."""
    given = request.query_params
    return {name: given.getlist(name) if name in lists else given[name] for name in given}


def _lists_of(model: type[BaseModel]) -> frozenset[str]:
    fields = model.model_fields.items()
    return frozenset(name for name, field in fields if get_origin(field.annotation) is list)

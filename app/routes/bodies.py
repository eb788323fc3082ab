"""Bodies of queries: large ones are read and checked in a thread, while the event loop goes on.

FastAPI validates on the event loop, where 40 000 points take a tenth of a second. So its request is
given one whose JSON is validated already: a model, which it takes as it is.
"""

import json
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from anyio import to_thread
from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError

from app.dependencies import require_json

LARGE = 2**16
"""Bytes of a body from which on it is worth a thread: they take some milliseconds."""

T = TypeVar("T")


class QueryRoute(APIRoute):
    """A route whose body, if it has one, is a model in JSON."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return FastAPI's handler, given the body as a model."""
        handle = super().get_route_handler()
        if self.body_field is None:
            return handle
        model = self.body_field.field_info.annotation
        assert isinstance(model, type), "the body of a query is a model"  # noqa: S101
        assert issubclass(model, BaseModel), "the body of a query is a model"  # noqa: S101

        async def handle_query(request: Request) -> Response:
            require_json(request)
            return await handle(_QueryRequest(request, model))

        return handle_query


async def beside_the_loop(request: Request, do: Callable[[], T]) -> T:
    """Do what takes the longer, the larger the body is: in a thread, where it is large.

    One at a time: several would take the interpreter from each other, and from the event loop.
    """
    if len(await request.body()) < LARGE:
        return do()
    return await to_thread.run_sync(do, limiter=request.app.state.large_bodies)


class _QueryRequest(Request):
    def __init__(self, request: Request, model: type[BaseModel]) -> None:
        super().__init__(request.scope, request.receive)
        self._model = model

    async def json(self) -> Any:
        """Return the body as a model."""
        body = await self.body()
        return await beside_the_loop(self, lambda: validated(self._model, body))


def validated(model: type[BaseModel], body: bytes) -> BaseModel:
    """Return the model that a body is.

    Raises
    ------
    JSONDecodeError, RequestValidationError
        It is not JSON, or not the model's.
    """
    try:
        return model.model_validate(json.loads(body))
    except ValidationError as error:
        errors = error.errors(include_url=False)
        raise RequestValidationError(
            [{**each, "loc": ("body", *each["loc"])} for each in errors]
        ) from None

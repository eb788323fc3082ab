"""Exception handlers for FastAPI: each answers with a problem."""

from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.routing import compile_path

from app.errors import EXCEPTIONS, Fault, Problem, ProblemError, pointer, problem_of_status
from app.http.failures import CLIENT_CLOSED, note_failure
from app.http.middleware.request_id import body_too_large
from app.http.prefix import path_in, prefix_of
from app.http.responses import problem_response
from app.schemas.points import TAGS
from app.settings import Settings


def install(app: FastAPI, settings: Settings) -> None:
    """Give ``app`` its exception handlers."""

    async def on_problem(request: Request, error: ProblemError) -> Response:
        return _respond(request, error.problem)

    async def on_failure(request: Request, error: Exception) -> Response:
        return _respond(request, note_failure(error))

    async def on_validation(request: Request, error: RequestValidationError) -> Response:
        return _respond(request, validation_problem(error.errors()))

    async def on_framework(request: Request, error: HTTPException) -> Response:
        if error.status_code == 413:
            return _respond(request, body_too_large(request.scope, settings))
        detail = f"{request.method} {request.url.path}: {error.detail}"
        headers = error.headers
        if error.status_code == 405:
            headers = _allow(app, path_in(request.scope)) or headers
        return _respond(request, problem_of_status(error.status_code, detail, headers))

    async def on_disconnect(_request: Request, _error: ClientDisconnect) -> Response:
        return Response(status_code=CLIENT_CLOSED)

    handlers: dict[Any, Any] = {
        **dict.fromkeys((kind for kind, _ in EXCEPTIONS if kind is not BaseException), on_failure),
        ProblemError: on_problem,
        RequestValidationError: on_validation,
        HTTPException: on_framework,
        ClientDisconnect: on_disconnect,
    }
    app.exception_handlers.update(handlers)


def _allow(app: FastAPI, path: str) -> Mapping[str, str] | None:
    # Starlette names only the methods of the first route with this path.
    for template, operations in app.openapi()["paths"].items():
        if compile_path(template)[0].match(path):
            methods = {method.upper() for method in operations}
            if "GET" in methods:
                methods.add("HEAD")
            return {"Allow": ", ".join(sorted(methods))}
    return None


def validation_problem(errors: Sequence[Any]) -> Problem:
    """Return the problem for pydantic's ``errors``."""
    # A default that is another member's value is at fault where that one is.
    errors = [error for error in errors if error["type"] != "default_factory_not_called"]
    faults = tuple(Fault(_pointer(error["loc"]), _message(error)) for error in errors[:10])
    place = faults[0].pointer or "the body"
    return Problem("invalid_request", f"{place}: {faults[0].message}", errors=faults)


def _message(error: Mapping[str, Any]) -> str:
    if error["type"] == "extra_forbidden" and error["loc"][-1] == "start_distance":
        return "Only sources of distances, isolines and borders have a start_distance"
    message: str = error["msg"]
    return message


def _pointer(location: Sequence[str | int]) -> str:
    named = [part for part in location if part not in TAGS]
    return pointer(*(named[1:] if named[0] == "body" else named))


def _respond(request: Request, problem: Problem) -> Response:
    path, prefix = request.url.path, prefix_of(request.scope)
    return problem_response(problem, path, request.state.request_id, prefix)

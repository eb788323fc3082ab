"""Request ids, and the guarantee that each error is answered with a problem."""

import asyncio
import re
from uuid import uuid4

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from structlog.contextvars import bound_contextvars

from app.errors import PROBLEM_JSON, Problem, draining, problem_of_status
from app.http.failures import CLIENT_CLOSED, note_failure
from app.http.prefix import path_in, prefix_of
from app.http.responses import common_headers, problem_response
from app.settings import Settings
from app.tracing import trace_fields

_UPLOADS = "/v1/meshes"
_SANE_ID = re.compile(r"[\w.:-]{1,128}")


class RequestIdMiddleware:
    """Middleware that gives each request an id, and turns remaining errors into problems."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = _request_id(scope)
        scope.setdefault("state", {})["request_id"] = request_id
        own_headers = common_headers(request_id)
        has_started = is_replaced = False

        async def answer(problem: Problem) -> None:
            response = problem_response(problem, scope["path"], request_id, prefix_of(scope))
            response.headers.update(own_headers)
            await response(scope, receive, send)

        async def send_checked(message: Message) -> None:
            nonlocal has_started, is_replaced
            if message["type"] == "http.response.start":
                has_started = True
                headers = MutableHeaders(scope=message)
                headers.update(own_headers)
                if _is_plain_error(message["status"], headers):
                    is_replaced = True
                    await answer(self._framework_problem(message["status"], headers, scope))
            if not is_replaced:
                await send(message)

        with bound_contextvars(request_id=request_id, **trace_fields()):
            try:
                await self.app(scope, receive, send_checked)
            except asyncio.CancelledError:
                task = asyncio.current_task()
                if has_started or task is None or not task.cancelling():
                    raise
                # The server cancelled this request: the service stops, and has waited long enough.
                await answer(draining().problem)
            except Exception as error:
                problem = note_failure(error)
                if has_started:
                    raise  # too late for a problem: the server cuts the connection
                await answer(problem)

    def _framework_problem(self, status: int, headers: Headers, scope: Scope) -> Problem:
        """Return the problem for a plain-text error of Starlette: a body or range too large."""
        if status == 413:
            return body_too_large(scope, self.settings)
        retained = {"Content-Range": headers["content-range"]} if "content-range" in headers else {}
        return problem_of_status(status, "", retained)


def _is_plain_error(status: int, headers: Headers) -> bool:
    """Tell whether an error is the framework's plain text, not a problem."""
    is_problem = headers.get("content-type") == PROBLEM_JSON
    return status >= 400 and status != CLIENT_CLOSED and not is_problem


def body_too_large(scope: Scope, settings: Settings) -> Problem:
    """Return the problem for a body above the limit of its route."""
    setting = "max_upload_bytes" if path_in(scope) == _UPLOADS else "max_query_bytes"
    limit = getattr(settings, setting)
    declared = Headers(scope=scope).get("content-length", "")
    return Problem(
        "upload_too_large",
        f"the body is larger than {limit} bytes",
        limit=limit,
        actual=int(declared) if declared.isdigit() else None,
        setting=setting,
    )


def _request_id(scope: Scope) -> str:
    given = Headers(scope=scope).get("x-request-id", "")
    return given if _SANE_ID.fullmatch(given) else uuid4().hex

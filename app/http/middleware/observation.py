"""Observation of requests: each is counted and timed, and has one line in the log."""

from collections.abc import Mapping
from time import perf_counter

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.access import Caller, caller_at
from app.http.metrics import Metrics
from app.http.middleware.probes import PROBES
from app.http.prefix import path_in
from app.settings import Settings
from app.tracing import trace_fields

logger = structlog.get_logger(module="app.http")

_NONE = "none"
"""Operation of a request that reached none"""


class ObservationMiddleware:
    """Middleware that measures each request, and reports it when it has been answered.

    It reads what the application leaves in the scope: the route, the caller, and in
    ``request.state`` what routes know of the work, see `note_work`.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics, settings: Settings) -> None:
        self.app = app
        self.metrics = metrics
        self.logs_probes = settings.log_probes == "on"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start = perf_counter()
        status, size = 500, 0

        async def send_noted(message: Message) -> None:
            nonlocal status, size
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)
            size += len(message.get("body", b""))

        try:
            await self.app(scope, receive, send_noted)
        finally:
            self._report(scope, status, size, perf_counter() - start)

    def _report(self, scope: Scope, status: int, size: int, seconds: float) -> None:
        route, state = scope.get("route"), scope.get("state", {})
        operation = getattr(route, "operation_id", None) or _NONE
        caller = state.get("caller") or _client(scope)
        self.metrics.note(operation, status, seconds, caller)
        if path_in(scope) in PROBES and not self.logs_probes:
            return
        work: Mapping[str, float] = state.get("work_seconds", {})
        logger.info(
            "request",
            request_id=state.get("request_id"),
            **trace_fields(),
            method=scope["method"],
            path=scope["path"],
            operation=operation,
            status=status,
            caller=caller.name,
            mesh_id=state.get("mesh_id") or scope.get("path_params", {}).get("mesh_id"),
            queue_seconds=_rounded(work.get("queue")),
            compute_seconds=_rounded(work.get("compute")),
            seconds=_rounded(seconds),
            bytes=size,
        )


def _client(scope: Scope) -> Caller:
    """Return the caller of a request that was refused, or needs no key: its address."""
    return caller_at(scope["client"][0] if scope.get("client") else None)


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 6)

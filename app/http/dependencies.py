"""Dependencies of handlers: service, caller, deadline and negotiated representation.

Dependencies are coroutines, although they wait for nothing: FastAPI runs plain functions in a
thread, for a fifth of a millisecond each. They are few, since each takes 2 % of the time of a small
request.
"""

import asyncio
import re
from collections.abc import Coroutine, Sequence
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Header, Request
from pydantic import BaseModel, Field
from starlette.requests import ClientDisconnect

from app.access import Caller
from app.encoding import Representation, coding_quality, negotiate, negotiate_coding
from app.encoding.representation import ARRAYS, TEXTS
from app.errors import Fault, problem
from app.schemas.requests import AnswerParameters
from app.service.mesh_storing import PhaseSeconds
from app.service.request_context import RequestContext
from app.service.service import Service

T = TypeVar("T")

_MOST_PREFERENCES = 50
"""Preferences of `Prefer` that are looked at"""

_PROMPT_S = 0.02
"""Seconds of work before a disconnect is listened for: small requests end sooner."""


def service_of(request: Request) -> Service:
    """Return the service of this application."""
    service: Service = request.app.state.service
    return service


async def get_service(request: Request) -> Service:
    """Return `service_of` as a dependency."""
    return service_of(request)


ServiceDep = Annotated[Service, Depends(get_service)]


def caller_of(request: Request) -> Caller:
    """Return the caller that the middleware has found."""
    caller: Caller = request.state.caller
    return caller


async def get_caller(request: Request) -> Caller:
    """Return `caller_of` as a dependency."""
    return caller_of(request)


CallerDep = Annotated[Caller, Depends(get_caller)]


class TimeoutHeader(BaseModel):
    """The header of a request for work."""

    x_timeout_ms: int | None = Field(
        default=None,
        alias="x-timeout-ms",
        gt=0,
        description="The longest time that the client waits, in milliseconds; it bounds no job",
    )


def context_of(request: Request, headers: TimeoutHeader) -> RequestContext:
    """Return the context of a request, with the lower of the client's and our own deadline."""
    limit_ms, own_ms = service_of(request).settings.deadline_s * 1000, headers.x_timeout_ms
    deadline_s = (limit_ms if own_ms is None else min(limit_ms, own_ms)) / 1000
    return RequestContext(caller_of(request), deadline_s, request.state.request_id)


def note_work(request: Request, mesh_id: str, seconds: PhaseSeconds) -> None:
    """Note the mesh of a request, and the seconds of each phase of its work, for the log."""
    request.state.mesh_id, request.state.work_seconds = mesh_id, seconds


async def get_context(
    request: Request, headers: Annotated[TimeoutHeader, Header()]
) -> RequestContext:
    """Return `context_of` as a dependency."""
    return context_of(request, headers)


ContextDep = Annotated[RequestContext, Depends(get_context)]


def job_after(prefer: str | None) -> int | None:
    """Return the seconds after which the header ``Prefer`` asks for a job (RFC 7240).

    None: for an answer, however long it takes.
    """
    parts = (prefer or "").split(",", _MOST_PREFERENCES)[:_MOST_PREFERENCES]
    preferences = [part.partition(";")[0].strip().lower() for part in parts]
    if "respond-async" not in preferences:
        return None
    waits = (re.fullmatch(r'wait\s*=\s*"?([0-9]{1,9})"?', each) for each in preferences)
    return next((int(wait[1]) for wait in waits if wait), 0)


def refuse_idempotency_key(request: Request) -> None:
    """Refuse a key of a job in a request that makes none."""
    if "idempotency-key" in request.headers:
        detail = "Idempotency-Key goes with Prefer: respond-async only"
        raise problem("idempotency_key_unused", detail)


def require_json(request: Request) -> None:
    """Refuse a body whose media type is not JSON."""
    media_type = request.headers.get("content-type", "")
    if not re.match(r"application/([\w.-]+\+)?json\b", media_type, re.IGNORECASE):
        hint = "send the header Content-Type: application/json"
        detail = f"the body of a query must be JSON; it has {media_type or 'no Content-Type'}"
        raise problem("unsupported_media_type", detail, hint=hint)


def negotiated(
    request: Request, parameters: AnswerParameters, offers: Sequence[str]
) -> Representation:
    """Return the representation to answer in, its media type one of the ``offers``."""
    headers = request.headers
    media_type = negotiate(headers.get("accept"), parameters.format, offers)
    if media_type is None:
        raise problem("not_acceptable", f"this answer is available as {', '.join(offers)}")
    if parameters.dtype != Representation.dtype and media_type not in ARRAYS:
        fault = Fault("/query/dtype", f"goes with npy, npz and octets, not with {media_type}")
        raise problem("invalid_request", fault.message, errors=(fault,))
    coding = None
    if media_type in TEXTS and "range" not in headers:
        coding = negotiate_coding(headers.get("accept-encoding"))
    return Representation(media_type, parameters.dtype, coding)


def check_accepted(request: Request, media_type: str, coding: str | None) -> None:
    """Refuse to send an answer whose type or coding the client does not accept."""
    headers = request.headers
    if negotiate(headers.get("accept"), None, [media_type]) is None:
        raise problem("not_acceptable", f"this answer is available as {media_type}")
    if coding is not None and coding_quality(headers.get("accept-encoding"), coding) <= 0:
        hint = f"send the header Accept-Encoding: {coding} (curl: --compressed)"
        raise problem("not_acceptable", f"this answer is stored in {coding}", hint=hint)


async def while_connected(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """Do ``work``, and cancel it if the client disconnects. The body must have been read."""
    working = asyncio.ensure_future(work)
    try:
        await asyncio.wait({working}, timeout=_PROMPT_S)
        if not working.done():
            await _wait_or_disconnect(request, working)
        return working.result()
    finally:
        working.cancel()


async def _wait_or_disconnect(request: Request, working: asyncio.Future[Any]) -> None:
    listening = asyncio.ensure_future(_until_disconnect(request))
    try:
        await asyncio.wait({working, listening}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        listening.cancel()
    if not working.done():
        raise ClientDisconnect


async def _until_disconnect(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass

"""What handlers are given: the service, the deadline, the format, and a client that may hang up."""

import asyncio
import re
from collections.abc import Coroutine, Sequence
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Header, Request
from starlette.requests import ClientDisconnect

from app.callers import Caller
from app.encoding import FORMATS, negotiate
from app.errors import refuse
from app.service import Service

T = TypeVar("T")


def get_service(request: Request) -> Service:
    """Return the service of this application."""
    service: Service = request.app.state.service
    return service


ServiceDep = Annotated[Service, Depends(get_service)]


def get_caller(request: Request) -> Caller:
    """Return who asks."""
    caller: Caller = request.state.caller
    return caller


CallerDep = Annotated[Caller, Depends(get_caller)]


def get_deadline(
    service: ServiceDep,
    x_timeout_ms: Annotated[
        int | None, Header(gt=0, description="Milliseconds the client would wait")
    ] = None,
) -> float:
    """Return the seconds granted: the lower of the client's wish and the service's limit."""
    limit = service.settings.deadline_s
    return limit if x_timeout_ms is None else min(limit, x_timeout_ms / 1000)


Deadline = Annotated[float, Depends(get_deadline)]


def require_json(request: Request) -> None:
    """Refuse a body that does not say it is JSON, with what to do about it."""
    media_type = request.headers.get("content-type", "")
    if not re.match(r"application/([\w.-]+\+)?json\b", media_type, re.IGNORECASE):
        hint = "send the header Content-Type: application/json"
        detail = f"the body of a query is JSON, not {media_type or 'without Content-Type'}"
        raise refuse("unsupported_media_type", detail, hint=hint)


def media_type_of(
    request: Request, name: str | None, offers: Sequence[str] = tuple(FORMATS.values())
) -> str:
    """Return the media type to answer in, one of the ``offers``."""
    media_type = negotiate(request.headers.get("accept"), name, offers)
    if media_type is None:
        raise refuse("not_acceptable", f"this answer comes as {', '.join(offers)}")
    return media_type


async def while_connected(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """Do ``work``, and cancel it when the client hangs up. The body has to be read before."""
    working = asyncio.ensure_future(work)
    listening = asyncio.ensure_future(_until_disconnect(request))
    try:
        await asyncio.wait({working, listening}, return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise ClientDisconnect
        return working.result()
    finally:
        listening.cancel()
        working.cancel()


async def _until_disconnect(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass

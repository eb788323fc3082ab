"""The context of a request: its caller, its deadline, its id."""

from dataclasses import dataclass

from app.access import Caller


@dataclass(frozen=True)
class RequestContext:
    """The caller of a request, its deadline, and its id."""

    caller: Caller
    deadline_s: float
    request_id: str

"""Settings of connections, and attempts of requests, the same for both clients."""

from typing import Any

import httpx2
import stamina

from geodesic_client.errors import ProblemError, UnreachableError
from geodesic_client.flow import Request

ADDRESS = "http://127.0.0.1:8000"
"""Where ``geodesic serve`` listens"""
TIMEOUT_S = 180.0
"""Seconds to wait for an answer: longer than the service computes one that is no job"""
OPTIONAL_TIMEOUT_S = 5.0
"""Seconds to wait where the answer does not matter"""
ATTEMPTS, PATIENCE_S = 8, 120.0
"""Attempts of a request, and seconds after which there are no more; no pause is longer either"""


def settings(address: str, api_key: str | None) -> dict[str, Any]:
    """Return the arguments of a client of httpx2; a key from a file may end with a newline."""
    headers = {} if api_key is None else {"Authorization": f"Bearer {api_key.strip()}"}
    return {"base_url": address, "headers": headers, "timeout": TIMEOUT_S}


def options(request: Request) -> dict[str, Any]:
    """Return the arguments of a request of httpx2, except its content."""
    found: dict[str, Any] = {"params": request.params, "headers": request.headers}
    if request.is_optional:
        found["extensions"] = {"timeout": httpx2.Timeout(OPTIONAL_TIMEOUT_S).as_dict()}
    return found


def attempts(request: Request) -> Any:
    """Return the attempts of a request, for ``for`` and for ``async for``."""
    most = 1 if request.is_optional else ATTEMPTS
    return stamina.retry_context(pause_before_retry, attempts=most, timeout=PATIENCE_S)


def pause_before_retry(error: Exception) -> bool | float:
    """Tell whether to send a request again: True, or the seconds that the service asks to wait."""
    match error:
        case ProblemError(status=429 | 503, retry_after=None):
            return True
        case ProblemError(status=429 | 503, retry_after=float(seconds)) if seconds <= PATIENCE_S:
            return seconds
        case UnreachableError(may_retry=may_retry):
            return may_retry
    return False

"""Errors of the client.

::

    GeodesicClientError
    ├── ProblemError        the service refused, or failed
    └── UnreachableError    no service answered
"""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import httpx2


class GeodesicClientError(Exception):
    """The base of all errors of this package."""


class UnreachableError(GeodesicClientError):
    """No service answered: there is none at the address, or the connection broke."""

    def __init__(self, message: str, *, may_retry: bool = False) -> None:
        super().__init__(message)
        self.may_retry = may_retry


class ProblemError(GeodesicClientError):
    """A problem that the service answered with (RFC 9457).

    Attributes
    ----------
    status
        The HTTP status.
    code
        The kind of problem, such as ``invalid_point``; ``/problems/{code}`` of the service has its
        meaning.
    detail
        What is wrong.
    hint
        What to do, if the service knows it.
    errors
        The elements of the request at fault: each has ``pointer`` and ``message``.
    limit, actual, setting
        If a limit is exceeded: the limit, the actual number, and the setting of the service.
    request_id
        The id of the request in the log of the service.
    retry_after
        Seconds after which the request may succeed, where the service said so.
    document
        The whole problem.
    """

    def __init__(self, status: int, document: Mapping[str, Any], retry_after: float | None) -> None:
        self.status = status
        self.document = document
        self.code = str(document.get("code", "unknown"))
        self.detail = str(document.get("detail", f"the service answered {status}"))
        self.hint: str | None = document.get("hint")
        self.errors: list[Mapping[str, str]] = document.get("errors") or []
        self.limit: float | None = document.get("limit")
        self.actual: float | None = document.get("actual")
        self.setting: str | None = document.get("setting")
        self.request_id: str | None = document.get("request_id")
        self.retry_after = retry_after
        super().__init__(status, document, retry_after)  # pickle calls it with these

    def __str__(self) -> str:
        hint = f" ({self.hint})" if self.hint else ""
        return f"{self.code}: {self.detail}{hint}"


def check(response: httpx2.Response) -> httpx2.Response:
    """Return a response that is an answer; raise `ProblemError` for any other."""
    if response.is_success:
        return response
    seconds = response.headers.get("retry-after", "")
    retry_after = float(seconds) if seconds.isdecimal() else None
    raise ProblemError(response.status_code, _document_of(response), retry_after)


def _document_of(response: httpx2.Response) -> Mapping[str, Any]:
    """Return the problem document of a response, or one about it if a proxy sent it, say."""
    if response.has_redirect_location:
        return {"detail": f"the service has another address: {response.headers['location']}"}
    with suppress(ValueError):
        document = response.json()
        if isinstance(document, dict):
            return document
    return {
        "detail": f"the answer has status {response.status_code}, but is not a problem document"
    }


_UNSENT = httpx2.ConnectError, httpx2.ConnectTimeout
_BROKEN = httpx2.NetworkError, httpx2.RemoteProtocolError


def unreachable(error: httpx2.TransportError) -> UnreachableError:
    """Return the error for a request that was not answered.

    If the connection broke, the service may have received the request. It may be sent again all the
    same: meshes are named by their content, jobs by a key, and queries change nothing. But a second
    ``DELETE`` would find nothing.
    """
    repeatable = _UNSENT if error.request.method == "DELETE" else (*_UNSENT, *_BROKEN)
    message = f"no answer from {error.request.url}: {error or type(error).__name__}"
    return UnreachableError(message, may_retry=isinstance(error, repeatable))

"""Admission: API keys, where they are set, and the rate limits of each caller."""

import re
from asyncio import sleep

from starlette.types import ASGIApp, Receive, Scope, Send

from app.access import Caller, caller_at, name_of_secret
from app.errors import ProblemError, problem
from app.http.middleware.probes import PROBES
from app.http.middleware.rate_limits import MinuteRate, RateLimits
from app.http.page import ASSETS
from app.http.prefix import path_in
from app.settings import Settings

_OPEN = PROBES | {"/", "/docs", "/openapi.json"}
_OPEN_FOLDERS = ("/problems/", f"{ASSETS}/")
_BEARER = re.compile(rb"bearer +([A-Za-z0-9._~+/-]+=*)", re.IGNORECASE)

WRONG_KEYS_A_MINUTE = 10
"""Wrong keys of one address that are refused at once"""
WRONG_KEY_PAUSE_S = 1.0
"""Seconds before each further one is refused"""


def is_open(path: str) -> bool:
    """Tell whether a path needs no key and counts for no limit."""
    return path in _OPEN or path.startswith(_OPEN_FOLDERS)


class AdmissionMiddleware:
    """Middleware that finds the caller (``request.state.caller``), and admits or refuses it."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.keys = settings.api_keys
        self.rate_limits = RateLimits(settings.rate_limit, settings.max_concurrent)
        self.wrong_keys = MinuteRate(WRONG_KEYS_A_MINUTE)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or is_open(path_in(scope)):
            await self.app(scope, receive, send)
            return
        scope["state"]["caller"] = caller = await self._admit(scope)
        with self.rate_limits.counting(caller):
            await self.app(scope, receive, send)

    async def _admit(self, scope: Scope) -> Caller:
        host = scope["client"][0] if scope["client"] else None
        if not self.keys:
            return caller_at(host)
        given = [value for name, value in scope["headers"] if name == b"authorization"]
        if not given:
            raise _unauthorized("the request has no API key", "Bearer")
        # uvicorn leaves spaces at the end of a header.
        credentials = _BEARER.fullmatch(given[0].strip(b" \t")) if len(given) == 1 else None
        name = name_of_secret(self.keys, credentials[1]) if credentials else None
        if name is None:
            await self._slow_down(caller_at(host))
            raise _unauthorized("the API key is wrong", 'Bearer error="invalid_token"')
        return Caller(name, has_key=True)

    async def _slow_down(self, address: Caller) -> None:
        """Refuse an address that guesses keys; a right key from there is still admitted."""
        wait_s = self.wrong_keys.seconds_over(address.name)
        if wait_s:
            await sleep(WRONG_KEY_PAUSE_S)
            headers = {"Retry-After": str(wait_s)}
            raise problem("rate_limited", "too many wrong API keys", headers=headers)


def _unauthorized(detail: str, challenge: str) -> ProblemError:
    hint = "send the header Authorization: Bearer, with one key"
    return problem("unauthorized", detail, hint=hint, headers={"WWW-Authenticate": challenge})

"""Connections: the number that may be open, of all callers and of each."""

from collections import Counter
from time import monotonic

import structlog

from app.access import Caller
from app.errors import Problem, over_limit
from app.settings import Settings

logger = structlog.get_logger(module=__name__)

LINGERING = 100
"""Refused connections that stay open until their refusal is read"""
_WARN_EVERY_S = 60.0


class Connections:
    """The open connections, counted by caller."""

    def __init__(self, settings: Settings) -> None:
        self._limit = settings.max_connections
        self._limit_each = settings.max_caller_connections
        self._open: Counter[Caller] = Counter()
        self._warn_after = 0.0

    @property
    def is_crowded(self) -> bool:
        """Whether refusals themselves take too many connections."""
        return self._open.total() > self._limit + LINGERING

    def open(self, caller: Caller) -> Problem | None:
        """Count a connection, and return the reason to refuse it, if there is one."""
        self._open[caller] += 1
        total, own = self._open.total(), self._open[caller]
        retry = {"Retry-After": "1"}
        if total > self._limit:
            what, setting = "connections", "max_connections"
            refusal = over_limit(
                "too_many_connections", what, total, self._limit, setting, headers=retry
            )
        elif own > self._limit_each:
            what, setting = "connections of one caller", "max_caller_connections"
            refusal = over_limit(
                "rate_limited", what, own, self._limit_each, setting, headers=retry
            )
        else:
            return None
        if monotonic() >= self._warn_after:
            self._warn_after = monotonic() + _WARN_EVERY_S
            logger.warning("connections refused", reason=str(refusal), caller=caller.name)
        return refusal.problem

    def close(self, caller: Caller) -> None:
        """Count a connection no longer."""
        self._open[caller] -= 1
        if not self._open[caller]:
            del self._open[caller]

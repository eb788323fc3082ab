"""Rate limits of each caller: requests a minute, and concurrent requests."""

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil
from time import monotonic

from pyrate_limiter import GCRA, Duration, Rate

from app.access import Caller
from app.errors import over_limit
from app.service.concurrency import ConcurrencyLimit

_REMEMBERED = 10_000
"""Callers whose rates are remembered, in some 200 bytes each.

A forgotten caller starts afresh: a client with ten thousand addresses has ten thousand limits
anyway.
"""


class MinuteRate:
    """A limit on the events of each caller in a minute; all of them may come at once."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._rates = [Rate(limit, Duration.MINUTE)]
        # The generic cell rate algorithm needs one number for each caller. The library's Limiter
        # would add buckets that are never dropped, and a thread that looks after them.
        self._policy = GCRA()
        self._known: OrderedDict[str, tuple[float, ...]] = OrderedDict()

    def seconds_over(self, name: str) -> int:
        """Count one event, and return 0, or the seconds to wait if there are too many."""
        before = self._known.get(name) or self._policy.initial(self._rates)
        now = int(monotonic() * 1000)
        self._known[name], decision = self._policy.step(self._rates, before, now, weight=1)
        self._known.move_to_end(name)
        if len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        return 0 if decision.allowed else max(1, ceil((decision.retry_after_ms or 0) / 1000))


class RateLimits:
    """The limits of each caller; ``None`` stands for no limit."""

    def __init__(self, a_minute: int | None, at_once: int | None) -> None:
        self._rate = MinuteRate(a_minute) if a_minute else None
        self._at_once = ConcurrencyLimit(at_once, "rate_limited", "requests", "max_concurrent")

    @contextmanager
    def counting(self, caller: Caller) -> Iterator[None]:
        """Count the block as one request, or refuse it with ``rate_limited``."""
        with self._at_once.counting(caller):
            if self._rate is not None:
                self._refuse_over(self._rate, caller)
            yield

    def _refuse_over(self, rate: MinuteRate, caller: Caller) -> None:
        wait_s, limit = rate.seconds_over(caller.name), rate.limit
        if wait_s:
            what, headers = "requests within a minute", {"Retry-After": str(wait_s)}
            raise over_limit("rate_limited", what, limit + 1, limit, "rate_limit", headers=headers)

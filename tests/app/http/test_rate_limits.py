import threading
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from app.access import Caller, caller_at
from app.errors import Problem, ProblemError
from app.http.middleware import rate_limits
from app.http.middleware.rate_limits import RateLimits
from tests.support.clocks import Clock


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(rate_limits, "monotonic", clock)
    return clock


ALICE, BOB = Caller("alice", has_key=True), Caller("bob", has_key=True)


def refusal_of(limits: RateLimits, caller: Caller) -> Problem | None:
    try:
        with limits.counting(caller):
            return None
    except ProblemError as error:
        return error.problem


def test_as_many_as_the_rate_at_once_then_one_by_one(clock: Clock) -> None:
    limits = RateLimits(a_minute=3, at_once=None)

    assert [refusal_of(limits, ALICE) for _ in range(3)] == [None] * 3
    refused: Any = refusal_of(limits, ALICE)
    assert (refused.code, refused.limit, refused.actual) == ("rate_limited", 3, 4)
    assert refused.setting == "rate_limit"
    assert refused.headers == {"Retry-After": "20"}
    assert refusal_of(limits, BOB) is None

    clock.now += 19.5
    assert refusal_of(limits, ALICE).headers == {"Retry-After": "1"}  # type: ignore[union-attr]
    clock.now += 0.5
    assert refusal_of(limits, ALICE) is None
    assert refusal_of(limits, ALICE) is not None
    clock.now += 3600
    assert [refusal_of(limits, ALICE) is None for _ in range(4)] == [True, True, True, False]


@pytest.mark.parametrize(
    "a_minute", [1, 7, 60, 1000, pytest.param(100_000, marks=pytest.mark.slow)]
)
def test_over_a_while_the_rate_is_kept(clock: Clock, a_minute: int) -> None:
    limits = RateLimits(a_minute, at_once=None)
    requests = 2 * a_minute + 10
    admitted = 0
    for _ in range(requests):
        admitted += refusal_of(limits, ALICE) is None
        clock.now += 60 / requests

    assert a_minute <= admitted <= 2 * a_minute


def test_requests_at_the_same_time() -> None:
    limits = RateLimits(a_minute=None, at_once=2)

    with limits.counting(ALICE):
        with limits.counting(ALICE):
            refused: Any = refusal_of(limits, ALICE)
            assert (refused.code, refused.limit, refused.actual) == ("rate_limited", 2, 3)
            assert refused.setting == "max_concurrent"
            assert refused.headers == {"Retry-After": "1"}
            assert refusal_of(limits, BOB) is None
        assert refusal_of(limits, ALICE) is None
    with limits.counting(ALICE):
        assert refusal_of(limits, ALICE) is None, "all others have ended"


def test_what_fails_has_ended_too() -> None:
    limits = RateLimits(a_minute=None, at_once=1)

    with pytest.raises(KeyError), limits.counting(ALICE):
        raise KeyError

    assert refusal_of(limits, ALICE) is None


def test_a_request_too_many_at_once_costs_no_rate() -> None:
    limits = RateLimits(a_minute=2, at_once=1)

    with limits.counting(ALICE):
        assert refusal_of(limits, ALICE).setting == "max_concurrent"  # type: ignore[union-attr]
    assert refusal_of(limits, ALICE) is None


@contextmanager
def watched_memory() -> Iterator[list[int]]:
    """Append the bytes that are allocated inside the block, and still needed after it."""
    found: list[int] = []
    tracemalloc.start()
    try:
        yield found
        found.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()


def caller_number(n: int) -> Caller:
    return Caller(f"10.{n >> 16}.{n >> 8 & 255}.{n & 255}", has_key=False)


def test_without_limits_nothing_is_kept() -> None:
    limits = RateLimits(None, None)

    with watched_memory() as memory:
        assert all(refusal_of(limits, caller_number(n)) is None for n in range(1000))

    assert memory[0] < 10_000


@pytest.mark.slow
@pytest.mark.usefixtures("clock")
def test_many_addresses_take_bounded_memory_and_no_thread() -> None:
    threads = threading.active_count()
    limits = RateLimits(a_minute=1, at_once=1)

    with watched_memory() as memory:
        for n in range(15_000):
            refusal_of(limits, caller_number(n))

    assert memory[0] < 4_000_000
    assert threading.active_count() <= threads  # one of another test may end meanwhile
    remembered = [refusal_of(limits, caller_number(n)) is not None for n in range(14_999, -1, -1)]
    assert remembered == [True] * 10_000 + [False] * 5_000


@pytest.mark.parametrize(
    ("host", "name"),
    [
        ("10.0.0.7", "10.0.0.7"),
        ("::ffff:10.0.0.7", "10.0.0.7"),
        ("2001:db8:1:2:3::4", "2001:db8:1:2::"),
        ("2001:db8:1:2:ffff::", "2001:db8:1:2::"),
        ("fe80::1%eth0", "fe80::"),
        ("not an address\r\nX: y", "unknown"),
        ("", "unknown"),
        (None, "unknown"),
    ],
)
def test_callers_without_a_key_are_their_address(host: str | None, name: str) -> None:
    assert caller_at(host) == Caller(name, has_key=False)

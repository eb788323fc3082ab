"""Allowances that several replicas count together, on both databases."""

from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack

import anyio
import pytest

from app.state import Allowances, Database
from tests.support.databases import opened

HOUR_S = 3600.0


def pair(database: Database) -> tuple[Allowances, Allowances]:
    return Allowances(database, HOUR_S), Allowances(database, HOUR_S)


async def share_a_rate(database: Database) -> None:
    first, second = pair(database)
    waits = [await each.seconds_over("alice", 4) for each in (first, second) * 2]
    assert waits == [0] * 4
    assert 1 <= await first.seconds_over("alice", 4) <= 15
    assert 1 <= await second.seconds_over("alice", 4) <= 15
    assert await second.seconds_over("bob", 4) == 0
    # As if fifteen seconds had passed: one more is free.
    await database.run("UPDATE rates SET due = due - 15.0 WHERE caller = ?", "alice")
    assert await second.seconds_over("alice", 4) == 0
    await database.run("UPDATE rates SET due = due - 3600.0 WHERE caller = ?", "alice")
    waits = [await each.seconds_over("alice", 4) for each in (first, second) * 2]
    assert waits == [0] * 4


async def count_at_once(database: Database) -> None:
    admitted = []
    first, second = pair(database)

    async def ask(allowances: Allowances) -> None:
        admitted.append(await allowances.seconds_over("alice", 5) == 0)

    async with anyio.create_task_group() as tasks:
        for _ in range(6):
            tasks.start_soon(ask, first)
            tasks.start_soon(ask, second)
    assert admitted.count(True) == 5


async def share_concurrency(database: Database) -> None:
    async def counted(allowances: Allowances, kind: str, caller: str) -> int:
        return await stack.enter_async_context(allowances.counting(kind, caller, 2))

    first, second = pair(database)
    async with AsyncExitStack() as stack:
        async with first.counting("requests", "alice", 2) as running:
            assert running == 1
            assert await counted(second, "requests", "alice") == 2
            assert await counted(first, "requests", "alice") == 3, "too many, and not counted"
            assert await counted(first, "requests", "bob") == 1
            assert await counted(first, "uploads", "alice") == 1
        assert await counted(second, "requests", "alice") == 2
        assert await counted(first, "requests", "alice") == 3
        await database.run("UPDATE work SET ends = ends - 3600.0")
        assert await counted(first, "requests", "alice") == 1, "a service died long ago"
    assert await database.rows("SELECT * FROM work") == []


@pytest.mark.parametrize("check", [share_a_rate, count_at_once, share_concurrency])
def test_allowances(database: Database, check: Callable[[Database], Awaitable[None]]) -> None:
    async def check_opened() -> None:
        async with opened(database):
            await check(database)

    anyio.run(check_opened)

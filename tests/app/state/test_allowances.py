"""Allowances that several replicas count together."""

from contextlib import AsyncExitStack

import anyio
import pytest
from sqlalchemy import select, update

from app.state import Allowances, Database
from app.state.schema import rates, work

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.parametrize("state_url", ["postgresql"], indirect=True),
    pytest.mark.service,
]

HOUR_S = 3600.0

Pair = tuple[Allowances, Allowances]


@pytest.fixture
def pair(database: Database) -> Pair:
    return Allowances(database, HOUR_S), Allowances(database, HOUR_S)


async def test_a_rate_is_shared(database: Database, pair: Pair) -> None:
    async def pass_time(seconds: float) -> None:
        change = update(rates).where(rates.c.caller == "alice").values(due=rates.c.due - seconds)
        async with database.transaction() as connection:
            await connection.execute(change)

    first, second = pair
    for _ in range(2):
        waits = [await each.seconds_over("alice", 4) for each in pair * 2]
        assert waits == [0] * 4
        assert 1 <= await first.seconds_over("alice", 4) <= 15
        assert 1 <= await second.seconds_over("alice", 4) <= 15
        assert await second.seconds_over("bob", 4) == 0
        await pass_time(15.0)
        assert await second.seconds_over("alice", 4) == 0
        await pass_time(HOUR_S)


async def test_a_rate_is_counted_at_once(pair: Pair) -> None:
    admitted = []

    async def ask(allowances: Allowances) -> None:
        admitted.append(await allowances.seconds_over("alice", 5) == 0)

    async with anyio.create_task_group() as tasks:
        for allowances in pair * 6:
            tasks.start_soon(ask, allowances)
    assert admitted.count(True) == 5


async def test_concurrency_is_shared(database: Database, pair: Pair) -> None:
    async def counted(allowances: Allowances, kind: str, caller: str) -> int:
        return await stack.enter_async_context(allowances.counting(kind, caller, 2))

    first, second = pair
    async with AsyncExitStack() as stack:
        async with first.counting("requests", "alice", 2) as running:
            assert running == 1
            assert await counted(second, "requests", "alice") == 2
            assert await counted(first, "requests", "alice") == 3, "too many, and not counted"
            assert await counted(first, "requests", "bob") == 1
            assert await counted(first, "uploads", "alice") == 1
        assert await counted(second, "requests", "alice") == 2
        assert await counted(first, "requests", "alice") == 3
        async with database.transaction() as connection:
            await connection.execute(update(work).values(ends=work.c.ends - HOUR_S))
        assert await counted(first, "requests", "alice") == 1, "a service died long ago"
    async with database.transaction() as connection:
        assert (await connection.execute(select(work))).all() == []

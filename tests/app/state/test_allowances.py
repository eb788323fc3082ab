"""Allowances that several replicas count together, on both databases."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import anyio
import pytest

from app.errors import StateUnavailableError
from app.state import Allowances, Database, Replicas, Statements
from tests.support.databases import opened
from tests.support.waiting import LONG_S


async def new_replica(database: Database) -> tuple[Allowances, Replicas]:
    replicas = Replicas(database)
    await replicas.beat()
    return Allowances(database, replicas.id), replicas


async def share_a_rate(database: Database) -> None:
    (first, _), (second, _) = await new_replica(database), await new_replica(database)
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
    (first, _), (second, _) = await new_replica(database), await new_replica(database)

    async def ask(allowances: Allowances) -> None:
        admitted.append(await allowances.seconds_over("alice", 5) == 0)

    async with anyio.create_task_group() as tasks:
        for _ in range(6):
            tasks.start_soon(ask, first)
            tasks.start_soon(ask, second)
    assert admitted.count(True) == 5


async def share_concurrency(database: Database) -> None:
    (first, _), (second, leaving) = await new_replica(database), await new_replica(database)
    assert await first.begin("requests", "alice", 2) == 1
    assert await second.begin("requests", "alice", 2) == 2
    assert await first.begin("requests", "alice", 2) == 3, "too many, and not counted"
    assert await first.begin("requests", "bob", 2) == 1
    assert await first.begin("uploads", "alice", 2) == 1
    await first.end("requests", "alice")
    assert await second.begin("requests", "alice", 2) == 2
    assert await first.begin("requests", "alice", 2) == 3
    await leaving.leave()
    assert await first.begin("requests", "alice", 2) == 1, "what a replica did ends with it"
    for kind, caller in (("requests", "alice"), ("requests", "bob"), ("uploads", "alice")):
        await first.end(kind, caller)
    assert await database.rows("SELECT * FROM running") == []


class FailingOnce:
    """A database that commits the next block, and cannot say so."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._fails = True

    @asynccontextmanager
    async def alone(self, name: str) -> AsyncIterator[Statements]:
        async with self._database.alone(name) as statements:
            yield statements
        if self._fails:
            self._fails = False
            raise StateUnavailableError("the connection is lost")


async def fail_to_commit(database: Database) -> None:
    _, replicas = await new_replica(database)
    failing: Any = FailingOnce(database)
    allowances = Allowances(failing, replicas.id)
    with pytest.raises(StateUnavailableError):
        await allowances.begin("uploads", "alice", 1)
    with anyio.fail_after(LONG_S):
        while await database.rows("SELECT * FROM running"):
            await anyio.sleep(0.01)
    assert await allowances.begin("uploads", "alice", 1) == 1
    await allowances.end("uploads", "alice")
    assert await database.rows("SELECT * FROM running") == []


@pytest.mark.parametrize("check", [share_a_rate, count_at_once, share_concurrency, fail_to_commit])
def test_allowances(database: Database, check: Callable[[Database], Awaitable[None]]) -> None:
    async def check_opened() -> None:
        async with opened(database):
            await check(database)

    anyio.run(check_opened)

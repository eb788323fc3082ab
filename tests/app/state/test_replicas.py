"""Replicas that come, go, fall silent and come back, on both databases."""

from collections.abc import Awaitable, Callable

import anyio
import pytest

from app.state import Database, Replicas
from app.state.replicas import SILENT_BEATS
from tests.support.databases import opened


async def come_and_go(database: Database) -> None:
    first, second = Replicas(database), Replicas(database)
    assert await first.beat() == {first.id}
    assert await second.beat() == {first.id, second.id}
    await second.leave()
    assert await first.beat() == {first.id}


async def fall_silent(database: Database) -> None:
    first, second, third = (Replicas(database) for _ in range(3))
    for replica in (first, second, third):
        await replica.beat()
    for _ in range(SILENT_BEATS):
        assert second.id in await first.beat()
        await third.beat()
    assert await first.beat() == {first.id, third.id}
    assert await third.beat() == {first.id, third.id}
    # It comes back under its name.
    assert await second.beat() == {first.id, second.id, third.id}
    assert second.id in await first.beat()


async def all_pause(database: Database) -> None:
    """Nobody beats for a while, as when the database is away: nobody is dead."""
    first, second = Replicas(database), Replicas(database)
    for _ in range(SILENT_BEATS - 1):
        await first.beat()
    await second.beat()
    assert await first.beat() == {first.id, second.id}
    assert await second.beat() == {first.id, second.id}


@pytest.mark.parametrize("check", [come_and_go, fall_silent, all_pause])
def test_replicas(database: Database, check: Callable[[Database], Awaitable[None]]) -> None:
    async def check_opened() -> None:
        async with opened(database):
            await check(database)

    anyio.run(check_opened)

"""Promises of both databases."""

import asyncio

from app.state import Database
from tests.support.databases import opened


def test_blocks_of_one_name_never_overlap(database: Database) -> None:
    """Not even where one comes after a block has ended, and before the next has begun."""
    inside: list[int] = []

    async def enter_twice(number: int) -> None:
        for _ in range(2):
            async with database.alone("a name"):
                inside.append(number)
                assert inside == [number]
                await asyncio.sleep(0)
                inside.remove(number)

    async def main() -> None:
        async with opened(database):
            await asyncio.gather(*map(enter_twice, range(3)))

    asyncio.run(main())


def test_blocks_of_two_names_may_overlap(database: Database) -> None:
    async def main() -> None:
        async with opened(database), database.alone("a name"), database.alone("another"):
            pass

    asyncio.run(main())

"""Allowances of callers, counted for all replicas: requests a minute, and work at the same time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from math import ceil
from uuid import uuid4

from sqlalchemy import delete, func, insert, select
from sqlalchemy.dialects import postgresql

from app.errors import StateUnavailableError
from app.state.database import Database
from app.state.schema import CLOCK, rates, work

_MINUTE_S = 60.0
_PURGE_EVERY = 1000
"""Counted events between two removals of rows that are as good as none"""


class Allowances:
    """What each caller has taken of its allowances, in a ``database`` that services share.

    A rate is the time at which the last event would come if events came evenly, by the clock of the
    database (the generic cell rate algorithm). Work has a row, which counts for ``longest_s``
    seconds at most: that of a service that died need not be removed.
    """

    def __init__(self, database: Database, longest_s: float) -> None:
        self._database = database
        self._longest_s = longest_s
        self._events = 0

    async def seconds_over(self, caller: str, limit: int) -> int:
        """Count one event of at most ``limit`` a minute; return 0, or the seconds to wait.

        As many may come at once.
        """
        interval = _MINUTE_S / limit
        ahead_s = _MINUTE_S - interval
        first = postgresql.insert(rates).values(caller=caller, due=CLOCK + interval)
        event = first.on_conflict_do_update(
            index_elements=[rates.c.caller],
            set_={"due": func.greatest(rates.c.due, CLOCK) + interval},
            where=rates.c.due <= CLOCK + ahead_s + 1e-6,
        ).returning(rates.c.caller)
        wait = select(rates.c.due - CLOCK - ahead_s).where(rates.c.caller == caller)
        async with self._database.transaction() as connection:
            is_counted = await connection.scalar(event) is not None
            wait_s = 0.0 if is_counted else await connection.scalar(wait)
        await self._purge_sometimes()
        return 0 if is_counted else max(1, ceil(wait_s or 0.0))

    @asynccontextmanager
    async def counting(self, kind: str, caller: str, limit: int) -> AsyncIterator[int]:
        """Count the block as work; yield how much the caller then has under way.

        Beyond ``limit`` it is not counted.
        """
        row = {"id": uuid4().hex, "kind": kind, "caller": caller, "ends": CLOCK + self._longest_s}
        others = select(func.count()).where(
            work.c.kind == kind, work.c.caller == caller, work.c.ends > CLOCK
        )
        async with self._database.transaction(f"work {kind} {caller}") as connection:
            running = (await connection.execute(others)).scalar_one() + 1
            if running <= limit:
                await connection.execute(insert(work).values(row))
        try:
            yield running
        finally:
            with suppress(StateUnavailableError):  # it counts no longer than its time
                await asyncio.shield(self._forget(row["id"]))

    async def _forget(self, work_id: object) -> None:
        async with self._database.transaction() as connection:
            await connection.execute(delete(work).where(work.c.id == work_id))

    async def _purge_sometimes(self) -> None:
        self._events += 1
        if self._events % _PURGE_EVERY == 0:
            async with self._database.transaction() as connection:
                await connection.execute(delete(rates).where(rates.c.due < CLOCK))
                await connection.execute(delete(work).where(work.c.ends < CLOCK))

"""Allowances of callers, counted for all replicas: requests a minute, and work at the same time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from math import ceil
from uuid import uuid4

from app.errors import StateUnavailableError
from app.state.database import Database

_MINUTE_S = 60.0
_PURGE_EVERY = 1000
"""Counted events between two removals of rows that are as good as none"""


class Allowances:
    """What each caller has taken of its allowances, in ``database``.

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
        now, interval = self._database.clock, _MINUTE_S / limit
        counted = await self._database.rows(
            f"INSERT INTO rates VALUES (?, {now} + CAST(? AS DOUBLE PRECISION)) "  # noqa: S608 - no value
            "ON CONFLICT (caller) DO UPDATE SET due = CAST(? AS DOUBLE PRECISION) + "
            f"CASE WHEN rates.due > {now} THEN rates.due ELSE {now} END "
            f"WHERE rates.due <= {now} + CAST(? AS DOUBLE PRECISION) RETURNING caller",
            caller,
            interval,
            interval,
            _MINUTE_S - interval + 1e-6,
        )
        await self._purge_sometimes()
        if counted:
            return 0
        rows = await self._database.rows(
            f"SELECT due - {now} FROM rates WHERE caller = ?",  # noqa: S608 - no value
            caller,
        )
        ahead = float(rows[0][0]) if rows else 0.0
        return max(1, ceil(ahead + interval - _MINUTE_S))

    @asynccontextmanager
    async def counting(self, kind: str, caller: str, limit: int) -> AsyncIterator[int]:
        """Count the block as work; yield how much the caller then has under way.

        Beyond ``limit`` it is not counted.
        """
        work, now = uuid4().hex, self._database.clock
        async with self._database.alone(f"work {kind} {caller}") as statements:
            ((running,),) = await statements.rows(
                f"SELECT COUNT(*) + 1 FROM work WHERE kind = ? AND caller = ? AND ends > {now}",  # noqa: S608 - no value
                kind,
                caller,
            )
            if running <= limit:
                await statements.run(
                    f"INSERT INTO work VALUES (?, ?, ?, {now} + CAST(? AS DOUBLE PRECISION))",  # noqa: S608 - no value
                    work,
                    kind,
                    caller,
                    self._longest_s,
                )
        try:
            yield int(running)
        finally:
            with suppress(StateUnavailableError):  # it counts no longer than its time
                await asyncio.shield(self._database.run("DELETE FROM work WHERE id = ?", work))

    async def _purge_sometimes(self) -> None:
        self._events += 1
        if self._events % _PURGE_EVERY == 0:
            clock = self._database.clock
            await self._database.run(f"DELETE FROM rates WHERE due < {clock}")  # noqa: S608 - no value
            await self._database.run(f"DELETE FROM work WHERE ends < {clock}")  # noqa: S608 - no value

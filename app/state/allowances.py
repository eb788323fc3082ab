"""Allowances of callers, counted for all replicas: requests a minute, and work at the same time."""

import asyncio
from collections import Counter
from math import ceil

from app.errors import StateUnavailableError
from app.state.database import Database, Statements

_MINUTE_S = 60.0
_PURGE_EVERY = 1000
"""Counted events between two removals of rates that are as good as new"""
_RETRY_S = 1.0


class Allowances:
    """What each caller has taken of its allowances, in ``database``.

    A rate is the time at which the last event would come if events came evenly, by the clock of the
    database (the generic cell rate algorithm). Work at the same time has a row for each replica,
    which only that one writes; rows of replicas that are gone do not count.
    """

    def __init__(self, database: Database, replica: str) -> None:
        self._database = database
        self._replica = replica
        self._running: Counter[tuple[str, str]] = Counter()
        self._events = 0
        self._retries: set[asyncio.Task[None]] = set()

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

    async def begin(self, kind: str, caller: str, limit: int) -> int:
        """Count the beginning of some work; return how much the caller then has under way.

        Beyond ``limit`` it is not counted.
        """
        is_counted = False
        try:
            async with self._database.alone(f"running {kind} {caller}") as statements:
                elsewhere = await self._running_elsewhere(statements, kind, caller)
                running = elsewhere + self._running[kind, caller] + 1
                if running > limit:
                    return running
                self._running[kind, caller] += 1
                is_counted = True
                await statements.run(
                    "INSERT INTO running VALUES (?, ?, ?, ?) "
                    "ON CONFLICT (replica, kind, caller) DO UPDATE SET count = excluded.count",
                    self._replica,
                    kind,
                    caller,
                    self._running[kind, caller],
                )
        except BaseException:
            if is_counted:  # the database may have counted it, too
                self._lower(kind, caller)
                self._write_in_background(kind, caller)
            raise
        return running

    async def end(self, kind: str, caller: str) -> None:
        """Count the end of work; where the database is away, as soon as it is back."""
        self._lower(kind, caller)
        try:
            await self._write(kind, caller)
        except StateUnavailableError:
            self._write_in_background(kind, caller)
        except asyncio.CancelledError:
            self._write_in_background(kind, caller)
            raise

    async def close(self) -> None:
        """Give up what is still to be written; the rows end with this replica."""
        for retry in self._retries:
            retry.cancel()
        await asyncio.gather(*self._retries, return_exceptions=True)

    async def _running_elsewhere(self, statements: Statements, kind: str, caller: str) -> int:
        ((count,),) = await statements.rows(
            "SELECT COALESCE(SUM(count), 0) FROM running WHERE kind = ? AND caller = ? "
            "AND replica <> ? AND replica IN (SELECT id FROM replicas)",
            kind,
            caller,
            self._replica,
        )
        return int(count)

    def _lower(self, kind: str, caller: str) -> None:
        self._running[kind, caller] -= 1
        if not self._running[kind, caller]:
            del self._running[kind, caller]

    async def _write(self, kind: str, caller: str) -> None:
        async with self._database.alone(f"running {kind} {caller}") as statements:
            running = self._running[kind, caller]
            row = (self._replica, kind, caller)
            where = "WHERE replica = ? AND kind = ? AND caller = ?"
            if running:
                await statements.run(f"UPDATE running SET count = ? {where}", running, *row)  # noqa: S608 - no value
            else:
                await statements.run(f"DELETE FROM running {where}", *row)  # noqa: S608 - no value

    def _write_in_background(self, kind: str, caller: str) -> None:
        retry = asyncio.create_task(self._write_until_done(kind, caller))
        self._retries.add(retry)
        retry.add_done_callback(self._retries.discard)

    async def _write_until_done(self, kind: str, caller: str) -> None:
        while True:
            try:
                await self._write(kind, caller)
            except StateUnavailableError:
                await asyncio.sleep(_RETRY_S)
            else:
                return

    async def _purge_sometimes(self) -> None:
        self._events += 1
        if self._events % _PURGE_EVERY == 0:
            await self._database.run(f"DELETE FROM rates WHERE due < {self._database.clock}")  # noqa: S608 - no value

"""Finished jobs stay for their time, whatever happens to the clock."""

from collections import Counter
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime, timedelta
from typing import Any, cast

import pytest

from app.jobs import retention
from app.jobs.job import EndedJob, Job
from app.jobs.retention import Retention
from tests.support.clocks import TEN_YEARS, Calendar, Clock
from tests.support.jobs import new_job

HOUR_S = 3600.0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(retention, "monotonic", clock)
    return clock


@pytest.fixture
def calendar(monkeypatch: pytest.MonkeyPatch) -> Calendar:
    calendar = Calendar()
    monkeypatch.setattr(retention, "datetime", calendar)
    monkeypatch.setattr("app.jobs.job.datetime", calendar)
    return calendar


def finished_job(client: str = "") -> Job:
    return new_job(client).running(0.0).successful("a result")


class Pins(Counter[str]):
    """Counts the pins of each result, as a store of results does."""

    def pin(self, name: str, _client: str) -> None:
        self[name] += 1

    def unpin(self, name: str, _client: str) -> None:
        self[name] -= 1


def retention_of(pins: Pins) -> Retention:
    return Retention(cast(Any, pins), HOUR_S)


@pytest.mark.parametrize("moved", [TEN_YEARS, -TEN_YEARS])
def test_a_clock_that_is_moved_changes_nothing(
    clock: Clock, calendar: Calendar, moved: timedelta
) -> None:
    jobs = retention_of(Pins())
    before = finished_job()
    jobs.add(EndedJob.of(before))
    calendar.moved = moved
    clock.now += 600
    after = finished_job()
    jobs.add(EndedJob.of(after))

    clock.now += 2999
    assert jobs.due() == []
    clock.now += 1
    assert jobs.due() == [before.id]
    clock.now += 600
    assert jobs.due() == [before.id, after.id]


def records_of(*jobs: Job) -> Callable[[], Awaitable[list[EndedJob]]]:
    async def read() -> list[EndedJob]:
        return list(map(EndedJob.of, jobs))

    return read


@pytest.mark.anyio
async def test_a_job_that_finishes_while_records_are_read_stays() -> None:
    """They were read before, and do not have it."""
    jobs = retention_of(pins := Pins())

    async def read() -> list[EndedJob]:
        jobs.add(EndedJob.of(finished_job()))
        return []

    await jobs.keep_up(read)
    assert pins == {"a result": 1}
    await jobs.keep_up(records_of())
    assert pins == {"a result": 0}


@pytest.mark.anyio
async def test_what_finished_before_the_start(clock: Clock, calendar: Calendar) -> None:
    """By the calendar one job is as old as it can be, one is younger, and one is yet to end."""
    moved = (timedelta(hours=-1), timedelta(minutes=-50), TEN_YEARS)
    ended = []
    for calendar.moved in moved:
        ended.append(finished_job())
    old, younger, to_come = ended
    calendar.moved = timedelta()

    jobs = retention_of(pins := Pins())
    await jobs.keep_up(records_of(*ended))
    await jobs.keep_up(records_of(*ended))
    assert pins == {"a result": 3}

    assert jobs.due() == [old.id]
    clock.now += 601
    assert jobs.due() == [old.id, younger.id]
    await jobs.keep_up(records_of(to_come))
    assert pins == {"a result": 1}
    clock.now += 2999
    assert jobs.due() == [to_come.id]


@pytest.mark.parametrize("moved", [TEN_YEARS, -TEN_YEARS])
def test_the_times_of_a_job_are_in_order(calendar: Calendar, moved: timedelta) -> None:
    accepted = finished_job().accepted_again()
    calendar.moved = moved
    running = accepted.running(0.0)
    assert running.started is not None
    assert accepted.created <= running.started
    calendar.moved = 2 * moved
    last = running.dismissed()
    assert last.finished is not None
    assert running.started <= last.finished
    assert last.finished.tzinfo is UTC
    assert isinstance(last.finished, datetime)

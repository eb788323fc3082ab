"""Finished jobs stay for their time, whatever happens to the clock."""

from datetime import UTC, datetime, timedelta

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


def finished_job(owner: str | None = None) -> Job:
    return new_job(owner).running(0.0).successful("a result")


def ids_due(jobs: Retention) -> list[str]:
    return [job.id for job in jobs.due()]


@pytest.mark.parametrize("moved", [TEN_YEARS, -TEN_YEARS])
def test_a_clock_that_is_moved_changes_nothing(
    clock: Clock, calendar: Calendar, moved: timedelta
) -> None:
    jobs = Retention(HOUR_S)
    before = finished_job()
    jobs.add(before)
    calendar.moved = moved
    clock.now += 600
    after = finished_job()
    jobs.add(after)

    assert jobs.seconds_to_first(None) == 3000
    clock.now += 2999
    assert ids_due(jobs) == []
    clock.now += 1
    assert ids_due(jobs) == [before.id]
    clock.now += 600
    assert ids_due(jobs) == [before.id, after.id]


def test_what_finished_before_the_start(clock: Clock, calendar: Calendar) -> None:
    """By the calendar one job is as old as it can be, one is younger, and one is yet to end."""
    moved = (timedelta(hours=-1), timedelta(minutes=-50), TEN_YEARS)
    ended = []
    for calendar.moved in moved:
        ended.append(finished_job())
    old, younger, to_come = ended
    calendar.moved = timedelta()

    jobs = Retention(HOUR_S)
    for job in ended:
        assert job.finished is not None
        jobs.add_older(EndedJob(job.id, None, job.result, job.finished))

    assert ids_due(jobs) == [old.id]
    clock.now += 601
    assert ids_due(jobs) == [old.id, younger.id]
    jobs.discard(old.id)
    jobs.discard(younger.id)
    assert jobs.seconds_to_first(None) == 2999
    clock.now += 2999
    assert ids_due(jobs) == [to_come.id]


def test_the_first_job_of_each_owner(clock: Clock) -> None:
    jobs = Retention(HOUR_S)
    assert jobs.seconds_to_first("alice") is None
    first = finished_job("alice")
    jobs.add(first)
    clock.now += 0.5
    for owner in ("alice", "bob", None):
        jobs.add(finished_job(owner))

    assert jobs.seconds_to_first("alice") == jobs.seconds_to_first("bob") == 3600
    clock.now += 100
    assert jobs.seconds_to_first("alice") == 3500
    assert jobs.seconds_to_first("carol") is None
    jobs.discard(first.id)
    assert jobs.seconds_to_first("alice") == 3500
    clock.now += 2 * HOUR_S
    assert jobs.seconds_to_first("alice") == 1, "it is about to be removed"


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

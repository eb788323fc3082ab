"""Retention of finished jobs: when each is to be removed.

Clocks may be moved by years, by a time server or a person. So the calendar says only how old jobs
are when the service starts; from then on a clock counts that nobody can set.
"""

from datetime import UTC, datetime
from math import ceil
from time import monotonic
from typing import NamedTuple

from app.jobs.job import EndedJob, Job


class FinishedJob(NamedTuple):
    """A finished job, as far as its removal needs it."""

    id: str
    owner: str | None
    result: str | None
    """Name of its answer in the result store"""
    due: float
    """Time of its removal, in seconds of `monotonic`"""


class Retention:
    """The finished jobs of a service, each for ``ttl_s`` seconds after its end."""

    def __init__(self, ttl_s: float) -> None:
        self._ttl_s = ttl_s
        self._finished: dict[str, FinishedJob] = {}

    def add(self, job: Job) -> None:
        """Add a job that has finished just now."""
        self._add(job.id, job.spec.owner, job.result, age_s=0.0)

    def add_older(self, job: EndedJob) -> None:
        """Add a job that finished before the service started, or at another replica.

        By the calendar its end may be to come: then its age is none.
        """
        age_s = max(0.0, (datetime.now(UTC) - job.finished).total_seconds())
        self._add(job.id, job.owner, job.result, age_s)

    def _add(self, job_id: str, owner: str | None, result: str | None, age_s: float) -> None:
        due = monotonic() + self._ttl_s - age_s
        self._finished[job_id] = FinishedJob(job_id, owner, result, due)

    def __contains__(self, job_id: str) -> bool:
        return job_id in self._finished

    @property
    def jobs(self) -> list[FinishedJob]:
        """All jobs."""
        return list(self._finished.values())

    def discard(self, job_id: str) -> bool:
        """Forget a job that has been removed; tell whether it was there."""
        return self._finished.pop(job_id, None) is not None

    def due(self) -> list[FinishedJob]:
        """Return the jobs that are to be removed by now."""
        now = monotonic()
        return [job for job in self._finished.values() if job.due <= now]

    def seconds_to_first(self, owner: str | None) -> int | None:
        """Return the seconds until a job of an owner is removed; None where none has finished."""
        first = min(
            (job.due for job in self._finished.values() if job.owner == owner), default=None
        )
        return None if first is None else max(1, ceil(first - monotonic()))

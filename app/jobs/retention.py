"""Retention of finished jobs: each keeps its answer in the store until it is removed.

Clocks may be moved by years, by a time server or a person. So the calendar says only how old jobs
are when they are first seen; from then on a clock counts that nobody can set.
"""

from collections.abc import Awaitable, Callable, Iterable
from datetime import UTC, datetime
from time import monotonic
from typing import NamedTuple

from app.jobs.job import EndedJob
from app.store.results import ResultStore


class _FinishedJob(NamedTuple):
    client: str
    result: str | None
    due: float
    """Time of its removal, in seconds of `monotonic`"""


class Retention:
    """The finished jobs that this process knows, each for ``ttl_s`` seconds after its end.

    Their answers are pinned in ``results``.
    """

    def __init__(self, results: ResultStore, ttl_s: float) -> None:
        self._results = results
        self._ttl_s = ttl_s
        self._finished: dict[str, _FinishedJob] = {}

    async def keep_up(self, read: Callable[[], Awaitable[Iterable[EndedJob]]]) -> None:
        """Note which of the recorded jobs have finished and still are there, as ``read`` tells.

        A job that finishes meanwhile may be missing there, and stays.
        """
        before = set(self._finished)
        found = {job.id: job for job in await read()}
        for job_id in before - found.keys():
            self.discard(job_id)
        for job in found.values():
            self.add(job)

    def add(self, job: EndedJob) -> None:
        """Note a job that has finished, and whose end is recorded.

        By the calendar its end may be to come: then its age is none.
        """
        if job.id in self._finished:
            return
        age_s = max(0.0, (datetime.now(UTC) - job.finished).total_seconds())
        due = monotonic() + self._ttl_s - age_s
        self._finished[job.id] = _FinishedJob(job.client, job.result, due)
        if job.result is not None:
            self._results.pin(job.result, job.client)

    def discard(self, job_id: str) -> None:
        """Forget a job that has been removed."""
        job = self._finished.pop(job_id, None)
        if job is not None and job.result is not None:
            self._results.unpin(job.result, job.client)

    def due(self) -> list[str]:
        """Return the ids of the jobs that are to be removed by now."""
        now = monotonic()
        return [job_id for job_id, job in self._finished.items() if job.due <= now]

"""The interface to the database of jobs: records outlive the process that wrote them."""

from typing import Protocol

from app.jobs.job import Job


class JobRepository(Protocol):
    """The records of jobs; pages begin with the newest.

    Every method raises ``OSError`` where the database cannot be read or written, with ``ENOSPC``
    where its disk is full, and ``EROFS`` where it can only be read. ``update`` and ``remove`` work
    on a full disk as well.
    """

    async def open(self) -> None:
        """Open the database, which is created if missing."""

    async def close(self) -> None:
        """Close the database."""

    async def add(self, job: Job, query: bytes) -> None:
        """Insert the record of a new job, and its query as JSON."""

    async def update(self, job: Job) -> None:
        """Replace the record of a job; the query of one that has finished is forgotten."""

    async def remove(self, job_id: str) -> None:
        """Remove the record of a job."""

    async def query(self, job_id: str) -> bytes | None:
        """Return the query of a job that has not finished; None where it was not stored."""

    async def find(self, owner: str | None, job_id: str) -> Job | None:
        """Return the job of an owner with this id; None where there is none."""

    async def find_by_key(self, owner: str | None, key: str) -> Job | None:
        """Return the newest job of an owner with this idempotency key; None where there is none."""

    async def page(
        self, owner: str | None, limit: int, before: int | None
    ) -> tuple[list[Job], int | None]:
        """Return ``limit`` jobs of an owner, and the number to go on before; None at the end."""

    async def count(self, owner: str | None) -> int:
        """Return the number of an owner's jobs."""

    async def count_finished(self) -> dict[str, int]:
        """Return the number of finished jobs by status."""

    async def unfinished(self) -> list[Job]:
        """Return the jobs that have not finished, the oldest first."""

    async def finished(self) -> list[Job]:
        """Return the jobs that have finished."""

"""The record of a job, from its acceptance to its end."""

from datetime import UTC, datetime
from typing import Any, NamedTuple
from uuid import uuid4

from pydantic import AliasChoices, BaseModel, ConfigDict, Field

from app.errors import Problem
from app.schemas.service import JobStatus


class JobSpec(BaseModel):
    """What a job is to do, but for its query, and who asked for it."""

    model_config = ConfigDict(frozen=True)

    kind: str
    """Kind of query, such as ``distances``"""
    mesh_id: str
    media_type: str
    """Media type of the answer"""
    dtype: str = "float64"
    """Of the numbers of the answer"""
    coding: str | None = None
    """Content coding of the answer"""
    client: str = ""
    """Name of the caller: callers take turns, and have a share of the room for answers"""
    fingerprint: str
    """Hash of the query and its representation"""
    idempotency_key: str | None = None
    """Key that the client chose: two requests with one key are one job"""
    request_id: str
    """Id of the request that submitted the job"""


class Job(BaseModel):
    """The state of a job; each change makes a new one."""

    model_config = ConfigDict(frozen=True, serialize_by_alias=True)

    id: str = Field(default_factory=lambda: uuid4().hex)
    spec: JobSpec = Field(
        validation_alias=AliasChoices("spec", "errand"), serialization_alias="errand"
    )
    """Stored as ``errand``, its name in this layout of the store"""
    status: JobStatus = "accepted"
    progress: float = 0.0
    version: int = 1
    """Greater than that of each state before"""
    runs: int = 0
    """Number of times that a worker has begun the job"""
    created: datetime = Field(default_factory=lambda: datetime.now(UTC))
    started: datetime | None = None
    finished: datetime | None = None
    problem: Problem | None = None
    """Reason of a failure"""
    result: str | None = None
    """Name of the answer in the result store"""

    @property
    def is_finished(self) -> bool:
        """Whether this is the last state."""
        return self.finished is not None

    def running(self, progress: float) -> "Job":
        """Return the state of a job that a worker has begun."""
        if self.started is None:
            begun = {"started": _now_after(self.created), "runs": self.runs + 1}
            return self._next(status="running", progress=progress, **begun)
        return self._next(progress=progress)

    def accepted_again(self) -> "Job":
        """Return the state of a job that was under way when the service ended."""
        return self._next(status="accepted", progress=0.0, started=None)

    def successful(self, result: str) -> "Job":
        """Return the state of a job with a result."""
        return self._finish(status="successful", progress=1.0, result=result)

    def failed(self, problem: Problem) -> "Job":
        """Return the state of a job that met a problem."""
        return self._finish(status="failed", problem=problem)

    def dismissed(self) -> "Job":
        """Return the state of a job that was cancelled, even if it had an answer."""
        return self._finish(status="dismissed", result=None)

    def _finish(self, **changes: Any) -> "Job":
        return self._next(**changes, finished=_now_after(self.started or self.created))

    def _next(self, **changes: Any) -> "Job":
        return self.model_copy(update={"version": self.version + 1, **changes})


class EndedJob(NamedTuple):
    """A finished job, as far as its retention needs it; any release can read that."""

    id: str
    client: str
    result: str | None
    """Name of its answer in the result store"""
    finished: datetime

    @classmethod
    def of(cls, job: Job) -> "EndedJob":
        """Return that of a job which has finished."""
        assert job.finished is not None, "it has finished"  # noqa: S101
        return cls(job.id, job.spec.client, job.result, job.finished)


def _now_after(earlier: datetime) -> datetime:
    """Return the time, or that of what came before, where the clock was set back since."""
    return max(earlier, datetime.now(UTC))

"""What is known of a job."""

from datetime import UTC, datetime
from typing import Any, Literal
from uuid import uuid4

from pydantic import BaseModel, ConfigDict, Field

from app.errors import Problem

Status = Literal["accepted", "running", "successful", "failed", "dismissed"]


class JobSpec(BaseModel):
    """What a job is to do, and for whom."""

    model_config = ConfigDict(frozen=True)

    owner: str | None
    """Whose it is: nobody else sees it; None without keys"""
    kind: str
    """Of question, such as ``distances``"""
    mesh_id: str
    media_type: str
    """Of the answer"""
    fingerprint: str
    """The same for the same question, and for no other"""
    idempotency_key: str | None = None
    """Of the owner's choice: two errands with one key are one job"""
    request_id: str
    """Of the request that brought it"""


class Job(BaseModel):
    """The state of a job; each change makes a new one."""

    model_config = ConfigDict(frozen=True)

    id: str = Field(default_factory=lambda: uuid4().hex)
    errand: JobSpec
    status: Status = "accepted"
    progress: float = 0.0
    version: int = 1
    """How many states there have been with this one"""
    created: datetime = Field(default_factory=lambda: datetime.now(UTC))
    started: datetime | None = None
    finished: datetime | None = None
    problem: Problem | None = None
    """Why it failed"""
    result: str | None = None
    """The name of its answer in the result store"""

    @property
    def is_finished(self) -> bool:
        """Whether nothing more will become of it."""
        return self.finished is not None

    def having(self, **changes: Any) -> "Job":
        """Return the next state."""
        return self.model_copy(update={"version": self.version + 1, **changes})

    def running(self, progress: float) -> "Job":
        """Return the state once work on it has begun."""
        started = self.started or datetime.now(UTC)
        return self.having(status="running", started=started, progress=progress)

    def successful(self, result: str) -> "Job":
        """Return the state once it is answered."""
        return self.having(status="successful", progress=1.0, result=result, **_ended())

    def failed(self, problem: Problem) -> "Job":
        """Return the state once there will be no answer."""
        return self.having(status="failed", problem=problem, **_ended())

    def dismissed(self) -> "Job":
        """Return the state once it has been cancelled."""
        return self.having(status="dismissed", **_ended())


def _ended() -> dict[str, Any]:
    return {"finished": datetime.now(UTC)}

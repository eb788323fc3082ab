"""Jobs, problems, health, and the offers of the service."""

from typing import Literal

from pydantic import BaseModel, Field

from app.schemas.requests import Method

JobStatus = Literal["accepted", "running", "successful", "failed", "dismissed"]


class FaultDocument(BaseModel):
    """One element of the request that is wrong."""

    pointer: str = Field(description="JSON pointer into the body, or `/query/…`, `/header/…`")
    message: str


class ProblemDocument(BaseModel):
    """An error, as defined by RFC 9457."""

    type: str
    title: str
    status: int
    detail: str
    instance: str
    code: str
    request_id: str
    errors: list[FaultDocument] | None = None
    limit: float | None = None
    actual: float | None = None
    setting: str | None = Field(default=None, description="The limit, as in `limits` of `/v1`")
    hint: str | None = None


class JobDocument(BaseModel):
    """A query that is answered in the background."""

    id: str
    kind: str = Field(description="Kind of the query, such as `distances`")
    mesh_id: str
    status: JobStatus
    progress: float = Field(description="Share of the work that is done, 0 to 1")
    created: str = Field(description="When the job was created, RFC 3339 as all times")
    started: str | None = Field(default=None, description="When a worker began the job")
    finished: str | None = None
    problem: ProblemDocument | None = Field(default=None, description="The problem of a failed job")
    links: dict[str, str] = Field(description="Paths of itself, its results and its events")


class JobList(BaseModel):
    """A part of the jobs, the newest first."""

    jobs: list[JobDocument]
    next_cursor: str | None = None


class Health(BaseModel):
    """State of the service."""

    status: Literal["ok"]


class Index(BaseModel):
    """Links to the parts of the service."""

    service: str
    version: str
    page: str = Field(description="Whether this address has a page for browsers")
    links: dict[str, str]


class About(BaseModel):
    """Version, formats and the limits in force."""

    version: str
    methods: list[Method]
    mesh_formats: list[str]
    answer_formats: dict[str, str]
    samples: list[str]
    limits: dict[str, int | float] = Field(description="Each limit, by its name")


class ProblemCode(BaseModel):
    """Meaning of an error code."""

    code: str
    status: int
    other_statuses: list[int] = Field(description="Further statuses; `meaning` says when")
    title: str
    meaning: str
    chapter: str = Field(
        description="Chapter of the documents that tells more: `geodesic docs CHAPTER` opens it"
    )

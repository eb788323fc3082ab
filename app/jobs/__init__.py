"""Jobs: queries that outlive their request, and their records in SQLite."""

from app.jobs.job import Job, JobSpec
from app.jobs.manager import JobManager
from app.jobs.repository import JobRepository
from app.jobs.sqlite_repository import (
    SqliteJobRepository,
    prepare_database,
    read_jobs,
    require_intact,
)

__all__ = [
    "Job",
    "JobManager",
    "JobRepository",
    "JobSpec",
    "SqliteJobRepository",
    "prepare_database",
    "read_jobs",
    "require_intact",
]

"""Jobs: queries that outlive their request, and their records in a database."""

from app.jobs.job import Job, JobSpec
from app.jobs.manager import JobManager
from app.jobs.repository import JobRepository, read_jobs
from app.jobs.retention import Retention
from app.jobs.runner import JobRunner

__all__ = [
    "Job",
    "JobManager",
    "JobRepository",
    "JobRunner",
    "JobSpec",
    "Retention",
    "read_jobs",
]

"""Jobs: queries that outlive their request, and their records in a database."""

from app.jobs.job import Job, JobSpec
from app.jobs.manager import JobManager
from app.jobs.repository import JobRepository, read_jobs, read_shared_jobs

__all__ = ["Job", "JobManager", "JobRepository", "JobSpec", "read_jobs", "read_shared_jobs"]

"""Long work that outlives its request: jobs, and the book that their records are kept in."""

from app.jobs.job import Job, JobSpec
from app.jobs.manager import Jobs
from app.jobs.repository import JobRepository, read_book, require_whole

__all__ = ["Job", "JobRepository", "JobSpec", "Jobs", "read_book", "require_whole"]

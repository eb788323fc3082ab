"""Long work that outlives its request: jobs, and the book that their records are kept in."""

from app.jobs.job import Errand, Job
from app.jobs.manager import Jobs
from app.jobs.repository import JobBook, read_book, require_whole

__all__ = ["Errand", "Job", "JobBook", "Jobs", "read_book", "require_whole"]

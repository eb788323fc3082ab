"""Long work that outlives its request: jobs, and the book that their records are kept in."""

from app.jobs.book import JobBook, read_book, require_whole
from app.jobs.jobs import Jobs
from app.jobs.record import Errand, Job

__all__ = ["Errand", "Job", "JobBook", "Jobs", "read_book", "require_whole"]

"""Exceptions that end a request: each becomes a problem, and a line in the log."""

import structlog

from app.errors import Problem, ProblemError, problem_of

logger = structlog.get_logger(module=__name__)

CLIENT_CLOSED = 499
"""The status, in log and metrics alone, of a request whose client hung up: no client reads it."""


def note_failure(error: Exception) -> Problem:
    """Log an exception, unless the client is its cause; return its problem.

    Only defects have a traceback in the log: while a store or a database is unavailable, each
    request would add the same one.
    """
    problem = problem_of(error)
    if problem.code == "internal_error":
        logger.error("request failed", exc_info=error)
    elif not isinstance(error, ProblemError):
        logger.warning("request failed", code=problem.code, error=str(error))
    return problem

"""Log lines as their fields, before they are written."""

from collections.abc import Iterator, MutableMapping
from typing import Any

import pytest
import structlog
from structlog.testing import capture_logs

Log = list[MutableMapping[str, Any]]

# By default structlog draws all local variables of a traceback, which took up to 15 s of a test.
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback),
    ]
)


@pytest.fixture
def log() -> Iterator[Log]:
    """Grows with each line that this process logs."""
    with capture_logs() as lines:
        yield lines

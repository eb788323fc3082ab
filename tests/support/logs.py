"""Log lines as their fields, before they are written."""

from collections.abc import Iterator, MutableMapping
from typing import Any

import pytest
from structlog.testing import capture_logs

Log = list[MutableMapping[str, Any]]


@pytest.fixture
def log() -> Iterator[Log]:
    """Grows with each line that this process logs."""
    with capture_logs() as lines:
        yield lines

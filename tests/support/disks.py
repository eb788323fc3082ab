"""A disk that is full."""

from pathlib import Path
from typing import Any

import pytest


def fill_disk(patch: pytest.MonkeyPatch, name: str) -> None:
    """Have all files of a name, which may be a pattern, written to a device that is full."""
    open_file = Path.open

    def open_on_full_disk(path: Path, *args: Any, **options: Any) -> Any:
        return open_file(Path("/dev/full") if path.match(name) else path, *args, **options)

    patch.setattr(Path, "open", open_on_full_disk)

"""Disks that are full, and disks of one's own."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import ROOT


def fill_disk(patch: pytest.MonkeyPatch, name: str) -> None:
    """Have all files of a name, which may be a pattern, written to a device that is full."""
    open_file = Path.open

    def open_on_full_disk(path: Path, *args: Any, **options: Any) -> Any:
        return open_file(Path("/dev/full") if path.match(name) else path, *args, **options)

    patch.setattr(Path, "open", open_on_full_disk)


def run_on_own_disk(command: str, megabytes: int = 16) -> subprocess.CompletedProcess[str]:
    """Run a command where ``/mnt`` is a disk in memory that no one else sees; or skip the test."""
    if shutil.which("unshare") is None or _run_on_own_disk("true", 1).returncode:
        pytest.skip("this system lets nobody mount a disk of their own")
    return _run_on_own_disk(command, megabytes)


def _run_on_own_disk(command: str, megabytes: int) -> subprocess.CompletedProcess[str]:
    script = f"mount -t tmpfs -o size={megabytes}m none /mnt && exec {command}"
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603 - our own command

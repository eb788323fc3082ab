"""Python in a process of its own, which has imported nothing yet."""

import subprocess
import sys

from tests.support.paths import ROOT


def told_by(script: str) -> str:
    """Return what a script prints; it imports this checkout."""
    ran = subprocess.run(  # noqa: S603 - this Python, and our own script
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return ran.stdout

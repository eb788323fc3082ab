"""The ``geodesic`` command: serve, and the library's answers as files.

What is slow to import (the kernels, the server) is imported by the command that needs it.
"""

from app.cli.program import main

__all__ = ["main"]

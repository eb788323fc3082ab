"""The ``geodesic`` command: it runs the service, and writes answers of queries into files.

Slow imports (the kernels, the server) are in the commands that need them.
"""

from app.cli.program import main

__all__ = ["main"]

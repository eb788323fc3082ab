"""A limit of memory for this process, which the kernel keeps to."""

import resource
from pathlib import Path

_STATUS = Path("/proc/self/status")


def limit_memory(allowed: int) -> None:
    """Grant this process ``allowed`` bytes beyond what it has now; then allocating fails.

    Counted is what it has for itself (RLIMIT_DATA), not what it maps, such as meshes. Linux alone
    counts so: elsewhere there is no limit.
    """
    if not _STATUS.is_file():
        return
    held = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmData:"))
    limit = int(held.split()[1]) * 1024 + allowed
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))

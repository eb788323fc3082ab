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
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    limit = _held() + allowed
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def refuse_beyond_limit(needed: int) -> None:
    """Raise ``MemoryError`` where ``needed`` bytes more exceed the limit.

    For the sake of libraries that crash where allocating fails.
    """
    limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if limit != resource.RLIM_INFINITY and _held() + needed > limit:
        raise MemoryError(f"{needed} bytes more exceed the limit of {limit}")


def _held() -> int:
    lines = _STATUS.read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmData:")).split()[1])

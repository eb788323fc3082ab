"""The memory limit of this process, enforced by the operating system."""

import resource
from pathlib import Path

_STATUS = Path("/proc/self/status")


def limit_memory(allowed: int) -> None:
    """Limit this process to ``allowed`` bytes beyond its present memory.

    The limit (RLIMIT_DATA) counts private memory, not maps such as those of meshes. Only Linux
    counts that way: elsewhere there is no limit.
    """
    if not _STATUS.is_file():
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    limit = _private_bytes() + allowed
    if hard != resource.RLIM_INFINITY:
        limit = min(limit, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def refuse_beyond_limit(needed: int) -> None:
    """Raise ``MemoryError`` where ``needed`` bytes more exceed the limit.

    Call it before libraries that crash when an allocation fails.
    """
    limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if limit != resource.RLIM_INFINITY and _private_bytes() + needed > limit:
        raise MemoryError(f"{needed} bytes more exceed the limit of {limit}")


def _private_bytes() -> int:
    lines = _STATUS.read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmData:")).split()[1])

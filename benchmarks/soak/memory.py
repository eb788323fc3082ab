"""Memory of a service, process by process."""

import re
from collections.abc import Mapping
from pathlib import Path

from psutil import NoSuchProcess, Process

KINDS = {
    "geodesic-worker": "worker",
    "forkserver": "fork server",
    "resource_tracker": "resource tracker",
    "run_shared": "compiler",
}
"""Kinds of processes by a text in their command lines"""


def memory_by_process(service: int) -> Mapping[str, int]:
    """Return the bytes of each process of a service; pages that several share count in parts.

    Only anonymous memory counts. Pages of mapped files, which the meshes are, belong to the
    system's cache: psutil's PSS has them too, and its USS those that only one process maps.
    """
    api = Process(service)
    found, seen = {"API": anonymous(service)}, dict.fromkeys(KINDS.values(), 0)
    for process in sorted(api.children(recursive=True), key=lambda process: process.pid):
        try:
            command = " ".join(process.cmdline())
            kind = next((kind for text, kind in KINDS.items() if text in command), "other")
            seen[kind] = seen.get(kind, 0) + 1
            found[f"{kind} {seen[kind]}"] = anonymous(process.pid)
        except (NoSuchProcess, FileNotFoundError, ProcessLookupError):
            continue  # it has just ended
    return found


def anonymous(pid: int) -> int:
    """Return the bytes of anonymous memory of a process; of shared pages, its part."""
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text()
    sizes = re.findall(r"^(?:Pss_Anon|Pss_Shmem|SwapPss): +(\d+) kB", rollup, re.MULTILINE)
    return 1024 * sum(map(int, sizes))

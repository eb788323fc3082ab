"""Hide the processes of other machines: all share one table, in which Ray looks for its own.

Python imports this when it starts on a machine of ``tests.support.machines``.
"""

import os
from pathlib import Path
from typing import Any

_listdir: Any = os.listdir
_OURS = Path("/proc/self/ns/net").readlink()


def _is_elsewhere(pid: str | bytes) -> bool:
    try:
        return Path(f"/proc/{int(pid)}/ns/net").readlink() != _OURS
    except OSError:  # it has ended
        return False


def _own_processes(path: Any = ".") -> Any:
    names = _listdir(path)
    if path not in ("/proc", b"/proc"):
        return names
    return [name for name in names if not (name.isdigit() and _is_elsewhere(name))]


os.listdir = _own_processes

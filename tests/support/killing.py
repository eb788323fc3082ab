"""Processes that are killed before the n-th change of files in a folder, or of records of jobs.

Python tells audit hooks of each change of a file before it is made. What SQLite does itself is told
by SQLAlchemy: there is a step before and after each statement that changes something, and one
before its commit.
"""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, event

_CHANGES = frozenset({"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.utime", "os.truncate"})
_WRITING = os.O_WRONLY | os.O_RDWR


class Killer:
    """Kills this process at a step, once `arm` was called; alone in its process."""

    def __init__(self) -> None:
        self._folder: str | None = None
        self._left = 0
        sys.addaudithook(self._hear)  # it cannot be removed
        event.listen(Engine, "before_cursor_execute", self._begin_change)
        event.listen(Engine, "after_cursor_execute", self._begin_change)
        event.listen(Engine, "commit", self._begin_commit)

    def _begin_change(
        self, connection: Connection, _: object, statement: str, *_more: object
    ) -> None:
        if not statement.startswith(("SELECT", "PRAGMA")):
            connection.info["has_changed"] = True
            self.step()

    def _begin_commit(self, connection: Connection) -> None:
        if connection.info.pop("has_changed", False):
            self.step()

    def arm(self, folder: Path, steps: int) -> None:
        """Have the process killed before a change of files in ``folder``, the ``steps``-th."""
        self._folder, self._left = f"{folder}/", steps

    def step(self) -> None:
        if self._folder is not None:
            self._left -= 1
            if self._left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    def _hear(self, event: str, args: tuple[Any, ...]) -> None:
        if self._folder is None or not (event in _CHANGES or event == "open"):
            return
        if event == "open" and not int(args[2] or 0) & _WRITING:
            return
        if str(args[0]).startswith(self._folder):
            self.step()


def in_child(do: Callable[[], object]) -> int:
    """Do something in a forked process; return its exit code, or the negative signal."""
    pid = os.fork()
    if not pid:
        try:
            do()
        except BaseException:  # noqa: BLE001 - whatever it is, the child ends here
            sys.excepthook(*sys.exc_info())
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])

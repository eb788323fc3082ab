"""The interface between the service and whatever computes its answers."""

from collections.abc import Callable, Collection, Coroutine, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from app.engine.work import Task, TaskResult

ProgressCallback = Callable[[float], None]
"""Receives the share of the work that is done: 0 when it begins, and where it is begun once more"""


UnclaimedCallback = Callable[[str], Coroutine[Any, Any, None]]
"""Receives the name of a result that was written although nobody waits for it any longer"""


async def ignore_unclaimed(name: str) -> None:
    """Leave a result where it is, uncounted."""


@dataclass(frozen=True)
class Load:
    """The state of an engine, and totals since its start."""

    waiting: int
    """Tasks in the queue"""
    idle: int
    """Workers without a task"""
    busy: int
    """Workers with a task"""
    missing: int
    """Slots without a worker: it is being started, or replaced"""
    lost: int
    """Workers so far that died or were killed"""
    cancelled: int
    """Tasks so far that were stopped because nobody waited for them any longer"""
    evictions: Mapping[str, int]
    """Values that workers have dropped so far to make room, by cache"""
    pids: Collection[int]
    """Ids of the worker processes"""


class Engine(Protocol):
    """Runs tasks outside the process that serves requests."""

    on_wait: Callable[[float], None]
    """Receives the seconds that a task has waited for a worker, whether it got one or gave up"""
    on_work: Callable[[str, float], None]
    """Receives the client of a task and the seconds that a worker was busy with it"""
    on_unclaimed: UnclaimedCallback
    """Receives results of tasks that were cancelled too late to stop their work"""

    @property
    def load(self) -> Load:
        """The present state, and totals."""

    @property
    def is_ready(self) -> bool:
        """Whether a new task would begin at once, or as soon as others end."""

    @property
    def is_draining(self) -> bool:
        """Whether new tasks are refused because the engine is about to stop."""

    async def start(self) -> None:
        """Begin to get ready; returns at once."""

    def drain(self) -> None:
        """Refuse new tasks from now on; those that run or wait go on."""

    async def stop(self) -> None:
        """End all tasks."""

    def refuse_when_full(self, client: str) -> None:
        """Raise the error of ``run`` where a client's task would have to wait without room."""

    async def run(self, task: Task, on_progress: ProgressCallback) -> TaskResult:
        """Do the work of a task; cancel the call to stop it.

        Raises
        ------
        ProblemError
            The work was refused or failed, the queue is full, or no worker can be started.
        """

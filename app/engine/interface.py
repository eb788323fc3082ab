"""What the service expects of whatever computes its answers."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from app.engine.work import Task, TaskResult

ProgressCallback = Callable[[float], None]
"""Is told which share of some work is done: 0 when it begins, never less than before."""


@dataclass(frozen=True)
class Load:
    """What an engine is doing, and what became of workers and work since it began."""

    waiting: int
    """Orders in the queue"""
    idle: int
    busy: int
    missing: int
    """Places without a worker: it is being started, or replaced"""
    lost: int
    """Workers that died, or were killed, so far"""
    cancelled: int
    """Work so far that was stopped since nobody waited for it any longer"""


class Engine(Protocol):
    """Runs work elsewhere than in the process that serves requests."""

    @property
    def load(self) -> Load:
        """What it is doing."""

    @property
    def is_ready(self) -> bool:
        """Whether work would begin now, or as soon as other work is done."""

    @property
    def is_draining(self) -> bool:
        """Whether new work is refused, since the engine is about to stop."""

    async def start(self) -> None:
        """Begin to get ready; returns at once."""

    def drain(self) -> None:
        """Refuse new work from now on; what runs or waits goes on."""

    async def stop(self) -> None:
        """End all work."""

    def refuse_when_full(self, client: str) -> None:
        """Raise what ``run`` would, did the work of a client have to wait, and had no room to."""

    async def run(self, order: Task, told: ProgressCallback) -> TaskResult:
        """Do the work of an order; cancel the call to stop it.

        Raises
        ------
        ProblemError
            The work was refused or failed, the queue is full, or nothing can run it.
        """

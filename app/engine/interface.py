"""What the service expects of whatever computes its answers."""

from typing import Protocol

from app.engine.work import Done, Work


class Engine(Protocol):
    """Runs work elsewhere than in the process that serves requests."""

    @property
    def is_ready(self) -> bool:
        """Whether work would begin now, or as soon as other work is done."""

    async def start(self) -> None:
        """Begin to get ready; returns at once."""

    async def stop(self) -> None:
        """End all work."""

    async def run(self, work: Work, mesh_id: str | None = None) -> Done:
        """Do ``work``, best where the mesh is open already; cancel the call to stop the work.

        Raises
        ------
        ProblemError
            The work was refused or failed, the queue is full, or nothing can run it.
        """

"""The interface to a store: a folder, or objects that several machines reach by URL."""

from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from pathlib import Path
from typing import Protocol

from app.store.mesh_home import MeshHome
from app.store.meshes import WrittenMesh
from app.store.ownership import Share
from app.store.results import Result, ResultFiles


class Store(Protocol):
    """Where meshes and answers are stored."""

    @property
    def meshes(self) -> MeshHome:
        """The meshes."""

    @property
    def results(self) -> ResultFiles:
        """The results."""

    @property
    def supply(self) -> "Supply | None":
        """What workers need besides their folder; None where that is the store."""

    def owned(self, *, is_shared: bool) -> AbstractContextManager[Share | None]:
        """Own the folder inside the block, or share it with services that share a database.

        Raises ``StoreError`` where that cannot be.
        """

    def claim(self, service: str | None) -> None:
        """Mark the store as that of a service, or of several that share a database of this name.

        Raises ``StoreError`` where it is that of another, or cannot be used.
        """

    def identity(self) -> str:
        """Return an id that no other store has, and that all machines see.

        Raises ``StoreError`` where there is no store yet.
        """

    def lent(self, file: Path) -> AbstractAsyncContextManager[None]:
        """Have all machines reach a file of the folder inside the block."""


class Supply(Protocol):
    """Brings what work needs to the folder of this machine, and takes away what it made."""

    def owned(self) -> AbstractContextManager[None]:
        """Own the folder inside the block; raises ``StoreError`` where the store is not usable."""

    def holding(self, mesh_id: str) -> AbstractAsyncContextManager[None]:
        """Have a mesh in the folder inside the block."""

    def bringing(self, file: Path | None, folder: Path) -> AbstractAsyncContextManager[None]:
        """Have a lent file, if any, and the parent of a folder to come, inside the block."""

    def bringing_results(self, names: Sequence[str]) -> AbstractAsyncContextManager[None]:
        """Have the bodies of some results in the folder inside the block."""

    async def send_mesh(self, written: WrittenMesh) -> bool:
        """Send the files of a mesh; False where it is to be written again."""

    async def send_result(self, result: Result) -> None:
        """Send the files of a result."""

    def discard_result(self, name: str) -> None:
        """Remove the files of a result here, if there are any."""

    async def distrust(self, mesh_id: str) -> None:
        """Pull a mesh again before it is used."""

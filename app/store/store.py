"""The store in a folder: what all machines share, they share through its file system."""

from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AbstractContextManager,
    asynccontextmanager,
    contextmanager,
)
from pathlib import Path
from typing import Protocol

from app.settings import variable_of
from app.store.folder import Folder
from app.store.layout import StoreError, make_identity, note_state, noted_state
from app.store.mesh_home import MeshHome
from app.store.meshes import MeshStore, WrittenMesh
from app.store.ownership import Share, owned
from app.store.results import Result, ResultFiles


class Supply(Protocol):
    """Brings what work needs to the folder of this machine, and takes away what it made."""

    def owned(self) -> AbstractContextManager[Share]:
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

    async def drop_copy(self, mesh_id: str) -> None:
        """Pull a mesh again before it is used."""


class Store:
    """Where meshes and answers are stored: here in ``folder``; a subclass has them elsewhere."""

    meshes: MeshHome
    results: ResultFiles
    supply: Supply | None = None
    """What workers need besides their folder; None where that is the store"""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files = Folder(folder)
        self.meshes = MeshHome(self._files, MeshStore(folder))
        self.results = ResultFiles(self._files)
        self._is_first = True

    @contextmanager
    def owned(self, *, is_shared: bool = False) -> Iterator[Share]:
        """Own the folder inside the block, or share it with services that share a database.

        Raises ``StoreError`` where that cannot be.
        """
        with owned(self.folder, is_shared=is_shared) as share:
            self._files.is_alone = self._is_first = share.is_first
            yield share

    def claim(self, service: str | None) -> None:
        """Note which database has the jobs; refuse one other than that of services in the folder.

        The lock keeps away a service that does not share the folder. Raises ``StoreError`` where
        the store is that of another service, or cannot be used.
        """
        if not self._is_first and service != noted_state(self.folder):
            raise StoreError(
                f"the store {self.folder} is in use by services with another database: give this "
                f"one the same {variable_of('state')}, or a store of its own"
            )
        note_state(self.folder, service)

    def identity(self) -> str:
        """Return an id that no other store has, and that all machines see.

        They may have mounted the folder at different paths. Raises ``StoreError`` where there is no
        store yet.
        """
        if not self.folder.is_dir():
            raise StoreError(
                f"there is no store at {self.folder}: start geodesic serve on it first, and give "
                "the same shared folder on all machines as --store"
            )
        return make_identity(self.folder)

    @asynccontextmanager
    async def lent(self, file: Path) -> AsyncIterator[None]:  # noqa: ARG002 - it is there
        """Have all machines reach a file of the folder inside the block."""
        yield

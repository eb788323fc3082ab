"""The store in a folder: what all machines share, they share through its file system."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

from app.settings import variable_of
from app.store.folder_meshes import FolderMeshes
from app.store.layout import (
    RESULTS,
    StoreError,
    make_identity,
    note_state,
    noted_state,
)
from app.store.ownership import Share, owned, shared
from app.store.results import FolderResults


class FolderStore:
    """The store in ``folder``; see ``Store``."""

    supply = None

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.meshes = FolderMeshes(folder)
        self.results = FolderResults(folder / RESULTS)
        self._share: Share | None = None

    @contextmanager
    def owned(self, *, is_shared: bool) -> Iterator[Share | None]:
        """Lock the folder."""
        with shared(self.folder) if is_shared else owned(self.folder) as self._share:
            yield self._share

    def claim(self, service: str | None) -> None:
        """Note which database has the jobs; refuse one other than that of services in the folder.

        The lock keeps away a service that does not share the folder.
        """
        is_alone = self._share is None or self._share.is_first
        if not is_alone and service != noted_state(self.folder):
            raise StoreError(
                f"the store {self.folder} is in use by services with another database: give this "
                f"one the same {variable_of('state')}, or a store of its own"
            )
        note_state(self.folder, service)

    def identity(self) -> str:
        """Return the id in the folder, which machines may have mounted at different paths."""
        if not self.folder.is_dir():
            raise StoreError(
                f"there is no store at {self.folder}: start geodesic serve on it first, and give "
                "the same shared folder on all machines as --store"
            )
        return make_identity(self.folder)

    @asynccontextmanager
    async def lent(self, file: Path) -> AsyncIterator[None]:  # noqa: ARG002 - it is there
        """Do nothing: all machines reach the folder."""
        yield

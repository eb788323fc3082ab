"""The store in a folder: what all machines share, they share through its file system."""

from collections.abc import AsyncIterator
from contextlib import AbstractContextManager, asynccontextmanager
from pathlib import Path

from app.store.folder_meshes import FolderMeshes
from app.store.layout import RESULTS, StoreError, note_state
from app.store.ownership import Share, owned, shared
from app.store.results import FolderResults


class FolderStore:
    """The store in ``folder``; see ``Store``."""

    supply = None

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.meshes = FolderMeshes(folder)
        self.results = FolderResults(folder / RESULTS)

    def owned(self, *, is_shared: bool) -> AbstractContextManager[Share | None]:
        """Lock the folder."""
        return shared(self.folder) if is_shared else owned(self.folder)

    def claim(self, service: str | None) -> None:
        """Note for `app.service.maintenance` where the jobs are; the lock keeps others away."""
        note_state(self.folder, service)

    def require_claimed(self) -> None:
        """Raise ``StoreError`` where the folder is missing: a service makes it."""
        if not self.folder.is_dir():
            raise StoreError(
                f"there is no store at {self.folder}: start geodesic serve on it first, and give "
                "the same shared folder on all machines as --store"
            )

    @asynccontextmanager
    async def lent(self, file: Path) -> AsyncIterator[None]:  # noqa: ARG002 - it is there
        """Do nothing: all machines reach the folder."""
        yield

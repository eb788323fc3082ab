"""Objects: the files of a store by name, in a folder or in an object store.

::

    meshes/{id}/manifest.json               written last: it makes the mesh be there
    meshes/{id}/{array}.npy                 its arrays, in a folder
    meshes/{id}/{place}/{array}.npy         those of one upload of it, in an object store
    results/{mesh id}/{key}.json            the manifest of a result, written last as well
    results/{mesh id}/{key}.body            its body, in a folder
    results/{mesh id}/{key}.{sum}.body      the same in an object store, by checksum and size
    owner.json                              the service that an object store belongs to
    uploads/…                               files on their way to the machine that reads them

Nothing is there before its manifest, and nobody changes an object that a manifest names. So whoever
has read a manifest has all of one upload, or learns that it is gone. A folder has no places: there,
meshes come and go one at a time.
"""

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

UPLOADS = "uploads"

ABANDONED_S = 86_400.0
"""Age of an object that no manifest names: nobody is about to write that manifest any more"""


class ObjectInfo(NamedTuple):
    """An object in a listing."""

    name: str
    size: int
    modified: float
    """Seconds since 1970; of a manifest in a folder, the time of its last use"""
    is_abandoned: bool
    """Whether whoever wrote it has ended that long ago"""


class RemoteFile(Protocol):
    """A file that is elsewhere."""

    async def seek(self, offset: int) -> object:
        """Go on at an offset."""

    async def read(self, size: int) -> bytes:
        """Return the next bytes: as many, or fewer at the end."""

    async def aclose(self) -> None:
        """End the use of the file."""


class RemoteBody(Protocol):
    """A body that is elsewhere: it is read while it is sent, and verified meanwhile."""

    size: int

    async def open(self) -> RemoteFile:
        """Open the body for reading."""


class Objects(Protocol):
    """Objects by name: `Folder` or `Bucket`. All methods may block."""

    is_local: bool
    """Whether they are the files that workers write and map"""

    def write(self, name: str, content: bytes | Path) -> None:
        """Write an object over any that is there; a file is moved here, where that is possible."""

    def replace(self, name: str, content: bytes) -> bytes | None:
        """Write a small object; return what was there before, if anything else was."""

    def read(self, name: str) -> bytes | None:
        """Return the content of a small object; None where there is none."""

    def size(self, name: str) -> int | None:
        """Return the size of an object; None where there is none."""

    def checksum(self, name: str) -> int | None:
        """Return the CRC-32 of an object; None where there is none, or it cannot be read."""

    def found(self, folder: str) -> Iterator[ObjectInfo]:
        """Yield the objects in a folder and those below it, the least recently used first."""

    def folders(self, folder: str) -> Collection[str]:
        """Return the names of the folders in a folder."""

    def remove(self, *names: str) -> None:
        """Remove objects, those that are there."""

    def soon(self, remove: Callable[[str], None], name: str) -> None:
        """Have something removed: at once, where that takes no time, or in the background."""

    def note_use(self, name: str) -> None:
        """Mark a manifest as used, as far as the next start is to know."""

    def body(
        self, name: str, size: int, crc32: int, on_damage: Callable[[], None]
    ) -> Path | RemoteBody:
        """Return an object of this size and checksum, to be sent."""

"""Objects: files in an object store, which all machines of a service reach.

::

    owner.json                              which service the store belongs to
    meshes/{id}/manifest.json               written last: it makes the mesh be there
    meshes/{id}/{place}/{array}.npy         the arrays of one upload of the mesh
    results/{mesh id}/{key}.json            the manifest of a result, written last as well
    results/{mesh id}/{key}.{sum}.body      its body, by checksum and size
    uploads/…                               files on their way to the machine that reads them

Nothing is there before its manifest, and nobody changes an object that a manifest names. So whoever
has read a manifest has all of one upload, or learns that it is gone.
"""

import asyncio
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import from_url

from app.errors import StoreUnavailableError

if TYPE_CHECKING:
    from obstore.store import ClientConfig, RetryConfig

UPLOADS = "uploads"

_CLIENT: "ClientConfig" = {
    "connect_timeout": "2s",
    "read_timeout": "4s",
    "timeout": "30s",
    "allow_http": True,  # for an endpoint whose URL says so
}
_RETRIES: "RetryConfig" = {
    "max_retries": 10,
    "retry_timeout": timedelta(seconds=4),
    "backoff": {"init_backoff": timedelta(milliseconds=50), "max_backoff": timedelta(seconds=1)},
}
"""A store that is away is an error after some 6 s, the longest read included"""
_CHUNK = 2**23
"""Bytes of one request, which has ``timeout`` for them"""
_PATIENT: "ClientConfig" = {**_CLIENT, "read_timeout": "60s", "timeout": "120s"}
"""For writing: the time counts while a part is sent, and while the store puts the parts together"""
_PARTS_AT_ONCE = 4
"""Parts of an object on their way at the same time: the store has time for other requests"""
_PROBE_S = 3.0
"""Seconds of a write after which the store is asked whether it is still there"""
_ABANDONED = timedelta(days=1)
"""Age of an object that no manifest names: nobody is about to write that manifest any more"""


class ObjectInfo(NamedTuple):
    """An object in a listing."""

    name: str
    size: int
    is_old: bool
    """Whether whoever wrote it has ended that long ago"""


class Objects:
    """The objects below a URL such as ``s3://bucket/prefix``.

    All methods raise ``StoreUnavailableError`` where the store does not answer, after some retries.
    """

    def __init__(self, store: Any, patient: Any = None) -> None:
        self._store = store
        self._patient = patient or store

    @classmethod
    def at(cls, url: str) -> "Objects":
        """Return the objects at a URL; raises ``ValueError`` where it is none of an object store.

        Credentials and endpoints are those of the environment, such as ``AWS_ENDPOINT_URL``.
        """
        try:
            return cls(
                from_url(url, client_options=_CLIENT, retry_config=_RETRIES),
                from_url(url, client_options=_PATIENT, retry_config=_RETRIES),
            )
        except BaseError as error:
            raise ValueError(_line(error)) from None

    def create(self, name: str, content: bytes) -> bool:
        """Write an object, unless there is another one; tell whether it is there now."""
        with _translated():
            try:
                obstore.put(self._store, name, content, mode="create")
            except AlreadyExistsError:
                # It may be ours all the same: an answer was lost, and the request repeated.
                return self.read(name) == content
        return True

    def write(self, name: str, content: bytes | Path) -> None:
        """Write an object, from memory or from a file, over any that is there.

        That takes as long as it takes, while the store answers other requests.
        """
        with _translated():
            asyncio.run(self._write(name, content))

    async def _write(self, name: str, content: bytes | Path) -> None:
        put = obstore.put_async(self._patient, name, content, max_concurrency=_PARTS_AT_ONCE)
        putting = asyncio.ensure_future(put)
        try:
            while not (await asyncio.wait({putting}, timeout=_PROBE_S))[0]:
                with suppress(FileNotFoundError):
                    await obstore.head_async(self._store, name)
            await putting
        finally:
            putting.cancel()

    def read(self, name: str) -> bytes | None:
        """Return the content of a small object; None where there is none."""
        with _translated():
            try:
                return bytes(obstore.get(self._store, name).bytes())
            except FileNotFoundError:
                return None

    def size(self, name: str) -> int | None:
        """Return the size of an object; None where there is none."""
        with _translated():
            try:
                return obstore.head(self._store, name)["size"]
            except FileNotFoundError:
                return None

    def chunks(self, name: str) -> Iterator[bytes]:
        """Yield the content of an object; raises ``FileNotFoundError`` where there is none."""
        with _translated():
            size = obstore.head(self._store, name)["size"]
            for start in range(0, size, _CHUNK):
                length = min(_CHUNK, size - start)
                yield bytes(obstore.get_range(self._store, name, start=start, length=length))

    def fetch(self, name: str, path: Path) -> int:
        """Write the content of an object to a file, and return its CRC-32."""
        checksum = 0
        with path.open("wb") as file:
            for chunk in self.chunks(name):
                file.write(chunk)
                checksum = zlib.crc32(chunk, checksum)
        return checksum

    def checksum(self, name: str) -> int | None:
        """Return the CRC-32 of an object; None where there is none."""
        checksum = 0
        try:
            for chunk in self.chunks(name):
                checksum = zlib.crc32(chunk, checksum)
        except FileNotFoundError:
            return None
        return checksum

    async def open(self, name: str) -> Any:
        """Open an object, to be read from any place while it is sent."""
        with _translated():
            return await obstore.open_reader_async(self._store, name)

    def found(self, prefix: str) -> Iterator[ObjectInfo]:
        """Yield the objects whose names begin with a folder, the oldest first."""
        with _translated():
            pages = list(obstore.list(self._store, prefix))
        now = datetime.now(UTC)
        for meta in sorted((meta for page in pages for meta in page), key=_age):
            is_old = now - meta["last_modified"] > _ABANDONED
            yield ObjectInfo(meta["path"], meta["size"], is_old)

    def folders(self, prefix: str) -> list[str]:
        """Return the names of the folders in a folder, in order."""
        with _translated():
            found = obstore.list_with_delimiter(self._store, prefix)["common_prefixes"]
        return sorted(path.rpartition("/")[2] for path in found)

    def remove(self, *names: str) -> None:
        """Remove objects, those that are there."""
        with _translated():
            for name in names:
                try:
                    obstore.delete(self._store, name)
                except FileNotFoundError:  # only folders and memory say so
                    continue


def _age(meta: Any) -> datetime:
    modified: datetime = meta["last_modified"]
    return modified


@contextmanager
def _translated() -> Iterator[None]:
    """Raise the errors of a store that is away, or that refuses, as one of the system."""
    try:
        yield
    except BaseError as error:
        raise StoreUnavailableError(_line(error)) from error


def _line(error: BaseError) -> str:
    """Return what an error says, without what its library adds for its own developers."""
    return " ".join(str(error).partition("Debug source:")[0].split())

"""The objects of a store at a URL such as ``s3://bucket/prefix``, which all machines reach."""

import asyncio
import os
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Any

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import from_url

from app.errors import StoreUnavailableError
from app.store.log import warn
from app.store.objects import ABANDONED_S, ObjectInfo

if TYPE_CHECKING:
    from obstore.store import ClientConfig, RetryConfig

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


class Bucket:
    """The objects below a URL; see ``Objects``.

    All methods raise ``StoreUnavailableError`` where the store does not answer, after some retries.
    """

    is_local = False

    def __init__(self, store: Any, patient: Any = None) -> None:
        self._store = store
        self._patient = patient or store
        self._removing = ThreadPoolExecutor(2, "removing objects")

    @classmethod
    def at(cls, url: str) -> "Bucket":
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

    def replace(self, name: str, content: bytes) -> bytes | None:
        """Write an object; return what was there before, if anything else was."""
        if self.create(name, content):
            return None
        before = self.read(name)
        self.write(name, content)
        return before

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

    def fetch(self, name: str, path: Path) -> int:
        """Write the content of an object to a file, and return its CRC-32.

        Raises ``FileNotFoundError`` where there is none.
        """
        checksum = 0
        with _translated(), path.open("wb") as file:
            size = obstore.head(self._store, name)["size"]
            for start in range(0, size, _CHUNK):
                length = min(_CHUNK, size - start)
                chunk = bytes(obstore.get_range(self._store, name, start=start, length=length))
                file.write(chunk)
                checksum = zlib.crc32(chunk, checksum)
        return checksum

    def checksum(self, name: str) -> int | None:
        """Return the CRC-32 of an object; None where there is none."""
        try:
            return self.fetch(name, Path(os.devnull))
        except FileNotFoundError:
            return None

    def found(self, folder: str) -> Iterator[ObjectInfo]:
        """Yield the objects whose names begin with a folder, the oldest first."""
        with _translated():
            pages = list(obstore.list(self._store, folder))
        now = time()
        metas = [(meta["last_modified"].timestamp(), meta) for page in pages for meta in page]
        for modified, meta in sorted(metas, key=lambda each: each[0]):
            yield ObjectInfo(meta["path"], meta["size"], modified, now - modified > ABANDONED_S)

    def folders(self, folder: str) -> list[str]:
        """Return the names of the folders in a folder."""
        with _translated():
            found = obstore.list_with_delimiter(self._store, folder)["common_prefixes"]
        return [path.rpartition("/")[2] for path in found]

    def remove(self, *names: str) -> None:
        """Remove objects, those that are there."""
        with _translated():
            for name in names:
                with suppress(FileNotFoundError):  # only folders and memory say so
                    obstore.delete(self._store, name)

    def soon(self, remove: Callable[[str], None], name: str) -> None:
        """Remove it in the background; a failure is only logged."""
        self._removing.submit(_remove_or_warn, remove, name)

    def note_use(self, name: str) -> None:
        """Do nothing: the next start finds objects by age."""

    def body(
        self, name: str, size: int, crc32: int, on_damage: Callable[[], None]
    ) -> "VerifiedBody":
        """Return an object, to be read and verified while it is sent."""
        return VerifiedBody(self._store, name, size, crc32, on_damage)


@dataclass
class VerifiedBody:
    """An object that is read while it is sent; see ``RemoteBody``."""

    store: Any
    name: str
    size: int
    crc32: int
    on_damage: Callable[[], None]

    async def open(self) -> "VerifiedReader":
        """Open the object."""
        try:
            with _translated():
                reader = await obstore.open_reader_async(self.store, self.name)
        except FileNotFoundError as error:  # it was removed since it was found: ask again
            self.on_damage()
            raise StoreUnavailableError(str(error)) from error
        return VerifiedReader(reader, self)


class VerifiedReader:
    """Reads an object, and verifies it where it is read from its begin to its end.

    The last part is held back until the checksum is known to be right: what is damaged is never
    received as a whole.
    """

    def __init__(self, reader: Any, body: VerifiedBody) -> None:
        self._reader = reader
        self._body = body
        self._at = self._read = self._checksum = 0

    async def seek(self, offset: int) -> None:
        """Go on at an offset."""
        await self._reader.seek(offset)
        self._at = offset

    async def read(self, size: int) -> bytes:
        """Return the next bytes."""
        data = b""
        while len(data) < size and (part := bytes(await self._reader.read(size - len(data)))):
            data += part
        if self._at == self._read:
            self._checksum = zlib.crc32(data, self._checksum)
            self._read += len(data)
        self._at += len(data)
        is_end = self._read == self._body.size or (not data and self._at == self._read)
        if is_end and (self._read, self._checksum) != (self._body.size, self._body.crc32):
            self._body.on_damage()
            raise StoreUnavailableError("a stored answer has changed since it was written")
        return data

    async def aclose(self) -> None:
        """End the use of the body."""
        self._reader.close()


def _remove_or_warn(remove: Callable[[str], None], name: str) -> None:
    try:
        remove(name)
    except StoreUnavailableError as error:
        warn("object not removed", name=name, error=str(error))


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

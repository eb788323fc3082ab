"""The results of an object store, which are read while they are sent."""

import zlib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from anyio import CapacityLimiter, to_thread
from pydantic import ValidationError

from app.errors import StoreUnavailableError
from app.store.layout import RESULTS
from app.store.log import warn
from app.store.objects import Objects
from app.store.results import SMALL, Result, ResultManifest

_FETCHED_AT_ONCE = 4
_CALLS = 32
"""Calls of the store at the same time"""


class ObjectResults:
    """The results in ``objects``; see ``ResultFiles``.

    The same answer may come from two machines, with other figures about its computation. A body is
    named by its checksum, so that it is always that of its manifest.
    """

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._limiter = CapacityLimiter(_CALLS)
        self._removing = ThreadPoolExecutor(2, "removing results")

    def found(self, *, is_alone: bool) -> Iterator[tuple[str, int]]:  # noqa: ARG002 - age tells
        """Yield what is there; bodies that have had no manifest for a day are removed."""
        objects = list(self._objects.found(RESULTS))
        manifests = {_result_of(each.name) for each in objects if each.name.endswith(".json")}
        for each in objects:
            if each.name.endswith(".body"):
                name = _result_of(each.name)
                if name in manifests:
                    yield name, each.size
                elif each.is_old:
                    self._objects.remove(each.name)

    async def read(self, name: str) -> Result | None:
        """Return a result, with its body where that is small."""
        return await to_thread.run_sync(self._read, name, limiter=self._limiter)

    async def size(self, name: str) -> int | None:
        """Return the size of a body; None where it is missing."""
        manifest = await to_thread.run_sync(self._manifest, name, limiter=self._limiter)
        return None if manifest is None else manifest.size

    async def write(self, name: str, body: bytes, manifest: ResultManifest) -> None:
        """Write a result from memory."""
        await to_thread.run_sync(self._write, name, body, manifest, limiter=self._limiter)

    async def send(self, result: Result, path: Path) -> None:
        """Write a result whose body is a file of this machine."""
        name, manifest = result.name, result.manifest
        await to_thread.run_sync(self._write, name, path, manifest, limiter=self._limiter)

    def fetch(self, files: Mapping[str, Path]) -> None:
        """Write the bodies of results to files of this machine, a few at a time.

        Raises ``StoreUnavailableError`` where one is not what was written.
        """
        with ThreadPoolExecutor(_FETCHED_AT_ONCE) as pool:
            list(pool.map(self._fetch, files, files.values()))

    def note_use(self, name: str) -> None:
        """Do nothing: the next start finds them by age."""

    def remove(self, name: str) -> None:
        """Remove a result soon, in the background."""
        self._removing.submit(self._remove, name)

    def body(self, result: Result) -> "ObjectBody":
        """Return the body of a result."""
        on_damage = partial(self.remove, result.name)
        return ObjectBody(
            self._objects, _body_name(result.name, result.manifest), result, on_damage
        )

    def _read(self, name: str) -> Result | None:
        manifest = self._manifest(name)
        if manifest is None:
            return None
        body_name = _body_name(name, manifest)
        if manifest.size > SMALL:
            is_there = self._objects.size(body_name) == manifest.size
            return Result(name, manifest, None, has_files=True) if is_there else None
        body = self._objects.read(body_name)
        if body is None or zlib.crc32(body) != manifest.crc32:
            return None
        return Result(name, manifest, body, has_files=True)

    def _fetch(self, name: str, path: Path) -> None:
        manifest = self._manifest(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if manifest is not None:
                fetched = self._objects.fetch(_body_name(name, manifest), path)
                if fetched == manifest.crc32:
                    return
        except FileNotFoundError:
            pass
        self.remove(name)
        raise StoreUnavailableError(f"the stored result {name} is gone or damaged")

    def _manifest(self, name: str) -> ResultManifest | None:
        content = self._objects.read(_manifest_name(name))
        try:
            return None if content is None else ResultManifest.model_validate_json(content)
        except ValidationError:
            return None

    def _write(self, name: str, body: bytes | Path, manifest: ResultManifest) -> None:
        self._objects.write(_body_name(name, manifest), body)
        content = manifest.model_dump_json().encode()
        if self._objects.create(_manifest_name(name), content):
            return
        # There is one that differs, or is damaged; what it names may be gone, and this is all here.
        before = self._manifest(name)
        self._objects.write(_manifest_name(name), content)
        if before is not None and _body_name(name, before) != _body_name(name, manifest):
            self._objects.remove(_body_name(name, before))

    def _remove(self, name: str) -> None:
        try:
            manifest = self._manifest(name)
            self._objects.remove(_manifest_name(name))
            if manifest is not None:
                self._objects.remove(_body_name(name, manifest))
        except StoreUnavailableError as error:
            warn("result not removed", name=name, error=str(error))


class ObjectBody:
    """A body in the store; see ``RemoteBody``."""

    def __init__(self, objects: Objects, name: str, result: Result, on_damage: Any) -> None:
        self._objects = objects
        self._name = name
        self._manifest = result.manifest
        self._on_damage = on_damage
        self.size = result.manifest.size

    async def open(self) -> "VerifiedReader":
        """Open the body."""
        try:
            return VerifiedReader(
                await self._objects.open(self._name), self._manifest, self._on_damage
            )
        except FileNotFoundError as error:  # it was removed since it was found: ask again
            raise StoreUnavailableError(str(error)) from error


class VerifiedReader:
    """Reads a body, and verifies it where it is read from its begin to its end.

    The last part is held back until the checksum is known to be right: what is damaged is never
    received as a whole.
    """

    def __init__(self, reader: Any, manifest: ResultManifest, on_damage: Any) -> None:
        self._reader = reader
        self._manifest = manifest
        self._on_damage = on_damage
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
        is_end = self._read == self._manifest.size or (not data and self._at == self._read)
        if is_end and (self._read, self._checksum) != (self._manifest.size, self._manifest.crc32):
            self._on_damage()
            raise StoreUnavailableError("a stored answer has changed since it was written")
        return data

    async def aclose(self) -> None:
        """End the use of the body."""
        self._reader.close()


def _result_of(name: str) -> str:
    """Return the name of the result that an object belongs to."""
    return name.removeprefix(f"{RESULTS}/").split(".")[0]


def _manifest_name(name: str) -> str:
    return f"{RESULTS}/{name}.json"


def _body_name(name: str, manifest: ResultManifest) -> str:
    return f"{RESULTS}/{name}.{manifest.crc32:08x}-{manifest.size}.body"

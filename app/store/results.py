"""Results: encoded answers, stored as files that workers write and the API sends.

``results/{mesh id}/{key}.body`` is the body. The manifest ``{key}.json`` beside it is written last,
so that it marks the result as complete; it holds headers, size and checksum. A small result that
was cheap to compute stays in memory and has no files: two files took half as long as all other work
on it.
"""

import errno
import re
import zlib
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import IO

from anyio import CapacityLimiter, to_thread
from pydantic import BaseModel, ConfigDict, ValidationError

from app.errors import StoreUnavailableError, over_limit, problem
from app.store.atomic import atomic_write
from app.store.layout import RESULTS
from app.store.log import warn
from app.store.lru_cache import LRUCache
from app.store.objects import Objects, RemoteBody

Buffer = bytes | memoryview


SMALL = 2**16
"""Bytes of a body that is also held in memory: most of them, but for fields and long lines"""

_CHUNK = 2**20
"""Bytes that are read at a time"""

_CALLS = 32
"""Calls of the store at the same time"""

_ENTRY = 4096
"""Bytes that a result in memory takes besides its body: objects, names and headers"""

_OBJECT = re.compile(rf"{RESULTS}/(.+?)(\.[0-9a-f]{{8}}-[0-9]+)?\.(json|body)")
"""The name of an object, which has that of its result"""

_MAKE_ROOM = "delete jobs whose answers you have read"


class ResultManifest(BaseModel):
    """Headers, size and checksum of a complete result, as stored beside its body."""

    model_config = ConfigDict(frozen=True)

    headers: dict[str, str]
    size: int
    crc32: int
    code: str = ""
    """Version of the code that computed the answer"""


@dataclass(frozen=True)
class Result:
    """A complete result: in memory, in files, or both."""

    name: str
    manifest: ResultManifest
    body: bytes | None
    """The whole body, where it is small"""
    has_files: bool

    @property
    def key(self) -> str:
        """The hash that names the result, without its mesh."""
        return self.name.rpartition("/")[2]


def write_result(
    root: Path,
    name: str,
    parts: Iterable[Buffer],
    headers: Mapping[str, str],
    code: str,
    *,
    is_cheap: bool,
) -> Result:
    """Write a result under ``root``, unless it is both small and cheap.

    A small one is returned without files where the disk can only be read.

    The parts are written as they are produced, so that they need not be in memory together.

    Parameters
    ----------
    root
        Folder of all results.
    name
        Name of the result, see `result_name`.
    parts
        Parts of the body, in order.
    headers
        Headers of the answer that depend on its content.
    code
        Version of the code that computed the answer.
    is_cheap
        Whether computing the answer again costs about as little as writing it.
    """
    rest = iter(parts)
    first: list[Buffer] = []
    for part in rest:
        first.append(part)
        if sum(map(len, first)) > SMALL:
            return _write(root, name, chain(first, rest), headers, code)
    in_memory = in_memory_result(name, first, headers, code)
    if is_cheap:
        return in_memory
    try:
        return replace(_write(root, name, first, headers, code), body=in_memory.body)
    except OSError as error:
        if error.errno != errno.EROFS:
            raise
        warn("result not stored", name=name, error=repr(error))
        return in_memory


def in_memory_result(
    name: str, parts: Iterable[Buffer], headers: Mapping[str, str], code: str
) -> Result:
    """Return a small result without files, see `write_result`."""
    body = b"".join(parts)
    manifest = ResultManifest(
        headers=dict(headers), size=len(body), crc32=zlib.crc32(body), code=code
    )
    return Result(name, manifest, body, has_files=False)


def write_result_file(
    root: Path,
    name: str,
    write: Callable[[IO[bytes]], None],
    headers: Mapping[str, str],
    code: str,
    check: Callable[[], None],
) -> Result:
    """Write a result whose body ``write`` writes into a file, in any order; see `write_result`.

    While the file is read for its checksum, ``check`` is called again and again; it may raise.
    """
    size = checksum = 0
    with atomic_write(body_path(root, name)) as file:
        write(file)
        file.seek(0)
        while chunk := file.read(_CHUNK):
            check()
            size += len(chunk)
            checksum = zlib.crc32(chunk, checksum)
    return _add_manifest(root, name, size, checksum, headers, code)


def _write(
    root: Path, name: str, parts: Iterable[Buffer], headers: Mapping[str, str], code: str
) -> Result:
    """Write the files of a result, the body first and the manifest last."""
    size = checksum = 0
    with atomic_write(body_path(root, name)) as file:
        for part in parts:
            size += file.write(part)
            checksum = zlib.crc32(part, checksum)
    return _add_manifest(root, name, size, checksum, headers, code)


def _add_manifest(
    root: Path, name: str, size: int, checksum: int, headers: Mapping[str, str], code: str
) -> Result:
    """Write the manifest of a result, which completes it."""
    manifest = ResultManifest(headers=dict(headers), size=size, crc32=checksum, code=code)
    with atomic_write(_manifest_path(root, name)) as file:
        file.write(manifest.model_dump_json().encode())
    return Result(name, manifest, None, has_files=True)


class ResultFiles:
    """The results in ``objects``.

    The same answer may come from two machines, with other figures about its computation. So the
    body in an object store is named by its checksum, too: it is always that of its manifest.
    """

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._limiter = CapacityLimiter(_CALLS)

    def found(self) -> Iterator[tuple[str, int]]:
        """Yield names and sizes of the results of a former service, the oldest first.

        What nobody will complete is removed.
        """
        objects = list(self._objects.found(RESULTS))
        names = {each.name: result_of(each.name) for each in objects}
        sizes = {names[each.name]: each.size for each in objects if each.name.endswith(".body")}
        complete = sizes.keys() & {names[name] for name in names if name.endswith(".json")}
        for each in objects:
            name = names[each.name]
            if name not in complete:
                if each.is_abandoned:
                    self._objects.remove(each.name)
            elif each.name.endswith(".json"):
                yield name, sizes[name]

    async def read(self, name: str, known: Result | None = None) -> Result | None:
        """Return a result, see `read_now`."""
        return await to_thread.run_sync(self.read_now, name, known, limiter=self._limiter)

    async def size(self, name: str) -> int | None:
        """Return the size of the body of a result; None where it is missing."""
        manifest = await to_thread.run_sync(self.manifest, name, limiter=self._limiter)
        return None if manifest is None else manifest.size

    async def write(self, name: str, body: bytes | Path, manifest: ResultManifest) -> None:
        """Write the files of a result in memory, or of one whose body is a file."""
        await to_thread.run_sync(self._write, name, body, manifest, limiter=self._limiter)

    def note_use(self, name: str) -> None:
        """Mark a result as the most recently used."""
        self._objects.note_use(_manifest_name(name))

    def remove(self, name: str) -> None:
        """Remove a result, if it is there."""
        self._objects.soon(self._remove, name)

    def body(self, result: Result, on_damage: Callable[[], None]) -> Path | RemoteBody:
        """Return the body of a result that has files, see ``Objects``."""
        name = self.body_name(result.name, result.manifest)
        return self._objects.body(name, result.manifest.size, result.manifest.crc32, on_damage)

    def body_name(self, name: str, manifest: ResultManifest | None) -> str:
        """Return the name of a body; in a folder, that of the result tells it."""
        version = (
            ""
            if manifest is None or self._objects.is_local
            else f".{manifest.crc32:08x}-{manifest.size}"
        )
        return f"{RESULTS}/{name}{version}.body"

    def read_now(self, name: str, known: Result | None = None) -> Result | None:
        """Return a result; None where it is missing or damaged.

        A large body is not read again where it is ``known`` to be intact: clients may read it in
        many ranges. One that is elsewhere is verified while it is sent, see ``Objects.body``.
        """
        manifest = self.manifest(name)
        if manifest is None:
            return None
        body_name, body = self.body_name(name, manifest), None
        if manifest.size <= SMALL:
            body = self._objects.read(body_name)
            is_intact = body is not None and zlib.crc32(body) == manifest.crc32
        else:
            is_intact = self._objects.size(body_name) == manifest.size
            is_verified = known is not None and known.manifest == manifest
            if is_intact and self._objects.is_local and not is_verified:
                is_intact = self._objects.checksum(body_name) == manifest.crc32
        return Result(name, manifest, body, has_files=True) if is_intact else None

    def manifest(self, name: str) -> ResultManifest | None:
        """Return the manifest of a result; None where it is missing or damaged."""
        return _decoded(self._objects.read(_manifest_name(name)))

    def _write(self, name: str, body: bytes | Path, manifest: ResultManifest) -> None:
        body_name, content = self.body_name(name, manifest), manifest.model_dump_json().encode()
        self._objects.write(body_name, body)
        before = _decoded(self._objects.replace(_manifest_name(name), content))
        if before is not None and self.body_name(name, before) != body_name:
            self._objects.remove(self.body_name(name, before))

    def _remove(self, name: str) -> None:
        manifest = None if self._objects.is_local else self.manifest(name)
        self._objects.remove(_manifest_name(name))
        if self._objects.is_local or manifest is not None:
            self._objects.remove(self.body_name(name, manifest))


class ResultStore:
    """Results in ``files``, at most ``capacity`` bytes; the least recently used go first.

    Those that the jobs of one caller pin, or reserve room for, have at most ``quota`` bytes. In
    memory are those used last, of up to ``memory`` bytes: small ones, with files or without, and of
    large ones that they have been verified. One process owns the store and its index. `find` and
    `add` acquire a result, which protects its files until `release`; a pinned one stays until
    `unpin`.
    """

    def __init__(
        self, files: ResultFiles, capacity: int, memory: int, quota: int | None = None
    ) -> None:
        self._files = files
        self._capacity = capacity
        self._quota = quota
        self._memory: LRUCache[str, Result] = LRUCache(memory, _bytes_in_memory)
        self._sizes: OrderedDict[str, int] = OrderedDict()
        self._total = 0
        self._in_use: Counter[str] = Counter()
        self._pins: defaultdict[str, Counter[str]] = defaultdict(Counter)
        """Numbers of pins on results, by caller"""
        self._reserved: Counter[str] = Counter()
        """Bytes by caller"""
        self.evictions = 0
        """Results removed so far to make room on the disk"""

    def prepare(self) -> None:
        """Index the results of a former service, the oldest first, and remove incomplete ones.

        `make_room` is to follow once those that must stay are pinned.
        """
        for name, size in self._files.found():
            self._count(name, size)

    @property
    def nbytes(self) -> int:
        """Bytes of all bodies that are files."""
        return self._total

    @property
    def memory_evictions(self) -> int:
        """Results dropped so far to make room in memory."""
        return self._memory.evictions

    def body(self, result: Result) -> Path | RemoteBody:
        """Return the body of a result that has files."""
        return self._files.body(result, partial(self._remove, result.name))

    async def find(self, name: str) -> Result | None:
        """Acquire a result; None where it is missing or damaged."""
        known = self._memory.get(name)
        if known is not None and known.body is not None:
            return self._acquire(known)
        if name not in self._sizes:
            return None
        self._in_use[name] += 1  # protects the files while a thread reads them
        try:
            result = await self._files.read(name, known)
            if result is not None:
                self._files.note_use(name)
                return self._acquire(result)
        finally:
            self._decrement_use(name)
        self._remove(name)
        return None

    async def index(self, name: str) -> None:
        """Index a result that another service may have written."""
        if name not in self._sizes:
            size = await self._files.size(name)
            if size is not None:
                self._count(name, size)

    async def index_unclaimed(self, name: str) -> None:
        """Index a result that was written although nobody waits for it.

        Where the store does not answer, the next start finds it.
        """
        with suppress(StoreUnavailableError):
            await self.index(name)
            self.make_room()

    def add(self, result: Result) -> Result:
        """Acquire a result that a worker has just written."""
        return self._acquire(result)

    def release(self, result: Result) -> None:
        """End the use of a result that was acquired."""
        self._decrement_use(result.name)
        self.make_room()

    async def with_files(self, result: Result) -> Result:
        """Return an acquired result with files, which are written now where it had none.

        The result is released where that fails.
        """
        if result.has_files:
            return result
        assert result.body is not None, "a result without files is in memory"  # noqa: S101
        try:
            await self._files.write(result.name, result.body, result.manifest)
        except BaseException:
            self.release(result)
            raise
        filed = replace(result, has_files=True)
        self._hold(filed)
        return filed

    @contextmanager
    def reserving(self, client: str, nbytes: int) -> Iterator[Callable[[int], None]]:
        """Reserve room for results that a caller's job makes inside the block.

        Yields a function that reserves more. Raises ``ProblemError`` where the results of jobs,
        and other reservations, leave too little.
        """
        reserved = 0

        def reserve(nbytes: int) -> None:
            nonlocal reserved
            self.refuse_without_room(client, nbytes)
            self._reserved[client] += nbytes
            reserved += nbytes

        reserve(nbytes)
        try:
            yield reserve
        finally:
            self._reserved[client] -= reserved
            if not self._reserved[client]:
                del self._reserved[client]

    def refuse_without_room(self, client: str, nbytes: int) -> None:
        """Raise ``ProblemError`` where so many bytes would be too many, of the caller or of all."""
        own = self._reserved[client] + self._bytes_of(set(self._pins[client])) + nbytes
        if self._quota is not None and own > self._quota:
            raise over_limit(
                "quota_exceeded",
                "bytes of answers to one caller's jobs",
                own,
                self._quota,
                "quota_results_bytes",
                hint=_MAKE_ROOM,
                other_status=507,
            )
        room = self._capacity - self._reserved.total() - self._bytes_of(self._pinned)
        if nbytes > room:
            raise problem(
                "storage_full",
                f"the answers of jobs leave {max(0, room)} of the {nbytes} bytes that this one "
                "needs",
                limit=self._capacity,
                actual=self._capacity - room + nbytes,
                setting="results_bytes",
                hint=_MAKE_ROOM,
            )

    @property
    def _pinned(self) -> set[str]:
        return set().union(*self._pins.values())

    def _bytes_of(self, names: set[str]) -> int:
        return sum(self._sizes.get(name, 0) for name in names)

    def pin_within_quota(self, name: str, client: str) -> None:
        """Pin a result, or raise ``ProblemError`` as `refuse_without_room` does."""
        if name not in self._pins[client]:
            nbytes = 0 if name in self._pinned else self._sizes.get(name, 0)
            self.refuse_without_room(client, nbytes)
        self.pin(name, client)

    def pin(self, name: str, client: str) -> None:
        """Protect a result from eviction until `unpin`."""
        self._pins[client][name] += 1

    def unpin(self, name: str, client: str) -> None:
        """Take one pin of a caller off a result."""
        self._pins[client] -= Counter([name])
        self.make_room()

    def discard(self, name: str) -> None:
        """Remove a result, unless it is pinned or in use."""
        if name not in self._in_use and name not in self._pinned:
            self._remove(name)

    def forget_mesh(self, mesh_id: str) -> None:
        """Remove the results of a mesh, except those that are pinned or in use."""
        for name in {*self._sizes, *self._memory}:
            if name.startswith(f"{mesh_id}/"):
                self.discard(name)

    def make_room(self) -> None:
        """Remove results until the rest fits, but none that is pinned or in use."""
        if self._total <= self._capacity:
            return
        spared = self._pinned | self._in_use.keys()
        for name in list(self._sizes):
            if name not in spared:
                self._remove(name)
                self.evictions += 1
            if self._total <= self._capacity:
                return

    def _acquire(self, result: Result) -> Result:
        self._hold(result)
        self._in_use[result.name] += 1
        return result

    def _hold(self, result: Result) -> None:
        """Count a result, and hold it in memory as the most recently used."""
        if result.has_files:
            self._count(result.name, result.manifest.size)
        self._memory.put(result.name, result)
        self._memory.evict()

    def _count(self, name: str, size: int) -> None:
        self._total += size - self._sizes.pop(name, 0)
        self._sizes[name] = size

    def _decrement_use(self, name: str) -> None:
        self._in_use[name] -= 1
        if not self._in_use[name]:
            del self._in_use[name]

    def _remove(self, name: str) -> None:
        if self._memory.get(name) is not None:
            self._memory.drop(name)
        self._files.remove(name)
        self._total -= self._sizes.pop(name, 0)


def _bytes_in_memory(result: Result) -> int:
    return _ENTRY + len(result.body or b"")


def result_name(mesh_id: str, key: str) -> str:
    """Return the name under which the result ``key`` of a mesh is stored."""
    return f"{mesh_id}/{key}"


def body_path(root: Path, name: str) -> Path:
    """Return the file of the body of a result, under the folder of all results."""
    return root / f"{name}.body"


def _manifest_path(root: Path, name: str) -> Path:
    return root / f"{name}.json"


def _manifest_name(name: str) -> str:
    return f"{RESULTS}/{name}.json"


def _decoded(content: bytes | None) -> ResultManifest | None:
    try:
        return None if content is None else ResultManifest.model_validate_json(content)
    except ValidationError:
        return None


def result_of(name: str) -> str:
    """Return the name of the result that an object belongs to; of another object, its own name."""
    found = _OBJECT.fullmatch(name)
    return found[1] if found else name

"""Results: encoded answers, stored as files that workers write and the API sends.

``results/{mesh id}/{key}.body`` is the body. The manifest ``{key}.json`` beside it is written last,
so that it marks the result as complete; it holds headers, size and checksum. A small result that
was cheap to compute stays in memory and has no files: two files took half as long as all other work
on it.
"""

import errno
import zlib
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import IO, Protocol

from anyio import to_thread
from pydantic import BaseModel, ConfigDict, ValidationError

from app.errors import StoreUnavailableError, over_limit, problem
from app.store.atomic import atomic_write, remove_partial
from app.store.last_use import note_use, order_of_use
from app.store.log import warn
from app.store.verified import checksum_of

Buffer = bytes | memoryview


SMALL = 2**16
"""Bytes of a body that is also held in memory: most of them, but for fields and long lines"""

_CHUNK = 2**20
"""Bytes that are read at a time"""

_ENTRY = 4096
"""Bytes that a result in memory takes besides its body: objects, names and headers"""


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
    body = b"".join(first)
    manifest = ResultManifest(
        headers=dict(headers), size=len(body), crc32=zlib.crc32(body), code=code
    )
    in_memory = Result(name, manifest, body, has_files=False)
    if is_cheap:
        return in_memory
    try:
        return replace(_write(root, name, [body], headers, code), body=body)
    except OSError as error:
        if error.errno != errno.EROFS:
            raise
        warn("result not stored", name=name, error=repr(error))
        return in_memory


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


class ResultFiles(Protocol):
    """The files of results: a folder, or objects that several machines reach."""

    def found(self, *, is_alone: bool) -> Iterable[tuple[str, int]]:
        """Yield names and sizes of the results of a former service, the oldest first.

        What is incomplete is removed, where no other service may be writing it.
        """

    async def read(self, name: str) -> Result | None:
        """Return a result; None where it is missing or damaged."""

    async def size(self, name: str) -> int | None:
        """Return the size of the body of a result; None where it is missing."""

    async def write(self, name: str, body: bytes, manifest: ResultManifest) -> None:
        """Write the files of a result in memory."""

    def note_use(self, name: str) -> None:
        """Mark a result as the most recently used."""

    def remove(self, name: str) -> None:
        """Remove a result, if it is there."""

    def body(self, result: Result) -> "Path | RemoteBody":
        """Return the body of a result that has files."""


class RemoteFile(Protocol):
    """A file that is elsewhere."""

    async def seek(self, offset: int) -> object:
        """Go on at an offset."""

    async def read(self, size: int) -> bytes:
        """Return the next bytes: as many, or fewer at the end."""

    async def aclose(self) -> None:
        """End the use of the file."""


class RemoteBody(Protocol):
    """A body that is elsewhere, and read while it is sent."""

    size: int

    async def open(self) -> RemoteFile:
        """Open the body for reading."""


class FolderResults:
    """The results in the folder ``root``."""

    def __init__(self, root: Path) -> None:
        self._root = root

    def found(self, *, is_alone: bool) -> Iterator[tuple[str, int]]:
        """Yield what is there, see ``ResultFiles``."""
        self._root.mkdir(parents=True, exist_ok=True)
        complete = []
        for path in self._root.glob("*/*.body"):
            name = path.relative_to(self._root).with_suffix("").as_posix()
            manifest = _manifest_path(self._root, name)
            if manifest.exists():
                with suppress(FileNotFoundError):  # another service has evicted it a moment ago
                    complete.append((order_of_use(manifest.stat()), name, path.stat().st_size))
            elif is_alone:
                path.unlink()
        if is_alone:
            remove_partial(self._root)
        for _, name, size in sorted(complete):
            yield name, size

    async def read(self, name: str) -> Result | None:
        """Return a result; None where it is missing or damaged."""
        return await to_thread.run_sync(_read, self._root, name)

    async def size(self, name: str) -> int | None:
        """Return the size of a body; None where it is missing."""
        return await to_thread.run_sync(_size, self._root, name)

    async def write(self, name: str, body: bytes, manifest: ResultManifest) -> None:
        """Write a result."""
        await to_thread.run_sync(_write, self._root, name, [body], manifest.headers, manifest.code)

    def note_use(self, name: str) -> None:
        """Note a use as the time of the manifest: that of the body tells whether it was changed."""
        note_use(_manifest_path(self._root, name))

    def remove(self, name: str) -> None:
        """Remove the files of a result."""
        _manifest_path(self._root, name).unlink(missing_ok=True)
        body_path(self._root, name).unlink(missing_ok=True)

    def body(self, result: Result) -> Path:
        """Return the file of a body."""
        return body_path(self._root, result.name)


class ResultStore:
    """Results in ``files``, at most ``capacity`` bytes; the least recently used go first.

    Those that the jobs of one owner pin, or reserve room for, have at most ``quota`` bytes. Small
    results of up to ``memory`` bytes are held in memory: all those without files, and some of the
    others. One process owns the store and its index. `find` and `add` acquire a result, which
    protects its files until `release`; a pinned one stays until `unpin`.
    """

    def __init__(
        self, files: ResultFiles, capacity: int, memory: int, quota: int | None = None
    ) -> None:
        self._files = files
        self._capacity = capacity
        self._quota = quota
        self._memory = memory
        self._small: OrderedDict[str, Result] = OrderedDict()
        self._small_total = 0
        self._sizes: OrderedDict[str, int] = OrderedDict()
        self._total = 0
        self._in_use: Counter[str] = Counter()
        self._pins: defaultdict[str | None, Counter[str]] = defaultdict(Counter)
        """Numbers of pins on results, by owner"""
        self._reserved: Counter[str | None] = Counter()
        """Bytes by owner"""
        self.evictions = 0
        """Results removed so far to make room on the disk"""
        self.memory_evictions = 0
        """Results dropped so far to make room in memory"""

    def prepare(self, *, is_alone: bool = True) -> None:
        """Index the results of a former service, the oldest first, and remove incomplete ones.

        Where this service is not alone, another one may be writing those. `make_room` is to follow
        once those that must stay are pinned.
        """
        for name, size in self._files.found(is_alone=is_alone):
            self._count(name, size)

    @property
    def nbytes(self) -> int:
        """Bytes of all bodies that are files."""
        return self._total

    def body(self, result: Result) -> Path | RemoteBody:
        """Return the body of a result that has files."""
        return self._files.body(result)

    async def find(self, name: str) -> Result | None:
        """Acquire a result; None where it is missing or damaged."""
        if name in self._small:
            self._small.move_to_end(name)
            return self._acquire(self._small[name])
        if name not in self._sizes:
            return None
        self._in_use[name] += 1  # protects the files while a thread reads them
        try:
            result = await self._files.read(name)
            if result is not None:
                self._files.note_use(name)
                self._cache_small(result)
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
        self._cache_small(result)
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
        name, manifest = result.name, result.manifest
        try:
            await self._files.write(name, result.body, manifest)
        except BaseException:
            self.release(result)
            raise
        self._count(name, manifest.size)
        filed = replace(result, has_files=True)
        if name in self._small:
            self._small[name] = filed
        return filed

    @contextmanager
    def reserving(self, owner: str | None, nbytes: int) -> Iterator[Callable[[int], None]]:
        """Reserve room for results that an owner's job makes inside the block.

        Yields a function that reserves more. Raises ``ProblemError`` where the results of jobs,
        and other reservations, leave too little.
        """
        reserved = 0

        def reserve(nbytes: int) -> None:
            nonlocal reserved
            self.refuse_without_room(owner, nbytes)
            self._reserved[owner] += nbytes
            reserved += nbytes

        reserve(nbytes)
        try:
            yield reserve
        finally:
            self._reserved[owner] -= reserved
            if not self._reserved[owner]:
                del self._reserved[owner]

    def refuse_without_room(self, owner: str | None, nbytes: int) -> None:
        """Raise ``ProblemError`` where so many bytes would be too many, of the owner or of all."""
        own = self._reserved[owner] + self._bytes_of(set(self._pins[owner])) + nbytes
        if self._quota is not None and own > self._quota:
            raise over_limit(
                "quota_exceeded",
                "bytes of answers to one owner's jobs",
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

    def pin_within_quota(self, name: str, owner: str | None) -> None:
        """Pin a result, or raise ``ProblemError`` as `refuse_without_room` does."""
        if name not in self._pins[owner]:
            self.refuse_without_room(owner, 0 if name in self._pinned else self._sizes.get(name, 0))
        self.pin(name, owner)

    def pin(self, name: str, owner: str | None) -> None:
        """Protect a result from eviction until `unpin`."""
        self._pins[owner][name] += 1

    def unpin(self, name: str, owner: str | None) -> None:
        """Take one pin of an owner off a result."""
        self._pins[owner] -= Counter([name])
        self.make_room()

    def discard(self, name: str) -> None:
        """Remove a result, unless it is pinned or in use."""
        if self._is_free(name):
            self._remove(name)

    def forget_mesh(self, mesh_id: str) -> None:
        """Remove the results of a mesh, except those that are pinned or in use."""
        names = {*self._sizes, *self._small}
        for name in [name for name in names if name.startswith(f"{mesh_id}/")]:
            self.discard(name)

    def _acquire(self, result: Result) -> Result:
        if result.has_files:
            self._count(result.name, result.manifest.size)
        self._in_use[result.name] += 1
        return result

    def _count(self, name: str, size: int) -> None:
        self._total += size - self._sizes.pop(name, 0)
        self._sizes[name] = size

    def _decrement_use(self, name: str) -> None:
        self._in_use[name] -= 1
        if not self._in_use[name]:
            del self._in_use[name]

    def make_room(self) -> None:
        """Remove results until the rest fits, but none that is pinned or in use."""
        if self._total <= self._capacity:
            return
        pinned = self._pinned
        for name in list(self._sizes):
            if name not in self._in_use and name not in pinned:
                self._remove(name)
                self.evictions += 1
            if self._total <= self._capacity:
                return

    def _is_free(self, name: str) -> bool:
        return name not in self._in_use and name not in self._pinned

    def _cache_small(self, result: Result) -> None:
        if result.body is None or result.name in self._small:
            return
        self._small[result.name] = result
        self._small_total += _ENTRY + result.manifest.size
        while self._small_total > self._memory:
            self._drop_small(next(iter(self._small)))
            self.memory_evictions += 1

    def _drop_small(self, name: str) -> None:
        if name in self._small:
            self._small_total -= _ENTRY + self._small.pop(name).manifest.size

    def _remove(self, name: str) -> None:
        self._drop_small(name)
        self._files.remove(name)
        self._total -= self._sizes.pop(name, 0)


def result_name(mesh_id: str, key: str) -> str:
    """Return the name under which the result ``key`` of a mesh is stored."""
    return f"{mesh_id}/{key}"


def body_path(root: Path, name: str) -> Path:
    """Return the file of the body of a result, under the folder of all results."""
    return root / f"{name}.body"


def complete_results(root: Path) -> dict[str, tuple[Path, Path]]:
    """Return manifest and body of each complete result on disk, by name."""
    manifests = sorted(root.glob("*/*.json"))
    names = [path.relative_to(root).with_suffix("").as_posix() for path in manifests]
    return {
        name: (_manifest_path(root, name), body_path(root, name))
        for name in names
        if body_path(root, name).exists()
    }


def read_manifest(root: Path, name: str) -> ResultManifest | None:
    """Return the manifest of a result; None where the result is missing or damaged."""
    result = _read(root, name)
    return None if result is None else result.manifest


def _manifest_path(root: Path, name: str) -> Path:
    return root / f"{name}.json"


def _size(root: Path, name: str) -> int | None:
    """Return the size of the body of a result; None where it is missing."""
    if not _manifest_path(root, name).exists():
        return None
    try:
        return body_path(root, name).stat().st_size
    except FileNotFoundError:
        return None


def _read(root: Path, name: str) -> Result | None:
    """Return a result from its files; None where it is missing or damaged.

    A large body is read once for each version of its file: clients may read it in many ranges.
    """
    path = body_path(root, name)
    try:
        manifest = ResultManifest.model_validate_json(_manifest_path(root, name).read_bytes())
        body = path.read_bytes() if manifest.size <= SMALL else None
        size = path.stat().st_size if body is None else len(body)
    except (FileNotFoundError, ValidationError):
        return None
    if size != manifest.size:
        return None
    checksum = checksum_of(str(path)) if body is None else zlib.crc32(body)
    return Result(name, manifest, body, has_files=True) if checksum == manifest.crc32 else None

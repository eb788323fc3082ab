"""Finished answers: files, written by workers and sent by the API; and small ones, in memory.

``results/{mesh id}/{key}.body`` is what goes out; ``{key}.json`` beside it, written last, says that
it is complete: its headers, its size and its checksum. What is small and was found at once has no
files: two of them took half as long as all else that its worker did.
"""

import os
import zlib
from collections import Counter, OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from anyio import to_thread
from pydantic import BaseModel, ConfigDict, ValidationError

from app.store.atomic import atomic_write, remove_partial

Buffer = bytes | memoryview


_SMALL = 2**16
"""Bytes of an answer that is kept in memory as well: most, but for fields and long lines"""


class ResultManifest(BaseModel):
    """What is known of an answer that is complete."""

    model_config = ConfigDict(frozen=True)

    headers: dict[str, str]
    size: int
    crc32: int
    code: str = ""
    """Which version of the code found it"""


@dataclass(frozen=True)
class Written:
    """An answer that is complete."""

    seal: ResultManifest
    body: bytes | None
    """All of it, where it is small"""
    has_files: bool


@dataclass(frozen=True)
class Result:
    """An answer that was taken from the store."""

    name: str
    path: Path
    """Of its body, where it has files"""
    written: Written
    is_kept: bool = True
    """Whether it stays when it has been sent."""

    @property
    def key(self) -> str:
        """The hash that names the answer, without its mesh."""
        return self.name.rpartition("/")[2]


def write_result(
    root: Path,
    name: str,
    parts: Iterable[Buffer],
    headers: Mapping[str, str],
    code: str,
    *,
    is_cheap: bool,
) -> Written:
    """Write the result ``name`` under ``root``; one that is small as well as ``is_cheap`` is not.

    The parts are written as they are made, so that they need not be in memory together.
    """
    rest = iter(parts)
    first: list[Buffer] = []
    for part in rest:
        first.append(part)
        if sum(map(len, first)) > _SMALL:
            return _write(root, name, chain(first, rest), headers, code)
    body = b"".join(first)
    if is_cheap:
        seal = ResultManifest(
            headers=dict(headers), size=len(body), crc32=zlib.crc32(body), code=code
        )
        return Written(seal, body, has_files=False)
    return replace(_write(root, name, [body], headers, code), body=body)


def _write(
    root: Path, name: str, parts: Iterable[Buffer], headers: Mapping[str, str], code: str
) -> Written:
    """Write the files of a result, body first and seal last."""
    size = checksum = 0
    with atomic_write(_body(root, name)) as file:
        for part in parts:
            size += file.write(part)
            checksum = zlib.crc32(part, checksum)
    seal = ResultManifest(headers=dict(headers), size=size, crc32=checksum, code=code)
    with atomic_write(_seal(root, name)) as file:
        file.write(seal.model_dump_json().encode())
    return Written(seal, None, has_files=True)


class ResultStore:
    """The results under ``root``, at most ``capacity`` bytes; the least recently used go first.

    Small ones are in memory, up to ``memory`` bytes: all those that have no files, and some others.
    One process keeps the books. A result taken is not removed before it is given back, one that is
    held not before it is released.
    """

    def __init__(self, root: Path, capacity: int, memory: int) -> None:
        self._root = root
        self._capacity = capacity
        self._memory = memory
        self._small: OrderedDict[str, Written] = OrderedDict()
        self._small_total = 0
        self._sizes: OrderedDict[str, int] = OrderedDict()
        self._total = 0
        self._taken: Counter[str] = Counter()
        self._held: Counter[str] = Counter()

    def prepare(self) -> None:
        """Count what a former service left, the oldest first, and remove what has no seal."""
        self._root.mkdir(parents=True, exist_ok=True)
        bodies = sorted(self._root.glob("*/*.body"), key=lambda path: path.stat().st_mtime)
        for path in bodies:
            name = path.relative_to(self._root).with_suffix("").as_posix()
            if _seal(self._root, name).exists():
                self._count(name, path.stat().st_size)
            else:
                path.unlink()
        remove_partial(self._root)
        self._evict()

    @property
    def nbytes(self) -> int:
        """Size of all files of results."""
        return self._total

    async def find(self, name: str) -> Result | None:
        """Take the result ``name``, if it is there and whole."""
        if name in self._small:
            self._small.move_to_end(name)
            return self._take(name, self._small[name])
        if name not in self._sizes:
            return None
        self._taken[name] += 1  # held while it is read, off the event loop
        try:
            written = await to_thread.run_sync(_read, self._root, name)
            if written is not None:
                os.utime(_body(self._root, name))  # the order of use, for the next start
                self._keep_small(name, written)
                return self._take(name, written)
        finally:
            self._let_go(name)
        self._remove(name)
        return None

    def take_new(self, name: str, written: Written, *, is_kept: bool = True) -> Result:
        """Take the result that a worker has just written."""
        if is_kept:
            self._keep_small(name, written)
        return replace(self._take(name, written), is_kept=is_kept)

    def give_back(self, result: Result) -> None:
        """Say that ``result`` has been sent."""
        self._let_go(result.name)
        if not result.is_kept and result.name not in self._held:
            self._remove(result.name)
        self._evict()

    async def with_files(self, result: Result) -> Result:
        """Return a result that was taken, with files: written now, where it had none.

        It is given back where that fails.
        """
        written = result.written
        if written.has_files:
            return result
        assert written.body is not None, "what has no files is in memory"  # noqa: S101
        seal, body = written.seal, [written.body]
        try:
            await to_thread.run_sync(_write, self._root, result.name, body, seal.headers, seal.code)
        except BaseException:
            self.give_back(result)
            raise
        self._count(result.name, seal.size)
        filed = replace(written, has_files=True)
        if result.name in self._small:
            self._small[result.name] = filed
        return replace(result, written=filed)

    def has_room_to_hold(self, name: str) -> bool:
        """Tell whether all that is held would fit with the result ``name``."""
        return sum(self._sizes.get(held, 0) for held in {*self._held, name}) <= self._capacity

    def hold(self, name: str) -> None:
        """Do not remove the result ``name``, be it used or not."""
        self._held[name] += 1

    def release(self, name: str) -> None:
        """Say that whoever held the result ``name`` does so no longer."""
        self._held -= Counter([name])
        self._evict()

    def forget_mesh(self, mesh_id: str) -> None:
        """Remove all results of a mesh that are neither held nor just being sent."""
        names = {*self._sizes, *self._small}
        for name in [name for name in names if name.startswith(f"{mesh_id}/")]:
            if self._is_free(name):
                self._remove(name)

    def _take(self, name: str, written: Written) -> Result:
        if written.has_files:
            self._count(name, written.seal.size)
        self._taken[name] += 1
        return Result(name, _body(self._root, name), written)

    def _count(self, name: str, size: int) -> None:
        self._total += size - self._sizes.pop(name, 0)
        self._sizes[name] = size

    def _let_go(self, name: str) -> None:
        self._taken[name] -= 1
        if not self._taken[name]:
            del self._taken[name]

    def _evict(self) -> None:
        if self._total <= self._capacity:
            return
        for name in list(self._sizes):
            if self._is_free(name):
                self._remove(name)
            if self._total <= self._capacity:
                return

    def _is_free(self, name: str) -> bool:
        return name not in self._taken and name not in self._held

    def _keep_small(self, name: str, written: Written) -> None:
        if written.body is None or name in self._small:
            return
        self._small[name] = written
        self._small_total += written.seal.size
        while self._small_total > self._memory:
            self._forget_small(next(iter(self._small)))

    def _forget_small(self, name: str) -> None:
        if name in self._small:
            self._small_total -= self._small.pop(name).seal.size

    def _remove(self, name: str) -> None:
        self._forget_small(name)
        _seal(self._root, name).unlink(missing_ok=True)
        _body(self._root, name).unlink(missing_ok=True)
        self._total -= self._sizes.pop(name, 0)


def result_name(mesh_id: str, key: str) -> str:
    """Return the name under which the result ``key`` of a mesh is stored."""
    return f"{mesh_id}/{key}"


def sealed_results(root: Path) -> dict[str, tuple[Path, Path]]:
    """Return the files of each result that is complete on disk, by name."""
    seals = sorted(root.glob("*/*.json"))
    names = [seal.relative_to(root).with_suffix("").as_posix() for seal in seals]
    return {
        name: (_seal(root, name), _body(root, name)) for name in names if _body(root, name).exists()
    }


def read_seal(root: Path, name: str) -> ResultManifest | None:
    """Return the seal of the result ``name``, where it is what was written."""
    written = _read(root, name)
    return None if written is None else written.seal


def _body(root: Path, name: str) -> Path:
    return root / f"{name}.body"


def _seal(root: Path, name: str) -> Path:
    return root / f"{name}.json"


def _read(root: Path, name: str) -> Written | None:
    """Return a result, if it is whole."""
    checksum = size = 0
    small: list[bytes] = []
    try:
        seal = ResultManifest.model_validate_json(_seal(root, name).read_bytes())
        with _body(root, name).open("rb") as file:
            while chunk := file.read(2**20):
                checksum = zlib.crc32(chunk, checksum)
                size += len(chunk)
                if size <= _SMALL:
                    small.append(chunk)
    except (FileNotFoundError, ValidationError):
        return None
    if (size, checksum) != (seal.size, seal.crc32):
        return None
    return Written(seal, b"".join(small) if size <= _SMALL else None, has_files=True)

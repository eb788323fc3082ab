"""Compiled kernels on disk: one file for each, in the package or in the user's cache.

A file is found by the digest of all kernel sources, the version of Python, the machine, the
kernel's name and the types of its arguments. It is written in one step. While a process compiles a
kernel it holds a lock, and others that need the same kernel wait for it.

An empty file marks that all kernels of a workload are there. Its name holds a digest of the whole
library: an edited caller may call another kernel.
"""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
from numba.core import serialize
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys

from geodesic_core.errors import InvalidArgument
from geodesic_core.files import written
from geodesic_core.kernels.jit import machine

if TYPE_CHECKING:
    from filelock import FileLock

KERNELS = Path(__file__).parents[1]
PRECOMPILED = KERNELS / "precompiled"
"""Kernels that came with the package; not in a checkout."""
_DIGEST_BYTES = 32


def sources_digest() -> str:
    """Return a hash of all kernel sources and of numba's version: the version of the kernels.

    A compiled kernel holds the code of all that it calls, from any file: an edit of one makes all
    of them stale.
    """
    return _digest_of([*sorted(KERNELS.rglob("*.py")), KERNELS.parent / "tolerances.py"])


def _digest_of(sources: Iterable[Path]) -> str:
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    for path in sources:
        digest.update(path.relative_to(KERNELS.parent).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _digest() -> str:
    return sources_digest()


@cache
def _library_digest() -> str:
    """Return a hash of all sources of the library: any of them may call a kernel."""
    sources = sorted(KERNELS.parent.rglob("*.py"))
    return _digest_of(path for path in sources if path.name != "hatch_build.py")  # not installed


def users_folder() -> Path:
    """Return the root folder of the kernels that were compiled on this machine."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(os.environ.get("NUMBA_CACHE_DIR") or home / "geodesic" / "kernels")


def folder_for(target: str) -> Path:
    """Return the user's folder of kernels compiled for a machine."""
    return users_folder() / _digest() / machine.tag(target)


def folder() -> Path:
    """Return the folder that this process writes kernels to."""
    return folder_for(machine.target())


@cache
def folders() -> list[Path]:
    """Return the folders to search, in order."""
    tags = [machine.tag(level) for level in machine.levels()]
    places = [base / _digest() / tag for base in (PRECOMPILED, users_folder()) for tag in tags]
    return list(dict.fromkeys([*places, folder()]))


@dataclass(frozen=True)
class StoredKernel:
    """A kernel for some types of arguments, on disk or to be written there."""

    file_name: str
    is_storable: bool
    """False without a source file: its version is unknown then."""

    @classmethod
    def of(cls, function: Callable[..., Any], arguments: tuple[Any, ...]) -> "StoredKernel":
        """Return the stored kernel of a function."""
        version = hashlib.sha256(str(arguments).encode())
        source = Path(function.__code__.co_filename)
        if source.is_file() and not source.is_relative_to(KERNELS):  # the digest leaves it out
            version.update(source.read_bytes())
        module = function.__module__.removeprefix("geodesic_core.kernels.")
        name = f"{module}.{function.__name__}-{version.hexdigest()[:16]}.kernel"
        return cls(name, is_storable=source.is_file())

    def load(self, context: Any) -> Any:
        """Return the compiled kernel, from the first folder that has it; None where none has."""
        for place in folders() if self.is_storable else ():
            try:
                stored = (place / self.file_name).read_bytes()
            except OSError:
                continue
            digest, data = stored[:_DIGEST_BYTES], stored[_DIGEST_BYTES:]
            if hashlib.sha256(data).digest() == digest:  # else the disk lost some of it
                # Numba's runtime, which the code calls, and not all of numba's functions, which
                # `context.refresh` would load in 0.4 s.
                rtsys.initialize(context)
                rebuild: Any = CompileResult._rebuild
                return rebuild(context, *serialize.loads(data))
        return None

    def save(self, compiled: Any) -> None:
        """Write the compiled kernel into the user's cache, whole or not at all.

        The disk may be full: then a warning says so, and the kernel serves this process alone.
        """
        if self.is_storable and _is_writable():
            dump: Any = serialize.dumps
            *parts, environments = compiled._reduce()
            # Code reads constants from them, nothing else, and each imports its module when loaded.
            with_constants = tuple(each for each in environments if each.consts)
            data = dump((*parts, with_constants))
            try:
                with written(folder() / self.file_name) as file:  # by the holder of the lock alone
                    file.write(hashlib.sha256(data).digest() + data)
            except InvalidArgument as error:
                _warn(error.__cause__)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Hold the lock of the kernel, so that one process alone compiles it."""
        if self.is_storable and _is_writable():
            from filelock import FileLock  # not needed where all is compiled

            with FileLock((folder() / self.file_name).with_suffix(".lock")):
                yield
        else:
            yield


@cache
def _is_writable() -> bool:
    """Return whether kernels can be written, and warn once where they cannot."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder()):
            return True
    except OSError as error:
        _warn(error)
        return False


def _warn(error: BaseException | None) -> None:
    message = (
        f"kernels are compiled again in each process, since they cannot be written to the cache "
        f"({error}); set NUMBA_CACHE_DIR to another folder"
    )
    warnings.warn(message, RuntimeWarning, stacklevel=2)


def is_in_use() -> bool:
    """Return whether kernels are compiled at all, and can be written."""
    config: Any = numba.config
    return not config.DISABLE_JIT and _is_writable()


def claim(workload: str, timeout: float) -> "FileLock":
    """Return the lock of a workload, for the one process that runs it.

    Entering it raises filelock's Timeout after ``timeout`` seconds; with -1 it waits.
    """
    from filelock import FileLock

    return FileLock(folder() / f"{workload}.lock", timeout=timeout)


def mark_complete(workload: str) -> None:
    """Record that all kernels of a workload are on disk."""
    if not is_complete(workload) and is_in_use():
        (folder() / _mark_of(workload)).touch()


def is_complete(workload: str, places: Sequence[Path] | None = None) -> bool:
    """Return whether one of some folders, by default all, has all kernels of a workload."""
    return any((place / _mark_of(workload)).exists() for place in places or folders())


def _mark_of(workload: str) -> str:
    return f"{workload}-{_library_digest()}.all"

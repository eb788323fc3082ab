"""Bytes of a file, whether it comes as a path, bytes or a file object, packed or not."""

import bz2
import codecs
import gzip
import io
import lzma
import os
import zipfile
import zlib
from collections.abc import Callable, Container
from functools import partial
from pathlib import Path, PurePath
from typing import Any, NamedTuple, Protocol, TypeGuard

from geodesic_core.control import Control
from geodesic_core.errors import FileTooLarge, InvalidMesh

_BLOCK = 1 << 16
_ZIP = b"PK\x03\x04"
_PROGRAMS: tuple[tuple[str, bytes, Callable[[io.BytesIO], Any]], ...] = (
    ("gzip", b"\x1f\x8b\x08", lambda packed: gzip.GzipFile(fileobj=packed)),
    ("bzip2", b"BZh", bz2.BZ2File),
    ("xz", b"\xfd7zXZ\0", lzma.LZMAFile),
)
"""Programs that pack a file, what their files begin with, and what opens these"""
_PACKED_SUFFIXES = (".gz", ".bz2", ".xz")
_ENCODINGS = (
    (codecs.BOM_UTF32_LE, "utf-32"),  # which begins as UTF-16 does
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (codecs.BOM_UTF8, "utf-8-sig"),
)
"""Byte order marks of text"""


class Readable(Protocol):
    """A file object, open for reading."""

    def read(self) -> Any:
        """Return the rest of the file, bytes or text."""


FileLike = str | os.PathLike[str] | bytes | bytearray | memoryview | Readable
"""A path, the bytes of a file, or a file object."""


class NamedBytes(NamedTuple):
    """The content of a file, and its name, empty where it has none."""

    name: str
    data: bytes

    @property
    def suffix(self) -> str:
        """What follows the last dot of the name, in lower case, but for that of a packed file."""
        path = PurePath(self.name)
        if path.suffix.lower() in _PACKED_SUFFIXES:
            path = path.with_suffix("")
        return path.suffix.lower().removeprefix(".")


def is_file(value: Any) -> TypeGuard[FileLike]:
    """Tell whether a value is a `FileLike`."""
    kinds = (str, os.PathLike, bytes, bytearray, memoryview)
    return isinstance(value, kinds) or hasattr(value, "read")


def read_unpacked(
    source: FileLike, suffixes: Container[str], max_bytes: int | None, control: Control
) -> NamedBytes:
    """Return a file's content, unpacked if it comes from zip, gzip, bzip2 or xz.

    A zip archive must hold one file of the ``suffixes``, or NumPy's arrays, which stay in it. Text
    in UTF-16 or UTF-32 becomes UTF-8, and no text begins with a byte order mark.

    Raises
    ------
    InvalidMesh
        It cannot be read or unpacked; an archive holds none of these files, or several.
    FileTooLarge
        Unpacked, it has more than ``max_bytes``.
    Cancelled
        The ``control`` says so.
    """
    file = _read(source)
    if file.data.startswith(_ZIP):
        file = _only_member(file.data, suffixes, max_bytes, control)
    for program, magic, opened in _PROGRAMS:
        if file.data.startswith(magic):
            packed = io.BytesIO(file.data)
            return _decoded(
                file.name, _unpack(program, partial(opened, packed), max_bytes, control)
            )
    return _decoded(*file)


def _read(source: FileLike) -> NamedBytes:
    if isinstance(source, bytes | bytearray | memoryview):
        return NamedBytes("", bytes(source))
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        try:
            return NamedBytes(path.name, path.read_bytes())
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InvalidMesh(f"cannot read {path}: {reason}") from error
    if not hasattr(source, "read"):
        kind = type(source).__name__
        raise InvalidMesh(f"{kind} is no file: give a path, bytes or an open file")
    try:
        data = source.read()
    except (OSError, ValueError) as error:
        raise InvalidMesh(f"cannot read the open file: {error}") from error
    name = getattr(source, "name", "")
    return NamedBytes(
        PurePath(name).name if isinstance(name, str) else "",  # a pipe's is a number
        data.encode() if isinstance(data, str) else bytes(data),
    )


def _only_member(
    data: bytes, suffixes: Container[str], max_bytes: int | None, control: Control
) -> NamedBytes:
    """Return the one file of these suffixes in a zip archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if _is_content(name)]
            if names and all(name.endswith(".npy") for name in names):
                unpacked = sum(entry.file_size for entry in archive.infolist())
                if max_bytes is not None and unpacked > max_bytes:
                    raise FileTooLarge(max_bytes)
                return NamedBytes("arrays.npz", data)
            chosen = [name for name in names if NamedBytes(name, b"").suffix in suffixes]
            if len(chosen) != 1:
                held = ", ".join((chosen or names)[:5]) or "nothing"
                raise InvalidMesh(
                    "the file is a zip archive, which must hold one mesh; it holds "
                    f"{len(chosen) or 'none'}: {held}"
                )
            name = chosen[0]
            return NamedBytes(name, _unpack("zip", partial(archive.open, name), max_bytes, control))
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        what = " ".join(str(error).split())[:100]  # which may hold any part of the file
        raise InvalidMesh(f"the file is a damaged zip archive: {what}") from error


def _is_content(name: str) -> bool:
    """Tell whether an entry of an archive is its user's: macOS adds hidden ones."""
    return not name.endswith("/") and not any(
        part.startswith((".", "__MACOSX")) for part in PurePath(name).parts
    )


def _unpack(
    program: str, opened: Callable[[], Any], max_bytes: int | None, control: Control
) -> bytes:
    content = bytearray()
    try:
        with opened() as file:
            while block := file.read(_BLOCK):
                control.checkpoint(0.0)
                content += block
                if max_bytes is not None and len(content) > max_bytes:
                    raise FileTooLarge(max_bytes)
    # RuntimeError: the archive is encrypted
    except (OSError, EOFError, RuntimeError, zlib.error, lzma.LZMAError) as error:
        raise InvalidMesh(f"{program} cannot unpack the file: {error}") from error
    return bytes(content)


def _decoded(name: str, data: bytes) -> NamedBytes:
    for mark, encoding in _ENCODINGS:
        if data.startswith(mark):
            if encoding == "utf-8-sig":
                return NamedBytes(name, data.removeprefix(mark))
            try:
                return NamedBytes(name, data.decode(encoding).encode())
            except UnicodeDecodeError as error:
                raise InvalidMesh(f"the text is damaged, at byte {error.start}: {error}") from error
    return NamedBytes(name, data)

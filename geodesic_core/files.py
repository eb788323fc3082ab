"""Files that are written: each as a whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from geodesic_core.errors import InvalidArgument


def as_output(path: str | Path, *suffixes: str) -> Path:
    """Return the path of a file to write, which must end in one of the suffixes.

    Raises
    ------
    InvalidArgument
        It does not, or its folder is not there.
    """
    if not isinstance(path, str | Path):
        raise InvalidArgument(f"path is {path!r}; it must be a string or a Path")
    file = Path(path)
    if file.suffix.lower() not in suffixes:
        *others, last = suffixes
        ends = f"{', '.join(others)} or {last}" if others else last
        raise InvalidArgument(f"path is {str(path)!r}; it must end in {ends}")
    if not file.absolute().parent.is_dir():
        raise InvalidArgument(f"cannot write {path}: its folder does not exist")
    return file


@contextmanager
def written(path: Path) -> Iterator[IO[bytes]]:
    """Yield a file beside a path, which takes its place once the block has ended well.

    Raises
    ------
    InvalidArgument
        It cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        try:
            with part.open("wb") as file:
                yield file
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise InvalidArgument(f"cannot write {path}: {error.strerror}") from error

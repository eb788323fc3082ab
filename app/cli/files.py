"""Output files: each is written as a whole or not at all."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from app.cli.steps import Failure

if TYPE_CHECKING:
    from app.encoding import Answer


def write_answer(path: Path, answer: "Answer") -> None:
    """Write an answer in the format that the suffix of a path names."""
    write_file(path, encoded(answer, path.suffix.lower().removeprefix(".")))


def encoded(answer: "Answer", name: str) -> Iterable[bytes | memoryview]:
    """Return the parts of an answer in the format of a name."""
    from app.encoding import FORMATS, Representation, encode

    parts, _ = encode(answer, Representation(FORMATS[name]))
    return parts


def write_file(path: Path, parts: Iterable[bytes | memoryview]) -> None:
    """Write the parts of a file, as a whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    with writing(path):
        try:
            with part.open("wb") as file:
                file.writelines(parts)
            part.replace(path)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise `Failure` where the block cannot write a file."""
    try:
        yield
    except OSError as error:
        raise Failure(f"cannot write {path}: {error.strerror or error}") from error

"""Files of brain imaging: their names, nibabel, and how what is wrong with one is told."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from geodesic_core.errors import GeodesicError, InvalidArgument, InvalidMesh
from geodesic_core.extras import extra


def nibabel(module: str, call: str) -> Any:
    """Return a module of nibabel, of whose types little is declared.

    Raises
    ------
    MissingExtra
        It is not installed.
    """
    with extra("brain", "nibabel", call):
        return import_module(f"nibabel.{module}")


def kind_of(path: Path, wanted: Sequence[str]) -> str:
    """Return the suffix of a path that is one of some kinds, such as ``.dconn.nii``.

    Raises
    ------
    InvalidArgument
        It ends in none of them.
    """
    for kind in wanted:
        if path.name.lower().endswith(kind):
            return kind
    raise InvalidArgument(f"{path} must end in {', '.join(wanted)}")


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Name the file in what is refused inside, and refuse it where a parser fails in any way.

    Raises
    ------
    InvalidArgument
        It is not what it should be, in words such as "CIFTI-2 file".
    """
    try:
        yield
    except InvalidMesh as error:
        raise InvalidArgument(str(error)) from error
    except GeodesicError as error:
        error.args = (f"{path}: {error}",)
        raise
    except Exception as error:  # any failure of a parser
        why = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidArgument(f"{path} is no {what}: {why}") from error

"""Extras: packages that few calls need, and that may not be installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from geodesic_core.errors import MissingExtra


@contextmanager
def extra(name: str, package: str, call: str) -> Iterator[None]:
    """Have the imports inside raise `MissingExtra` where they find nothing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtra(call, package, name) from error

"""Errors of databases, as those of the system that the service tells apart."""

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import exc
from sqlalchemy.exc import DBAPIError, InterfaceError, InternalError, OperationalError

from app.errors import StateUnavailableError
from app.store.layout import StoreError


class StateError(StoreError):
    """A database that the service cannot start with; the message says why, and what to do."""


_NO_ROOM = frozenset(
    {
        sqlite3.SQLITE_FULL,
        sqlite3.SQLITE_IOERR_FSYNC,
        sqlite3.SQLITE_IOERR_SHMSIZE,
        sqlite3.SQLITE_IOERR_TRUNCATE,
        sqlite3.SQLITE_IOERR_WRITE,  # beyond a quota, for example
    }
)
"""Codes of SQLite where the disk takes no more"""
_READ_ONLY = frozenset({sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY})
"""Primary codes where it cannot be written at all"""


def line_of(error: Exception) -> str:
    """Return what a database says of an error, as one line."""
    return " ".join(str(getattr(error, "orig", error)).split())


@contextmanager
def as_os_errors() -> Iterator[None]:
    """Raise errors of a database as ``OSError``.

    Its ``errno`` is ``ENOSPC`` where the disk of SQLite is full, and ``EROFS`` where it can only be
    read. Where PostgreSQL does not answer, it is ``StateUnavailableError``; then nobody knows
    whether a change was made.
    """
    try:
        yield
    except DBAPIError as error:
        if isinstance(error.orig, sqlite3.Error):
            raise OSError(_number_of(error.orig), line_of(error)) from error
        if isinstance(error, OperationalError | InterfaceError | InternalError):
            raise StateUnavailableError(line_of(error)) from error
        raise
    except exc.TimeoutError as error:  # no connection was free
        raise StateUnavailableError(line_of(error)) from error


def _number_of(error: sqlite3.Error) -> int:
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)
    if code in _NO_ROOM:
        return errno.ENOSPC
    return errno.EROFS if code & 0xFF in _READ_ONLY else errno.EIO


def is_of_disk(error: DBAPIError) -> bool:
    """Tell whether an error of SQLite says that its disk, not its content, is the reason."""
    return isinstance(error.orig, sqlite3.Error) and _number_of(error.orig) != errno.EIO

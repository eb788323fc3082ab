"""The interface to a database: the same statements, whichever database runs them."""

from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager
from typing import Any, Protocol


class StateError(Exception):
    """A database that the service cannot start with; the message says why, and what to do."""


class Statements(Protocol):
    """Statements with ``?`` for each value; see `app.state.schema` for the tables.

    Every method raises ``OSError``. Where the database is a file, its ``errno`` is ``ENOSPC`` if
    the disk is full, and ``EROFS`` if it can only be read. Where it is a server that does not
    answer, the error is ``StateUnavailableError``; then nobody knows whether a change was made.
    """

    async def rows(self, statement: str, *values: Any) -> Sequence[Any]:
        """Return the rows that a statement yields."""

    async def run(self, statement: str, *values: Any) -> int:
        """Run a statement; return the number of rows that it changed."""

    async def run_on_reserve(self, statement: str, *values: Any) -> int:
        """Do the same on a full disk as well: for changes of what is there, and removals."""


class Database(Statements, Protocol):
    """A database, each statement of which is a transaction."""

    is_shared: bool
    """Whether several services may use it at the same time"""
    service: str | None
    """What names the services that share it; None where it is a file of one"""
    clock: str
    """The seconds since 1970 by the clock of the database, as an expression of its SQL"""

    def prepare(self) -> None:
        """Create the tables that are missing, and verify that the database can be used.

        Raises
        ------
        StateError
            It is a server that cannot be used.
        StoreError
            It is a file that is damaged, or cannot be written.
        """

    async def open(self) -> None:
        """Open the database."""

    async def close(self) -> None:
        """Close the database."""

    def alone(self, name: str) -> AbstractAsyncContextManager[Statements]:
        """Run the statements of the block one block of this ``name`` at a time.

        On a server they are one transaction; in a file, a crash may come between them.
        """

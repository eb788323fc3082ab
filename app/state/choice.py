"""Choice of the database: SQLite in the folder of the store, or PostgreSQL by its URL."""

from pathlib import Path
from types import ModuleType
from typing import Any

from app.settings import variable_of
from app.state.database import Database, StateError
from app.state.sqlite import SqliteDatabase


def database_of(path: Path, url: str | None) -> Database:
    """Return the database at ``url``; SQLite in the file ``path`` where there is none.

    Raises
    ------
    StateError
        The extra that PostgreSQL needs is not installed.
    """
    if url is None:
        return SqliteDatabase(path)
    database: Database = _postgres().PostgresDatabase(url)
    return database


def read_shared_database(url: str, statement: str) -> tuple[str, list[Any]]:
    """Return what names the services that share the database at ``url``, and rows of it.

    Raises
    ------
    StateError
        As `database_of` does; or the server cannot be used.
    """
    service, rows = _postgres().read(url, statement)
    return service, rows


def _postgres() -> ModuleType:
    try:
        from app.state import postgres  # an extra, and half a second
    except ImportError as error:
        extra = "pip install geodesic[cluster]"
        raise StateError(f"{variable_of('state')} needs {error.name}: {extra}") from error
    return postgres

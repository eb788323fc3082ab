"""Revisions of the tables in PostgreSQL, each applied once, by Alembic."""

from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.util import CommandError
from psycopg import Connection
from sqlalchemy import create_engine, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.pool import StaticPool

from app.settings import variable_of
from app.state.database import StateError


def upgrade(connection: Connection[Any]) -> None:
    """Apply the revisions that a database lacks, in one transaction, one service at a time.

    Raises
    ------
    StateError
        A newer release has been there.
    psycopg.Error
        The server refuses, or is away.
    """
    engine = create_engine(
        "postgresql+psycopg://", creator=lambda: connection, poolclass=StaticPool
    )
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent))
    # With autocommit there would be no transaction, and each statement would release the lock.
    connection.autocommit = False
    try:
        with engine.begin() as transaction:
            transaction.execute(text("SELECT pg_advisory_xact_lock(hashtextextended('schema', 0))"))
            config.attributes["connection"] = transaction
            command.upgrade(config, "head")
    except CommandError as error:
        detail = "a newer release of the service has upgraded the database"
        raise StateError(f"{detail} of {variable_of('state')}: use that release") from error
    except DBAPIError as error:
        raise error.orig or error from None
    finally:
        if not connection.closed:
            connection.autocommit = True

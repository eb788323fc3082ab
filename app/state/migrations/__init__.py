"""Revisions of the tables, each applied once, by Alembic."""

from pathlib import Path

from sqlalchemy import Connection, insert, inspect, select

from app.state.errors import StateError
from app.state.schema import BEFORE_ALEMBIC, HEAD, metadata, revision


def bring_up_to_date(connection: Connection) -> None:
    """Create the tables that are missing, and apply the revisions that others lack.

    Raises
    ------
    StateError
        A newer release has been there.
    """
    is_new = not inspect(connection).has_table("jobs")
    metadata.create_all(connection)
    found = connection.scalar(select(revision.c.version_num))
    if found is None:
        found = HEAD if is_new else BEFORE_ALEMBIC
        connection.execute(insert(revision).values(version_num=found))
    if found != HEAD:
        _upgrade(connection)


def _upgrade(connection: Connection) -> None:
    from alembic import command  # a quarter of a second, and hardly ever needed
    from alembic.config import Config
    from alembic.util import CommandError

    config = Config(attributes={"connection": connection})
    config.set_main_option("script_location", str(Path(__file__).parent))
    try:
        command.upgrade(config, HEAD)
    except CommandError as error:
        message = "a newer release of the service has upgraded the database: use that release"
        raise StateError(message) from error

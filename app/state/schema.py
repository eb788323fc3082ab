"""The tables, in SQLite and in PostgreSQL.

A table changes by a revision in `app.state.migrations.versions`, whose number becomes `HEAD`.
Databases that are new have the tables from here.
"""

from sqlalchemy import (
    JSON,
    BigInteger,
    Column,
    Computed,
    Double,
    Identity,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    cast,
    extract,
    func,
)

HEAD = "0004"
"""The last revision"""
BEFORE_ALEMBIC = "0002"
"""The revision of files of SQLite that have no number of theirs"""

metadata = MetaData()


def _computed(name: str, expression: str, *, unique: bool | None = None) -> Column[str]:
    """Return a column of text that the database computes from the record of a job."""
    return Column(name, Text, Computed(expression, persisted=True), unique=unique)


jobs = Table(
    "jobs",
    metadata,
    Column(
        "number",
        BigInteger().with_variant(Integer, "sqlite"),
        Identity(always=True),
        primary_key=True,
    ),
    Column("record", JSON, nullable=False),
    _computed("id", "record ->> 'id'", unique=True),
    _computed("idempotency_key", "record -> 'errand' ->> 'idempotency_key'"),
    _computed("status", "record ->> 'status'"),
    _computed("finished", "record ->> 'finished'"),
    Index("jobs_by_key", "idempotency_key"),
    Index("jobs_by_end", "finished"),
    sqlite_autoincrement=True,  # numbers of removed jobs do not come again
)

queries = Table(  # apart from jobs, since they may be large, and records change often
    "queries",
    metadata,
    Column("job_id", Text, primary_key=True),
    Column("query", LargeBinary, nullable=False),
)

# The next is used only where several services share PostgreSQL.

CLOCK = cast(extract("epoch", func.clock_timestamp()), Double)
"""The seconds since 1970 by the clock of the database"""

meshes = Table(
    "meshes",
    metadata,
    Column("id", Text, primary_key=True),
    Column("size", BigInteger, nullable=False),
    Column("used", Double, nullable=False),
    Column("pinned", Double, nullable=False),
)

revision = Table(  # Alembic's own
    "alembic_version", metadata, Column("version_num", String(32), primary_key=True)
)

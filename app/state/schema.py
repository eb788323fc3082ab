"""Tables, in words that SQLite and PostgreSQL share but for the types in braces.

Each revision is a list of statements, which may be run again: SQLite runs all when its file is
opened, and PostgreSQL those that it lacks, by Alembic (`app.state.migrations`). Once released, a
revision does not change; add another, and a module to the migrations.
"""

from collections.abc import Mapping, Sequence

REVISIONS: Mapping[str, Sequence[str]] = {
    "0001": (
        """
        CREATE TABLE IF NOT EXISTS jobs (
            number {number},
            record {json} NOT NULL,
            id TEXT UNIQUE GENERATED ALWAYS AS (record ->> 'id') {computed},
            owner TEXT GENERATED ALWAYS AS (record -> 'errand' ->> 'owner') {computed},
            idempotency_key TEXT
                GENERATED ALWAYS AS (record -> 'errand' ->> 'idempotency_key') {computed},
            status TEXT GENERATED ALWAYS AS (record ->> 'status') {computed},
            finished TEXT GENERATED ALWAYS AS (record ->> 'finished') {computed}
        )
        """,
        # What has no owner has none in the record; COALESCE, since only SQLite finds NULL by index.
        "CREATE INDEX IF NOT EXISTS jobs_of_owner ON jobs (COALESCE(owner, ''), number)",
        """
        CREATE INDEX IF NOT EXISTS jobs_of_key ON jobs (COALESCE(owner, ''), idempotency_key)
            WHERE idempotency_key IS NOT NULL
        """,
        "DROP INDEX IF EXISTS jobs_by_owner",  # of earlier releases, as the next
        "DROP INDEX IF EXISTS jobs_by_key",
        "CREATE INDEX IF NOT EXISTS jobs_by_end ON jobs (finished)",
        # Queries have a table of their own, since they may be large, and records change often.
        "CREATE TABLE IF NOT EXISTS queries (job_id TEXT PRIMARY KEY, query {bytes} NOT NULL)",
        "CREATE TABLE IF NOT EXISTS replicas (id TEXT PRIMARY KEY, beats BIGINT NOT NULL)",
        """
        CREATE TABLE IF NOT EXISTS meshes (
            id TEXT PRIMARY KEY,
            size BIGINT NOT NULL,
            owner TEXT,
            used DOUBLE PRECISION NOT NULL,
            pinned DOUBLE PRECISION NOT NULL
        )
        """,
        "CREATE TABLE IF NOT EXISTS rates (caller TEXT PRIMARY KEY, due DOUBLE PRECISION NOT NULL)",
        """
        CREATE TABLE IF NOT EXISTS running (
            replica TEXT NOT NULL,
            kind TEXT NOT NULL,
            caller TEXT NOT NULL,
            count BIGINT NOT NULL,
            PRIMARY KEY (replica, kind, caller)
        )
        """,
    ),
    "0002": (
        "DROP TABLE IF EXISTS replicas",
        "DROP TABLE IF EXISTS running",
        """
        CREATE TABLE IF NOT EXISTS work (
            id TEXT PRIMARY KEY,
            kind TEXT NOT NULL,
            caller TEXT NOT NULL,
            ends DOUBLE PRECISION NOT NULL
        )
        """,
    ),
}

SQLITE = {
    "number": "INTEGER PRIMARY KEY AUTOINCREMENT",
    "json": "TEXT",
    "bytes": "BLOB",
    "computed": "VIRTUAL",
}
POSTGRESQL = {
    "number": "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY",
    "json": "JSON",
    "bytes": "BYTEA",
    "computed": "STORED",
}


def statements(revision: str, words: Mapping[str, str]) -> list[str]:
    """Return the statements of a revision in the ``words`` of a database."""
    return [statement.format(**words) for statement in REVISIONS[revision]]

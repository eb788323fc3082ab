"""State that outlives a process: SQLite for one service, PostgreSQL for several that share it."""

from app.state.allowances import Allowances
from app.state.choice import database_of, read_shared_database
from app.state.database import Database, StateError, Statements
from app.state.mesh_records import MeshRecords
from app.state.sqlite import SqliteDatabase, read_database, require_intact

__all__ = [
    "Allowances",
    "Database",
    "MeshRecords",
    "SqliteDatabase",
    "StateError",
    "Statements",
    "database_of",
    "read_database",
    "read_shared_database",
    "require_intact",
]

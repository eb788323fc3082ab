"""State that outlives a process: SQLite for one service, PostgreSQL for several that share it."""

from app.state.database import Database, require_intact
from app.state.errors import StateError

__all__ = ["Database", "StateError", "require_intact"]

"""State that outlives a process: SQLite for one service, PostgreSQL for several that share it."""

from app.state.allowances import Allowances
from app.state.database import Database, require_intact
from app.state.errors import StateError
from app.state.mesh_records import MeshRecords

__all__ = ["Allowances", "Database", "MeshRecords", "StateError", "require_intact"]

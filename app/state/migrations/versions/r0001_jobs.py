"""The first tables: jobs and their queries, replicas, meshes, rates, and running work."""

from alembic import op

from app.state.schema import POSTGRESQL, statements

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Create the tables."""
    for statement in statements(revision, POSTGRESQL):
        op.execute(statement)

"""Work under way has a row each, and services have none."""

from alembic import op

from app.state.schema import POSTGRESQL, statements

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Change the tables."""
    for statement in statements(revision, POSTGRESQL):
        op.execute(statement)

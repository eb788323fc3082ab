"""Indexes without expressions, which SQLAlchemy's conditions on NULL can use."""

from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Replace the indexes of jobs."""
    op.drop_index("jobs_of_owner", "jobs", if_exists=True)
    op.drop_index("jobs_of_key", "jobs", if_exists=True)
    op.create_index("jobs_by_owner", "jobs", ["owner", "number"])
    op.create_index("jobs_by_key", "jobs", ["idempotency_key"])

"""Jobs and meshes have no owner, and each service counts what callers do by itself."""

from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Drop the owners, and the counts."""
    op.drop_index("jobs_by_owner", "jobs")
    for table in ("jobs", "meshes"):
        op.drop_column(table, "owner")
    for table in ("rates", "work"):
        op.drop_table(table, if_exists=True)

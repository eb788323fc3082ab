"""Jobs and meshes have no owner: all keys of a service share them."""

from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Drop the owners."""
    op.drop_index("jobs_by_owner", "jobs")
    for table in ("jobs", "meshes"):
        op.drop_column(table, "owner")

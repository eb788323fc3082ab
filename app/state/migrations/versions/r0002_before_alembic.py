"""The tables as they were when SQLite had no revisions yet."""

revision = "0002"
down_revision = None


def upgrade() -> None:
    """Change nothing: there is no older database."""

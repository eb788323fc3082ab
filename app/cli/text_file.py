"""Text files that options name."""

from pathlib import Path

import typer


def lines_of(file: Path) -> list[str]:
    """Return the lines of a file; raise ``BadParameter`` where it cannot be read."""
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise typer.BadParameter(f"cannot read {file}: it is not text in UTF-8") from None
    except OSError as error:
        raise typer.BadParameter(f"cannot read {file}: {error.strerror}") from None

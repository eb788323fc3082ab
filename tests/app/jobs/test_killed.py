"""A service that dies during jobs; ``tests.support.killed_jobs`` is what runs and checks it."""

import subprocess
import sys

import pytest

from tests.support.paths import ROOT

SOME = 11
"""Of this many steps one is tried, but for ``--full``"""


@pytest.mark.slow
@pytest.mark.slice(1)
@pytest.mark.parametrize("compute", ["cheap", "dear"])
def test_a_service_killed_at_any_step_of_a_job_loses_nothing(
    compute: str, pytestconfig: pytest.Config
) -> None:
    """Whether the service writes the answer or a worker does; a job that kills it fails at last."""
    every = 1 if pytestconfig.option.full else SOME
    command = [sys.executable, "-m", "tests.support.killed_jobs", compute, str(every)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S603 - this Python
    assert ran.returncode == 0, ran.stderr
    steps, steps_of_restart = map(int, ran.stdout.splitlines()[-1].split())  # log lines before
    assert steps > 40
    assert steps_of_restart > 20

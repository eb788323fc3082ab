"""The campaign as a benchmark: each failure in turn, on one deployment, and a report."""

from pathlib import Path

from benchmarks.failures.failures import FAILURES
from benchmarks.failures.report import write_report
from benchmarks.failures.trial import SCALE, SETTINGS, try_out
from benchmarks.soak.reference import make_plan
from tests.support.deployment import deployed
from tests.support.machines import obstacle


def run(path: Path) -> str:
    """Let each failure happen; write the report into ``path`` and return it."""
    if obstacle():
        raise RuntimeError(obstacle())
    plan = make_plan(SCALE)
    with deployed(**SETTINGS) as deployment:
        trials = [try_out(deployment, plan, failure) for failure in FAILURES]
    return write_report(trials, path)

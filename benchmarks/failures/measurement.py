"""The campaign as a benchmark: each failure in turn, on one deployment, and a report."""

from pathlib import Path

from benchmarks.failures.failures import FAILURES
from benchmarks.failures.plan import make_load
from benchmarks.failures.report import write_report
from benchmarks.failures.trial import SETTINGS, try_out
from tests.support.deployment import deployed
from tests.support.machines import obstacle


def run(path: Path) -> str:
    """Let each failure happen; write the report into ``path`` and return it."""
    if obstacle():
        raise RuntimeError(obstacle())
    load, trials, text = make_load(), [], ""
    with deployed(**SETTINGS) as deployment:
        for failure in FAILURES:
            trials.append(try_out(deployment, load, failure))
            text = write_report(trials, path)  # each time, for those who cannot wait
    return text

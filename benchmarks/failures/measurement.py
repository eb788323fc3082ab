"""The campaign as a benchmark: each failure in turn, some again with TLS, and a report."""

from pathlib import Path

from benchmarks.failures.failures import FAILURES, WITH_TLS
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
    for failures, tls in ((FAILURES, False), (WITH_TLS, True)):
        with deployed(tls=tls, **SETTINGS) as deployment:
            for failure in failures:
                trials.append(try_out(deployment, load, failure))
                text = write_report(trials, path)  # each time, for those who cannot wait
    return text

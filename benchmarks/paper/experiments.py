"""All experiments of the paper, by one command."""

from collections.abc import Iterator

from benchmarks.inputs import Inputs
from benchmarks.paper import distribution, published, spheres, table1, windows
from benchmarks.paper.report import Report, write_report

COMMAND = "scripts/bench paper"


def run(inputs: Inputs, runs: int) -> Iterator[str]:
    """Run each experiment, write its report, and yield its text."""
    for report in _reports(inputs, runs):
        yield write_report(report, COMMAND)


def _reports(inputs: Inputs, runs: int) -> Iterator[Report]:
    yield table1.run(inputs, runs)
    found = spheres.errors_by_level(spheres.LEVELS)
    yield spheres.table_2(found)
    yield spheres.figure_12(found)
    yield windows.figure_6({name: list(rows) for name, rows in published.FIGURE_6.items()}, runs)
    yield windows.figure_7(runs)
    yield distribution.run(inputs)

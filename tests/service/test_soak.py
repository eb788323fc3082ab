"""Mixed traffic on a service whose caches are small: every answer right, and no memory lost."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.soak.plan import SETTINGS, Expected, Plan
from benchmarks.soak.reference import SHORT, WHOLE, make_plan
from benchmarks.soak.trial import ALL, Trial, try_out
from tests.support.processes import Server

FEW_REQUESTS = 200
MANY_REQUESTS = 60_000
"""About ten minutes of traffic. After a fixed time, a busy machine would still fill its caches"""
MOST_GROWTH = 1.05

OUTCOMES = {
    "200",
    "201",
    "202",
    "204",
    "206",
    "304",
    "400 malformed_body",
    "404 mesh_not_found",
    "410 job_dismissed",
    "422 invalid_request",
    "504 deadline_exceeded",
    "client left",
}
"""What must have happened, among others, in any run that is long enough"""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A service with small bounds, whose log is checked at the end."""
    log = tmp_path / "log"
    server = Server(tmp_path / "store", log=log, **SETTINGS)
    yield server
    server.close()
    assert list(complaints(log)) == []


def soak(server: Server, plan: Plan, requests: int) -> Trial:
    """Send the traffic of a plan to a service, which loses no worker over it."""
    trial = try_out(plan, server.address, server.process.pid, requests=requests)
    assert trial.samples[-1].lost == 0
    return trial


def complaints(log: Path) -> Iterator[str]:
    """Yield the lines of a log that are neither about requests nor about the start."""
    for line in log.read_text().splitlines():
        if not line.startswith("{") or json.loads(line)["level"] not in ("info", "debug"):
            yield line


def test_every_answer_of_mixed_traffic_is_right(server: Server) -> None:
    plan = make_plan(SHORT)

    assert soak(server, plan, FEW_REQUESTS).faults == []

    # Else nobody would know that answers are looked at.
    mistaken = [replace(each, expected=Expected(digest="of another")) for each in plan.queries]
    faults = soak(server, replace(plan, queries=mistaken), FEW_REQUESTS // 4).faults
    assert faults
    assert all("another answer" in fault for fault in faults)


@pytest.mark.full
def test_mixed_traffic_takes_no_more_memory_in_the_long_run(server: Server) -> None:
    trial = soak(server, make_plan(WHOLE), MANY_REQUESTS)

    assert trial.faults == []
    assert {each.outcome for each in trial.exchanges} >= OUTCOMES
    for process in ("API", ALL):
        before, after = trial.medians(process)
        assert after <= MOST_GROWTH * before, process

"""Mixed traffic on a service whose caches are small: every answer right, and no memory lost."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.soak.plan import SETTINGS
from benchmarks.soak.reference import SHORT, WHOLE, Scale, make_plan
from benchmarks.soak.trial import ALL, Trial, try_out
from tests.support.processes import Server

FEW_REQUESTS = 600
WHOLE_S = 600.0
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
    "429 quota_exceeded",
    "504 deadline_exceeded",
    "client left",
}
"""What must have happened, among others, in any run that is long enough"""


def soak(folder: Path, scale: Scale, seconds: float = 0, requests: int = 0) -> Trial:
    """Send traffic to a service; check its answers, and that it logged nothing worse."""
    plan = make_plan(scale)
    server = Server(folder / "store", log=folder / "log", **SETTINGS)
    try:
        trial = try_out(
            plan, server.address, server.process.pid, seconds=seconds, requests=requests
        )
    finally:
        server.close()
    assert trial.faults == []
    assert list(complaints(folder / "log")) == []
    assert trial.samples[-1].lost == 0
    return trial


def complaints(log: Path) -> Iterator[str]:
    """Yield the lines of a log that are neither about requests nor about the start."""
    for line in log.read_text().splitlines():
        if not line.startswith("{") or json.loads(line)["level"] not in ("info", "debug"):
            yield line


def test_every_answer_of_mixed_traffic_is_right(tmp_path: Path) -> None:
    trial = soak(tmp_path, SHORT, requests=FEW_REQUESTS)

    assert len(trial.exchanges) >= FEW_REQUESTS


@pytest.mark.full
def test_ten_minutes_of_mixed_traffic_take_no_more_memory(tmp_path: Path) -> None:
    trial = soak(tmp_path, WHOLE, seconds=WHOLE_S)

    assert {each.outcome for each in trial.exchanges} >= OUTCOMES
    for process in ("API", ALL):
        before, after = trial.medians(process)
        assert after <= MOST_GROWTH * before, process

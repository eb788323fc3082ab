"""One failure under load: what clients saw, what became of promises, and when all was as before."""

import json
import pickle
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx2

from benchmarks.failures.failures import Failure
from benchmarks.failures.plan import Load
from benchmarks.soak.plan import MIB, SECRETS, digest_of
from benchmarks.soak.trial import ROOT, Exchange
from tests.support.deployment import Deployment, Replica
from tests.support.processes import total_time
from tests.support.waiting import LONG_S, wait_until

SETTINGS = {
    "GEODESIC_API_KEYS": ",".join(f"{name}:{secret}" for name, secret in SECRETS.items()),
    # Few answers are known already: most are computed.
    "GEODESIC_RESULTS_BYTES": str(4 * MIB),
    "GEODESIC_RESULTS_MEMORY_BYTES": "1",
    "GEODESIC_DEADLINE_S": str(LONG_S),
}
WORKERS = 4
"""Of two nodes: one for long work, and one for small work only"""
IDLE, BUSY = 'geodesic_workers{state="idle"}', 'geodesic_workers{state="busy"}'
BEFORE, AFTER = 200, 200
"""Requests that are answered before the failure, and after all is as before"""


@dataclass(frozen=True)
class Trial:
    """What was seen; times are those of ``time.monotonic``."""

    failure: Failure
    exchanges: Sequence[Exchange]
    begin: float
    """When something failed"""
    end: float
    """When it was over: the cable was back, or whatever supervises the command had started it"""
    as_before: float
    """When all workers were there again, and all replicas ready"""
    lost: Sequence[str]
    """Promises that were not kept"""
    promises: Mapping[str, int]
    restarts: Sequence[str]
    """Names of parts whose commands ended by themselves, and were started again"""
    idle_s: float
    """Seconds from the last answer until no worker had anything to do"""

    @property
    def faults(self) -> Sequence[str]:
        """What was wrong with answers."""
        return [each.fault for each in self.exchanges if each.fault]

    @property
    def refused(self) -> Sequence[Exchange]:
        """Requests that began or ended while something failed, and got no right answer."""
        return [
            each for each in self.exchanges if each.outcome[:1] in "045" and each.time > self.begin
        ]

    @property
    def slowest_refusal_s(self) -> float:
        """The longest time between a cause, or the request if that came later, and a refusal."""
        return max(
            (min(each.seconds, each.time - self.begin) for each in self.refused), default=0.0
        )

    @property
    def slowest_s(self) -> float:
        """The longest that a small question took which was asked before all was as before."""
        return max(
            (
                each.seconds
                for each in self.exchanges
                if each.operation.startswith("compute")
                and each.operation != "computeMatrix"
                and each.time > self.begin
                and each.time - each.seconds < self.as_before
            ),
            default=0.0,
        )


def try_out(deployment: Deployment, load: Load, failure: Failure) -> Trial:
    """Let something fail under load, and wait until all is as before."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        _restore(deployment)
        with _traffic(deployment, load, failure, folder) as record:
            _wait_for_answers(record, BEFORE)
            chosen = failure.choose(deployment)
            begin = time.monotonic()
            failure.happen(deployment, chosen)
            end = time.monotonic()
            restarts = _restore(deployment)
            as_before = time.monotonic()
            _wait_for_answers(record, len(_lines(record)) + AFTER)
        last = time.monotonic()
        _wait_until_idle(deployment)
        idle, promises = time.monotonic(), _lines(folder / "promises")
        return Trial(
            failure,
            [Exchange(**line) for line in _lines(record)],
            begin,
            end,
            as_before,
            list(_broken(deployment, failure, promises)),
            Counter(kind for each in promises for kind in ("job", "mesh") if kind in each),
            restarts,
            idle - last,
        )


@contextmanager
def _traffic(deployment: Deployment, load: Load, failure: Failure, folder: Path) -> Iterator[Path]:
    """Send traffic to all replicas inside the block; requests under way at its end get answers."""
    (folder / "load").write_bytes(pickle.dumps(load))
    record = folder / "record"
    options = [f"--refusal={status},{code}" for status, code in failure.refusals]
    if failure.breaks(deployment):
        options.append("--breaks")
    if failure.pause_s:
        options.append(f"--pause={failure.pause_s}")
    urls = [replica.url for replica in deployment.replicas]
    command = [sys.executable, "-m", "benchmarks.failures.traffic"]
    files = [str(folder / "load"), str(record), str(folder / "promises")]
    with (folder / "said").open("wb") as said:
        sending = subprocess.Popen(
            [*command, *files, *urls, *options], cwd=ROOT, stdout=said, stderr=said
        )
    try:
        wait_until(lambda: record.exists() or sending.poll() is not None)
        yield record
        sending.terminate()
        sending.wait(LONG_S)
    finally:
        sending.kill()
        sending.wait()
    if sending.returncode:
        raise RuntimeError(
            f"the traffic ended with {sending.returncode}: {(folder / 'said').read_text()}"
        )


def _lines(path: Path) -> list[dict[str, Any]]:
    *lines, _ = path.read_text().split("\n")  # the last one may be under way
    return [json.loads(line) for line in lines]


def _wait_for_answers(record: Path, count: int) -> None:
    def are_there() -> bool:
        time.sleep(0.5)  # a long record takes a while to read
        return record.read_bytes().count(b"\n") >= count

    wait_until(are_there)


def _restore(deployment: Deployment) -> Sequence[str]:
    """Wait until all workers are there, and known; return the names of parts that ended."""
    restarts: list[str] = []

    def is_whole() -> bool:
        restarts.extend(deployment.supervise())
        workers = sum(len(node.workers()) for node in deployment.nodes)
        return workers == WORKERS and all(_is_whole(each) for each in deployment.replicas)

    wait_until(is_whole)
    return restarts


def _wait_until_idle(deployment: Deployment) -> None:
    """Wait until replicas know of no work, and until no worker computes."""
    wait_until(lambda: all(_busy(replica) == 0 for replica in deployment.replicas))

    def taken() -> int:
        return sum(total_time(node.workers()) for node in deployment.nodes)

    before = taken()

    def stands_still() -> bool:
        nonlocal before
        time.sleep(0.2)
        now = taken()
        gained, before = now - before, now
        return gained < 20e6

    wait_until(stands_still)


def _busy(replica: Replica) -> float:
    return replica.metrics(SECRETS["alice"]).get(BUSY, 0.0)


def _is_whole(replica: Replica) -> bool:
    if not replica.is_ready():
        return False
    metrics = replica.metrics(SECRETS["alice"])
    states = [
        metrics.get(f'geodesic_workers{{state="{state}"}}', 0.0) for state in ("idle", "busy")
    ]
    return sum(states) == WORKERS


def _broken(
    deployment: Deployment, failure: Failure, promises: Sequence[Mapping[str, str]]
) -> Iterator[str]:
    """Yield what became of jobs and meshes that were answered with 2xx, where it is not right."""
    kept = {promise.get("kept") for promise in promises}
    open_ones = [each for each in promises if "kept" not in each and each.get("job") not in kept]
    for number, promise in enumerate(open_ones):
        replica = deployment.replicas[number % len(deployment.replicas)]
        key = {"Authorization": f"Bearer {SECRETS[promise['caller']]}"}
        if "mesh" in promise:
            answer = replica.ask(f"/v1/meshes/{promise['mesh']}", **key)
            is_kept = answer.status_code == 200
        else:
            answer = _ended_job(replica, promise["job"], key)
            is_kept = answer.status_code == 200 and digest_of(answer.content) == promise["digest"]
            if answer.status_code == 500:  # the right answer, where it is a documented one
                is_kept = (500, answer.json()["code"]) in failure.refusals
        if not is_kept:
            yield f"{promise}: {answer.status_code} {answer.text[:300]}"


def _ended_job(replica: Replica, link: str, key: Mapping[str, str]) -> httpx2.Response:
    """Return the results of a job once it has ended."""
    wait_until(lambda: replica.ask(link, **key).json()["finished"] is not None)
    return replica.ask(f"{link}/results", **key)

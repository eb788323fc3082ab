"""A soak of a service that runs: traffic on it, and its memory meanwhile."""

import http.client
import json
import pickle
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.soak.memory import memory_by_process
from benchmarks.soak.plan import SECRETS, Plan

PERIOD_S = 1.0
"""Seconds between two samples"""
ALL = "all"
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Sample:
    """The service at one moment."""

    time: float
    memory: Mapping[str, int]
    """Bytes by process"""
    evictions: Mapping[str, int]
    """How often something made room, by cache, since the service began"""
    open_files: int
    lost: int
    """Workers that died or were killed"""


@dataclass(frozen=True)
class Exchange:
    """A request as it went."""

    time: float
    operation: str
    outcome: str
    seconds: float
    fault: str


@dataclass(frozen=True)
class Trial:
    """What was seen; times count from the beginning."""

    exchanges: Sequence[Exchange]
    samples: Sequence[Sample]

    @property
    def faults(self) -> Sequence[str]:
        """What was wrong with answers."""
        return [each.fault for each in self.exchanges if each.fault]

    @property
    def full_since(self) -> float | None:
        """The time at which every cache had begun to evict; None where one never did."""
        return next((each.time for each in self.samples if all(each.evictions.values())), None)

    def medians(self, process: str) -> tuple[float, float]:
        """Return the median memory in the second and in the last third, bytes.

        The thirds are those of the time in which all caches were full. The memory is that of a
        process, or of all of them together (``ALL``).
        """
        if self.full_since is None:
            raise RuntimeError(f"a cache was never full: {self.samples[-1].evictions}")
        full = [each.memory for each in self.samples if each.time >= self.full_since]
        values = [sum(each.values()) if process == ALL else each.get(process, 0) for each in full]
        third = len(values) // 3
        return median(values[third : 2 * third]), median(values[2 * third :])

    @property
    def processes(self) -> Sequence[str]:
        """The processes that were there at the end."""
        return list(self.samples[-1].memory)


def try_out(
    plan: Plan, address: tuple[str, int], service: int, *, seconds: float = 0, requests: int = 0
) -> Trial:
    """Send the traffic of a plan to a service, for some seconds or until some number of requests.

    The service has the ``SETTINGS``, and ``service`` is the id of its process.
    """
    with tempfile.TemporaryDirectory() as folder:
        planned, record = Path(folder, "plan"), Path(folder, "record")
        planned.write_bytes(pickle.dumps(plan))
        bound = ["--seconds", str(seconds)] if seconds else ["--requests", str(requests)]
        url, begin = f"http://{address[0]}:{address[1]}", time.monotonic()
        traffic = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.soak.traffic", planned, record, url, *bound],
            cwd=ROOT,
        )
        samples = []
        try:
            while traffic.poll() is None:
                samples.append(_sample(address, service, begin))
                time.sleep(PERIOD_S)
        finally:
            traffic.kill()
            traffic.wait()
        if traffic.returncode:
            raise RuntimeError(f"the traffic ended with {traffic.returncode}")
        samples.append(_sample(address, service, begin))
        return Trial(list(_exchanges(record, begin)), samples)


def _exchanges(record: Path, begin: float) -> Iterator[Exchange]:
    for line in record.read_text().splitlines():
        members = json.loads(line)
        yield Exchange(**{**members, "time": members["time"] - begin})


def _sample(address: tuple[str, int], service: int, begin: float) -> Sample:
    connection = http.client.HTTPConnection(*address, timeout=300)
    connection.request("GET", "/metrics", headers={"Authorization": f"Bearer {SECRETS['alice']}"})
    metrics = connection.getresponse().read().decode()
    connection.close()
    evictions = re.findall(r'^geodesic_evictions_total{cache="(\w+)"} (\S+)', metrics, re.MULTILINE)
    return Sample(
        time.monotonic() - begin,
        memory_by_process(service),
        {cache: int(float(count)) for cache, count in evictions},
        _value(metrics, "geodesic_open_fds"),
        _value(metrics, "geodesic_workers_lost_total"),
    )


def _value(metrics: str, name: str) -> int:
    found = re.search(rf"^{name} (\S+)", metrics, re.MULTILINE)
    if found is None:
        raise RuntimeError(f"{name} is no metric")
    return int(float(found[1]))

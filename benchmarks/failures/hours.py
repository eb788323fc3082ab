"""Hours of load on a deployment in which nothing fails, and what its processes hold meanwhile."""

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISREG
from statistics import median
from tempfile import TemporaryDirectory

import psutil

from benchmarks.failures.failures import Failure
from benchmarks.failures.plan import make_load
from benchmarks.failures.trial import SETTINGS, Trial, try_out
from benchmarks.soak.memory import anonymous
from benchmarks.soak.plan import MIB
from benchmarks.tables import machine, rated, table
from tests.support.deployment import Deployment, deployed
from tests.support.machines import obstacle

PERIOD_S = 10.0
PAUSE_S = 0.5
"""With it the load takes about one core"""
MOST_GROWTH = 1.05
"""How much larger memory may be at the end than after half of the time"""
KINDS = {
    "geodesic-worker": "workers",
    "main() serve": "replicas",
    "ray::ServeReplica": "hosts",
    "ray::JobsProcess": "process that runs jobs",
    "ray::ServeController": "Ray Serve's controller",
    "gcs/gcs_server": "head's records",
    "raylet/raylet": "raylets",
    "Agent": "Ray's agents",
}
"""Kinds of processes by a text in their command lines"""
OTHERS = "others of Ray"
FILES = ("copies of meshes", "temporary files", "files of Ray", "objects in the store")
COPIES, TEMPORARY, RAY, OBJECTS = FILES
ABOUT = (
    "MiB of anonymous memory of all processes of a kind, with their share of shared pages, and MiB "
    "of files. Each column is the median over a tenth of the time. Handles are open files and "
    "connections."
)
MOMENTS = ("start", "¼", "½", "¾", "end")


@dataclass
class Held:
    """What processes of one kind, or files of one kind, hold together."""

    count: int = 0
    nbytes: int = 0
    handles: int = 0

    def add(self, nbytes: int, handles: int = 0) -> None:
        """Count one more."""
        self.count += 1
        self.nbytes += nbytes
        self.handles += handles


Sample = Mapping[str, Held]


def run(minutes: float, path: Path) -> str:
    """Keep a deployment busy for some minutes; write the report into ``path`` and return it."""
    if obstacle():
        raise RuntimeError(obstacle())
    samples: list[Sample] = []

    def watch(deployment: Deployment, _: None) -> None:
        end = time.monotonic() + 60 * minutes
        while time.monotonic() < end:
            samples.append(_sample(deployment))
            time.sleep(PERIOD_S)

    load, nothing = make_load(), Failure("nothing", watch, pause_s=PAUSE_S)
    with (
        TemporaryDirectory(prefix="g", ignore_cleanup_errors=True) as temporary,
        deployed(tls=False, **SETTINGS, TMPDIR=temporary) as deployment,
    ):
        trial = try_out(deployment, load, nothing)
    text = _report(trial, samples, minutes)
    path.write_text(text + "\n", encoding="utf-8")
    return text


def _sample(deployment: Deployment) -> Sample:
    held = {kind: Held() for kind in (*KINDS.values(), OTHERS, *FILES)}
    for part in deployment.parts:
        for process in part.machine.processes():
            with suppress(psutil.NoSuchProcess, FileNotFoundError, ProcessLookupError):
                command = " ".join(process.cmdline())
                kind = next((kind for text, kind in KINDS.items() if text in command), OTHERS)
                held[kind].add(anonymous(process.pid), process.num_fds())
    for path in deployment.folder.rglob("*"):
        _add_file(held[COPIES if "copies" in path.parts else RAY], path)
    for path in Path(deployment.settings["TMPDIR"]).rglob("*"):
        _add_file(held[TEMPORARY], path)
    for size in deployment.s3.sizes(deployment.settings["GEODESIC_STORE"]).values():
        held[OBJECTS].add(size)
    return held


def _add_file(held: Held, path: Path) -> None:
    with suppress(FileNotFoundError):  # it has just been removed
        status = path.lstat()
        if S_ISREG(status.st_mode):
            held.add(512 * status.st_blocks)


def _report(trial: Trial, samples: Sequence[Sample], minutes: float) -> str:
    computed = [each for each in trial.exchanges if each.operation.startswith("compute")]
    slow = sorted(each.seconds for each in computed)[len(computed) * 99 // 100]
    seconds = trial.end - trial.begin
    about = (
        f"{minutes:g} minutes of the load of [failures](failures.md), in which nothing fails. Its "
        f"users rest between two questions, so that the machine has a core for others. "
        f"{len(trial.exchanges):,} requests, {len(trial.exchanges) / seconds:.0f} a second; 99 of "
        f"100 computed answers took {slow:.1f} s at most."
    )
    faults = [f"- `{each[:300]}`" for each in (*trial.faults[:10], *trial.lost[:10])]
    outcomes = Counter(each.outcome for each in trial.exchanges)
    return "\n\n".join(
        [
            "# Hours",
            f"Written by `python -m benchmarks hours --minutes {minutes:g}`.",
            about,
            f"_{machine()}_",
            table(
                ["requests", "wrong or missing", "promised", "lost", "ended by themselves"],
                [
                    [
                        f"{len(trial.exchanges):,}",
                        rated(len(trial.faults), 0, at_least=False, digits=0),
                        str(sum(trial.promises.values())),
                        rated(len(trial.lost), 0, at_least=False, digits=0),
                        ", ".join(trial.restarts) or "none",
                    ]
                ],
            ),
            *(["\n".join(faults)] if faults else []),
            ", ".join(f"{outcomes[name]:,} × {name}" for name in sorted(outcomes)),
            "## What is held",
            ABOUT,
            table(
                ["what", "number", *MOMENTS, "end : ½", "handles at the start", "at the end"],
                [_row(kind, samples) for kind in samples[0]],
            ),
        ]
    )


def _row(kind: str, samples: Sequence[Sample]) -> list[str]:
    count = len(samples)
    around = [
        samples[count * k // 20 : count * k // 20 + count // 10 + 1] for k in (0, 4, 9, 14, 18)
    ]

    def medians(value: str) -> list[float]:
        return [median(getattr(each[kind], value) for each in some) for some in around]

    nbytes, handles, numbers = medians("nbytes"), medians("handles"), medians("count")
    growth = nbytes[-1] / max(nbytes[2], MIB)
    is_process = kind not in FILES
    return [
        kind,
        f"{numbers[0]:.0f}" if is_process else f"{numbers[0]:,.0f} to {numbers[-1]:,.0f}",
        *(f"{each / MIB:.1f}" for each in nbytes),
        rated(growth, MOST_GROWTH if is_process else None, at_least=False, digits=3),
        *(f"{each:.0f}" if is_process else "" for each in (handles[0], handles[-1])),
    ]

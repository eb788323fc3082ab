"""A trial of one method on one mesh, in a process of its own: time, memory, or how it ends."""

import json
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.peers.methods import METHODS, Method, executable
from geodesic_core.arrays import Floats, Ints

PATIENCE_S = 120.0
"""Seconds after which a method is given up"""
_QUERIES_S = 1.0
"""Seconds of queries, of which the median counts"""
_FEWEST = 3


@dataclass(frozen=True)
class Trial:
    """What became of a method on a mesh."""

    distances: Floats | None
    """None where there are none"""
    setup_s: float
    """Seconds of preparing the mesh"""
    query_s: float
    peak_mb: float
    """Memory of the process at its peak, less what it had before the mesh"""
    end: str
    """Empty, or how it ended without an answer"""


def try_out(method: Method, vertices: Floats, faces: Ints, source: int, command: str = "") -> Trial:
    """Run a method in a process of its own, which may crash, hang or refuse."""
    with tempfile.TemporaryDirectory() as folder:
        question = Path(folder) / "question.npz"
        np.savez(question, vertices=vertices, faces=faces, source=source)
        arguments = [sys.executable, "-m", __spec__.name, method.name, command, str(question)]
        try:
            ran = subprocess.run(
                arguments, capture_output=True, text=True, timeout=PATIENCE_S, check=False
            )
        except subprocess.TimeoutExpired:
            return _without(f"none after {PATIENCE_S:.0f} s")
        if ran.returncode < 0:
            return _without(signal.Signals(-ran.returncode).name)
        if ran.returncode > 0:
            return _without("refused: " + ran.stderr.strip().rpartition("\n")[2][:90])
        told = json.loads(ran.stdout.strip().rpartition("\n")[2])
        return Trial(np.load(Path(folder) / "answer.npy"), **told, end="")


def _without(end: str) -> Trial:
    return Trial(None, np.nan, np.nan, np.nan, end)


def _main(name: str, command: str, question: str) -> None:
    method = executable(name, command) if command else METHODS[name]
    with np.load(question) as given:
        vertices, faces, source = given["vertices"], given["faces"], int(given["source"])
    # What is imported, compiled and linked on first use is not the method's time.
    warm_up = method.prepare(*_TETRAHEDRON)
    warm_up(0)
    before = _memory("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak so far is forgotten
    start = time.perf_counter()
    query = method.prepare(vertices, faces)
    setup_s = time.perf_counter() - start
    seconds: list[float] = []
    while len(seconds) < _FEWEST or sum(seconds) < _QUERIES_S:
        start = time.perf_counter()
        distances = query(source)
        seconds.append(time.perf_counter() - start)
        if sum(seconds) > 10 * _QUERIES_S:
            break
    peak_mb = _memory("VmHWM") - before
    np.save(Path(question).with_name("answer.npy"), np.asarray(distances, float))
    told = {"setup_s": setup_s, "query_s": median(seconds), "peak_mb": peak_mb}
    print(json.dumps(told))


def _memory(name: str) -> float:
    """Return a figure of this process's memory, MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(name))


_TETRAHEDRON = (
    np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float),
    np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], np.int32),
)

if __name__ == "__main__":
    _main(*sys.argv[1:])

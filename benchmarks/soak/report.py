"""The report of a soak: tables in Markdown, and plots over time beside them."""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.soak.plan import MIB
from benchmarks.soak.trial import ALL, Exchange, Trial
from benchmarks.tables import machine, rated, table

MOST_GROWTH = 1.05
"""How much larger memory may be in the last third than in the one before"""
WINDOW_S = 10.0
PLOTTED = (
    "computeDistances",
    "computePath",
    "getPath",
    "computePaths",
    "computeIsolines",
    "computeMatrix",
    "findNearest",
    "locatePoints",
    "createMesh",
    "getMesh",
)
"""Operations whose latency is drawn; the tables have all"""


def write_report(trial: Trial, about: str, path: Path) -> str:
    """Write the report, and its plots into a file of the same name; return its text."""
    picture = path.with_suffix(".png")
    _draw(trial, picture)
    text = "\n\n".join(
        [
            "# Soak",
            "Written by `python -m benchmarks soak`.",
            about,
            f"_{machine()}_",
            f"![Latency, requests, refusals and memory over time]({picture.name})",
            "## Memory",
            _about_memory(trial),
            _memory(trial),
            "## Outcomes",
            _about_faults(trial),
            _outcomes(trial),
            "## Latency",
            _latency(trial),
            "## Caches",
            "How often each had to make room.",
            _caches(trial),
        ]
    )
    path.write_text(text + "\n", encoding="utf-8")
    return text


def _about_memory(trial: Trial) -> str:
    last = trial.samples[-1]
    return (
        f"MiB of anonymous memory, of shared pages the share; mapped meshes do not count. All "
        f"caches had been full since second {trial.full_since:.0f}; from then on the medians of "
        f"the second third and of the last one are compared. "
        f"{last.lost} workers were lost, and {last.open_files} files were open at the end."
    )


def _memory(trial: Trial) -> str:
    rows = []
    for process in (*trial.processes, ALL):
        before, after = trial.medians(process)
        growth = rated(after / before, MOST_GROWTH, at_least=False, digits=3)
        rows.append([process, f"{before / MIB:.1f}", f"{after / MIB:.1f}", growth])
    return table(["process", "second third", "last third", "last : second"], rows)


def _about_faults(trial: Trial) -> str:
    faults, count = trial.faults, len(trial.exchanges)
    if not faults:
        return f"{count:,} requests; every answer was right to the bit, or the intended refusal."
    some = "\n".join(f"- `{fault[:300]}`" for fault in faults[:20])
    return f"{count:,} requests, **{len(faults)} faults**, such as\n\n{some}"


def _outcomes(trial: Trial) -> str:
    counts = Counter(each.outcome for each in trial.exchanges)
    return table(["outcome", "requests"], [[name, f"{counts[name]:,}"] for name in sorted(counts)])


def _latency(trial: Trial) -> str:
    by_operation: dict[str, list[float]] = defaultdict(list)
    for each in trial.exchanges:
        by_operation[each.operation].append(1e3 * each.seconds)
    rows = []
    for operation in sorted(by_operation):
        times = np.array(by_operation[operation])
        p50, p99 = np.percentile(times, [50, 99])
        rows.append(
            [operation, f"{len(times):,}", f"{p50:.1f}", f"{p99:.1f}", f"{times.max():.0f}"]
        )
    return table(["operation", "requests", "p50, ms", "p99, ms", "max, ms"], rows)


def _caches(trial: Trial) -> str:
    evictions = trial.samples[-1].evictions
    return table(["cache", "evictions"], [[name, f"{evictions[name]:,}"] for name in evictions])


# Plots


def _draw(trial: Trial, path: Path) -> None:
    with mpl.rc_context({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3}):
        figure = Figure(figsize=(12, 8), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        _draw_latency(axes[0, 0], trial, 50)
        _draw_latency(axes[0, 1], trial, 99)
        _draw_outcomes(axes[1, 0], trial)
        _draw_memory(axes[1, 1], trial)
        for each in axes[1]:
            each.set_xlabel("seconds")
        figure.savefig(path, dpi=90)
    with Image.open(path) as image:
        image.quantize(64).save(path, optimize=True)  # a quarter of the bytes


def _draw_latency(axes: Axes, trial: Trial, percent: int) -> None:
    for operation in PLOTTED:
        some = [each for each in trial.exchanges if each.operation == operation]
        times = _by_window(some, lambda each: float(np.percentile(_seconds(each), percent)))
        axes.plot(*times, label=operation, linewidth=1)
    axes.set_yscale("log")
    axes.set_title(f"p{percent} by operation, ms, in windows of {WINDOW_S:g} s")
    axes.legend(fontsize=6, ncols=2)


def _draw_outcomes(axes: Axes, trial: Trial) -> None:
    def rate(some: Sequence[Exchange]) -> float:
        return len(some) / WINDOW_S

    axes.plot(*_by_window(trial.exchanges, rate), label="all", color="black")
    for outcome in sorted({each.outcome for each in trial.exchanges}):
        some = [each for each in trial.exchanges if each.outcome == outcome]
        axes.plot(*_by_window(some, rate), label=outcome, linewidth=1)
    axes.set_yscale("log")
    axes.set_title("requests a second, by outcome")
    axes.legend(fontsize=5, ncols=3)


def _draw_memory(axes: Axes, trial: Trial) -> None:
    times = [sample.time for sample in trial.samples]
    for process in trial.processes:
        sizes = [sample.memory.get(process, 0) / MIB for sample in trial.samples]
        axes.plot(times, sizes, label=process, linewidth=1)
    if trial.full_since is not None:
        axes.axvline(trial.full_since, color="grey", linestyle=":", label="all caches full")
    axes.set_ylim(bottom=0)
    axes.set_title("anonymous memory, MiB")
    axes.legend(fontsize=6)


def _seconds(some: Sequence[Exchange]) -> Sequence[float]:
    return [1e3 * each.seconds for each in some]


def _by_window(
    exchanges: Sequence[Exchange], value: Callable[[Sequence[Exchange]], float]
) -> tuple[Sequence[float], Sequence[float]]:
    """Return the middle of each window with requests, and a value of these."""
    windows: dict[int, list[Exchange]] = defaultdict(list)
    for each in exchanges:
        windows[int(each.time // WINDOW_S)].append(each)
    numbers = sorted(windows)
    return [WINDOW_S * (n + 0.5) for n in numbers], [value(windows[n]) for n in numbers]

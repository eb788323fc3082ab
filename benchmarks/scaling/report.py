"""The report: what was measured, how well the model predicts it, and what it says then."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.scaling import validation
from benchmarks.scaling.figures import KINDS, Figures
from benchmarks.scaling.growth import (
    CELL,
    HOT,
    MESHES,
    RATE,
    STEPS,
    WAIT_S,
    Growth,
    Point,
    dollars,
    limits,
)
from benchmarks.scaling.nodes import MIX
from benchmarks.scaling.validation import Validation
from benchmarks.tables import machine, table

WITHIN = 0.2
"""By how much the model may be wrong"""


def write_report(found: Validation, growth: Growth, path: Path) -> str:
    """Write the report, and its plots into a file of the same name; return its text."""
    sweeps = [growth.sweep(step) for step in STEPS]
    largest = [growth.capacity(points) for points in sweeps]
    cells = growth.cells(largest[-1].rate)
    picture = path.with_suffix(".png")
    _draw(found, sweeps, picture)
    text = "\n\n".join(
        [
            "# Scaling",
            "Written by `python -m benchmarks scaling`; [docs](../../docs/scaling.md) tell of it.",
            f"_{machine()}_",
            f"![Latency as measured and as predicted; waiting by load]({picture.name})",
            "## The model and what runs here",
            _about_validation(),
            _validation(found),
            "## Figures measured here",
            "Processor seconds of one core.",
            _figures(growth.figures, growth),
            "## Assumed",
            _assumed(growth),
            "## From one machine on",
            _ABOUT_STEPS,
            _steps(growth, largest),
            f"## A million questions a second, {MESHES:,} meshes",
            _about_cells(growth, cells),
            _cells(growth, cells),
            "## Where it breaks, and what then",
            "In the order in which one meets it on the way, with more questions or more meshes.",
            table(
                ["part", "measured", "breaks at", "then"],
                [
                    [each.part, each.measured, each.breaks, each.then]
                    for each in limits(growth, largest[-1])
                ],
            ),
        ]
    )
    path.write_text(text + "\n", encoding="utf-8")
    return text


def _about_validation() -> str:
    shares = "; ".join(f"{share:.0%} {kind} on {faces:,} faces" for share, kind, faces in MIX)
    loads = " and ".join(f"{load:.0%}" for load in validation.LOADS)
    return (
        f"Questions over HTTP, {shares}; each is new. First {validation.CLIENTS} clients keep the "
        f"nodes busy; then questions come at random times, {loads} as many a second, whether or "
        f"not earlier ones are answered. {validation.TURNS} turns of {validation.TURN_S:g} s each, "
        "all nodes by turns, on the same cores. The model gets the times at which questions come, "
        f"and, shuffled among {validation.NEAR} that followed each other, what they took of a "
        "worker and beside it, and which node prefers which mesh; not how long they waited. For "
        "how long a worker is kept beside its work, to be handed a question and to hand back its "
        "answer, is taken from the metrics of the service. Rates are medians of the turns, "
        "latencies those of all turns together; in parentheses what it predicts."
    )


def _validation(found: Validation) -> str:
    rows = []
    for (nodes, load), seen in found.seen.items():
        p50, p99 = seen.percentiles(50), seen.percentiles(99)
        rows.append(
            [
                f"{nodes}; {load}",
                f"{sum(map(len, seen.measured)):,}",
                _beside(*seen.rates),
                *(_beside(*(1e3 * each for each in pair)) for pair in (p50, p99)),
                _verdict(seen.rates),
                _verdict(p99),
            ]
        )
    return table(
        ["nodes; load", "questions", "a second", "p50, ms", "p99, ms", "a second", "p99"], rows
    )


def _beside(measured: float, predicted: float) -> str:
    return f"{measured:.1f} ({predicted:.1f})"


def _verdict(pair: tuple[float, float]) -> str:
    error = pair[1] / pair[0] - 1
    return f"{error:+.0%}" if abs(error) <= WITHIN else f"**{error:+.0%}**"


def _figures(figures: Figures, growth: Growth) -> str:
    replicas = growth.replicas
    rows = [
        [f"{kind}, 20,000 faces", f"{1e3 * float(figures.solves[kind].seconds(20_000.0)):.1f} ms"]
        for kind in KINDS
    ]
    rows += [
        ["a question on average, where its answer is not known", _ms(growth.question_s)],
        ["a stored mesh", f"{figures.bytes_a_face:.0f} bytes a face"],
        ["to open one in a worker", f"{1e9 * figures.open_s_a_face:.0f} ns a face"],
        ["to make one from vertices and corners", f"{1e9 * figures.build_s_a_face:.0f} ns a face"],
        ["a replica, for a question to its own workers", _ms(replicas.local_s)],
        ["a replica, for a question to hosts (Ray)", _ms(replicas.ray_s)],
        ["a replica, for a question whose answer it has", _ms(replicas.stored_s)],
        ["a replica, for a beat with a host", _ms(replicas.beat_s)],
    ]
    rows += [
        [f"a replica, to choose one of {count} hosts", _ms(seconds)]
        for count, seconds in figures.place_s.items()
    ]
    return table(["what", "takes"], rows)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"


def _assumed(growth: Growth) -> str:
    assumed = growth.assumed
    kinds = ", ".join(f"{share:.0%} {kind}" for kind, share in assumed.kinds.items())
    return (
        f"Zipf's law of the exponent {assumed.exponent:g} for how often meshes are asked. Meshes "
        f"of {assumed.faces:,.0f} faces at the median, {assumed.mean_faces:,.0f} on average "
        f"(log-normal). {kinds}; {assumed.repeated:.0%} of all questions have a stored answer. "
        f"An object store yields the first byte in {1e3 * assumed.first_byte_s:.0f} ms, and "
        f"{assumed.bytes_a_second / 1e6:.0f} MB a second to a host. A host has "
        f"{assumed.copies_bytes / 1e12:g} TB for copies. "
        f"A core with its memory is ${assumed.core_dollars:g} an hour, a gigabyte in an object "
        f"store ${assumed.stored_dollars:g} a month."
    )


def _steps(growth: Growth, largest: Sequence[Point]) -> str:
    rows = [
        [
            step.name,
            f"{step.meshes:,}",
            f"{point.rate:,.0f}",
            f"{1e3 * point.p50_s:.1f}",
            f"{1e3 * point.p99_s:.0f}",
            f"{1e3 * point.wait_p99_s:.0f}",
            f"{point.workers_busy:.0%}",
            f"{point.replicas_busy:.0%}",
            f"{point.copies_hit:.1%}",
            f"{dollars(growth, step.shape, point.rate):.2f}",
        ]
        for step, point in zip(STEPS, largest, strict=True)
    ]
    return table(
        [
            "service",
            "meshes",
            "a second",
            "p50, ms",
            "p99, ms",
            "waiting, p99, ms",
            "workers busy",
            "replicas busy",
            "mesh at the host",
            "$ a million",
        ],
        rows,
    )


_ABOUT_STEPS = (
    f"Questions a second at which 99 of 100 wait {1e3 * WAIT_S:.0f} ms at most, for a replica and "
    "a worker together: the largest of the loads that were simulated. Where a host has to pull the "
    "mesh first, that comes on top, in p99."
)


def _about_cells(growth: Growth, cells: int) -> str:
    hot = growth.hot_ranks(cells)
    return (
        f"{RATE:,.0f} questions a second take {cells} cells: {cells * CELL.hosts:,} hosts of "
        f"{CELL.workers} cores and {cells * CELL.replicas:,} replicas. {hot} meshes are hot: each "
        f"is more than {HOT:.0%} of what a cell answers."
    )


def _cells(growth: Growth, cells: int) -> str:
    rows = [
        [
            name,
            f"{cells * share:.2f}",
            f"{point.rate:,.0f}",
            f"{point.answered:,.0f}",
            f"{1e3 * point.p50_s:.1f}",
            f"{1e3 * point.p99_s:.0f}",
            f"{1e3 * point.wait_p99_s:.0f}",
            f"{point.copies_hit:.1%}",
        ]
        for name, share, point in growth.in_cells(cells)
    ]
    return table(
        [
            "cell",
            "times the mean",
            "asked a second",
            "answered",
            "p50, ms",
            "p99, ms",
            "waiting, p99, ms",
            "mesh at the host",
        ],
        rows,
    )


# Plots


def _draw(found: Validation, sweeps: Sequence[Sequence[Point]], path: Path) -> None:
    with mpl.rc_context({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3}):
        figure = Figure(figsize=(10, 4.2), layout="constrained")
        left, right = figure.subplots(1, 2)
        _draw_validation(left, found)
        _draw_growth(right, sweeps)
        figure.savefig(path, dpi=90, metadata={"Software": None})
    with Image.open(path) as image:
        image.quantize(64).save(path, optimize=True)


def _draw_validation(axes: Axes, found: Validation) -> None:
    shares = np.concatenate([np.linspace(1, 98, 98), np.linspace(98.2, 99.5, 7)])
    for number, ((nodes, load), seen) in enumerate(found.seen.items()):
        if load != f"{validation.LOADS[-1]:.0%}":
            continue
        colour = f"C{number // (1 + len(validation.LOADS))}"
        pairs = np.array([seen.percentiles(share) for share in shares])
        for times, style, end in ((pairs[:, 0], "-", ""), (pairs[:, 1], "--", ", predicted")):
            axes.plot(1e3 * times, 100 - shares, style, color=colour, label=nodes + end, lw=1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("ms")
    axes.set_ylabel("% of questions that take longer")
    axes.set_title(f"Measured and predicted, {validation.LOADS[-1]:.0%} load")
    axes.legend(fontsize=6)


def _draw_growth(axes: Axes, sweeps: Sequence[Sequence[Point]]) -> None:
    for step, points in zip(STEPS, sweeps, strict=True):
        axes.plot(
            [each.rate for each in points],
            [1e3 * max(each.wait_p99_s, 1e-4) for each in points],
            "o-",
            label=step.name,
            linewidth=1,
            markersize=3,
        )
    axes.axhline(1e3 * WAIT_S, color="grey", linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("questions a second")
    axes.set_title("What 99 of 100 questions wait at most, ms")
    axes.legend(fontsize=6)

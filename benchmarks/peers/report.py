"""The report on peers: times, memory, errors and bad input, and a picture of error over time."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from benchmarks.inputs import Inputs
from benchmarks.paper.report import RESULTS, Report, write_report
from benchmarks.peers.bad_input import BadMesh, bad_meshes
from benchmarks.peers.methods import METHODS, OURS, Method, executable
from benchmarks.peers.trial import Trial, try_out
from benchmarks.tables import table
from geodesic_core.arrays import Floats

COMMAND = "scripts/bench peers"
MESHES = ("fandisk10k.ply", "turbine.ply", "horse97k.ply", "dragon100k.ply", "icosphere 6")
_BAD_INPUT = (
    "A flat square with one fault, distances from a corner. Right: within 1e-6, infinite where "
    "there is no path, and a refusal where the input has no meaning."
)
_EXACT_ENOUGH = 1e-6
_FLOOR = 1e-9
"""Where exact methods are drawn, in per cent"""


def run(inputs: Inputs, executables: Mapping[str, str]) -> str:
    """Try all methods on all meshes; write the report, and return its text."""
    methods = {name: method for name, method in METHODS.items() if method.is_installed}
    absent = [name for name in METHODS if name not in methods]
    methods |= {name: executable(name, command) for name, command in executables.items()}
    rows, points = [], []
    for mesh, vertices, faces in inputs.arrays(MESHES):
        exact: Floats | None = None
        for name, method in methods.items():
            trial = try_out(method, vertices, faces, 0, executables.get(name, ""))
            if exact is None:  # ours is the first
                exact = trial.distances
            if exact is None:
                raise RuntimeError(f"no exact distances on {mesh}: {trial.end}")
            rows.append(_row(mesh, name, trial, exact))
            if trial.distances is not None:
                points.append((name, mesh, trial.query_s, _errors(trial.distances, exact)[0]))
            print(*rows[-1], sep=" | ", flush=True)
    columns = [case.name for case in bad_meshes()]
    ends = [
        [name, *(_end_of(method, case, executables.get(name, "")) for case in bad_meshes())]
        for name, method in methods.items()
        if name in ("exact", "approximate 0.1 %", "fast 2") or name not in OURS
    ]
    report = Report(
        "peers",
        "Peers",
        f"From vertex 0 to all vertices, each method in a process of its own, one thread "
        f"each: seconds to prepare the mesh (set up), and of a query then, "
        f"medians of 1 s of them; memory at its peak beside what the process had before; errors "
        f"relative to exact distances. Not installed, and so not measured: "
        f"{', '.join(absent) or 'none'}. What the methods do with bad input follows below.",
        ["mesh", "method", "set up, s", "query, s", "peak, MB", "mean error, %", "largest, %"],
        rows,
        _plot(points),
    )
    text = write_report(report, COMMAND)
    text += f"\n## Bad input\n\n{_BAD_INPUT}\n\n{table(['method', *columns], ends)}\n"
    (RESULTS / "peers.md").write_text(text, encoding="utf-8")
    return text


def _row(mesh: str, name: str, trial: Trial, exact: Floats) -> list[str]:
    if trial.distances is None:
        return [mesh, name, trial.end, "", "", "", ""]
    mean, largest = _errors(trial.distances, exact)
    return [
        mesh,
        name,
        f"{trial.setup_s:.3f}",
        f"{trial.query_s:.4f}",
        f"{trial.peak_mb:.0f}",
        f"{100 * mean:.2g}",
        f"{100 * largest:.2g}",
    ]


def _errors(distances: Floats, exact: Floats) -> tuple[float, float]:
    """Return the mean and the largest relative error."""
    away = np.isfinite(exact) & (exact > 0)
    errors = np.abs(distances[away] - exact[away]) / exact[away]
    return float(errors.mean()), float(errors.max())


def _end_of(method: Method, case: BadMesh, command: str) -> str:
    trial = try_out(method, case.vertices, case.faces, 0, command)
    if trial.distances is None:
        is_refused = trial.end.startswith("refused")
        if is_refused:
            return "refused" if case.right is None else "**refused**"
        return f"**{trial.end}**"
    if case.right is None:
        return "**answers**"
    missing = len(case.right) - np.size(trial.distances)  # some return a mere number for nothing
    if missing:
        return f"**{missing} short**"
    finite = np.isfinite(case.right)
    differences = np.abs(trial.distances[finite] - case.right[finite])
    off = differences.max() / case.right[finite].max()
    if not np.array_equal(np.isinf(trial.distances), ~finite):
        return "**finite beyond**" if np.isfinite(trial.distances).all() else "**wrong**"
    if math.isnan(off):
        return "**NaN**"
    return "right" if off <= _EXACT_ENOUGH else f"off by {100 * off:.2g} %"


def _plot(points: Sequence[tuple[str, str, float, float]]) -> Figure:
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    names = list(dict.fromkeys(name for name, *_ in points))
    markers = dict(zip(MESHES, "osD^v", strict=True))
    for i, name in enumerate(names):
        mine = [(mesh, time, error) for other, mesh, time, error in points if other == name]
        for mesh, time, error in mine:
            axes.loglog(
                time,
                max(100 * error, _FLOOR),
                markers[mesh],
                color=f"C{i % 10}",
                markersize=7 if name in OURS else 5,
                markerfacecolor=f"C{i % 10}" if name in OURS else "none",
                label=name if mesh == mine[0][0] else None,
            )
    axes.set(xlabel="query, s", ylabel="mean error, % (1e-9: exact)", title="filled: this library")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="x-small", ncols=2)
    return figure

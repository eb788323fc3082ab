"""Figures 6 and 7: how many windows exact sweeps make, by subdivision and by noise."""

import math
from collections.abc import Mapping, Sequence
from functools import partial

from matplotlib.figure import Figure

import geodesic_core as gc
from benchmarks.paper import published, surfaces
from benchmarks.paper.report import Report, beside
from benchmarks.timing import by_turns

SURFACES = {
    "Eight": surfaces.eight,
    "Sphere": surfaces.sphere,
    "Convex": surfaces.convex,
    "Saddle": surfaces.saddle,
}
KNOT_FACES, SEED = 20_000, 1


def figure_6(levels: Mapping[str, Sequence[int]], runs: int) -> Report:
    """Return the windows of each level, and the exponent of their growth."""
    rows, figure = [], Figure(figsize=(5.5, 4), layout="constrained")
    axes = figure.subplots()
    for color, (name, make) in zip(("C0", "C1", "C2", "C3"), SURFACES.items(), strict=True):
        last: int | None = None
        points: list[tuple[int, int]] = []
        for level in levels[name]:
            mesh = gc.TriangleMesh(*make(level))
            ((seconds, field),) = by_turns([partial(gc.exact_distance, mesh, 0)], runs)
            made, theirs = field.stats.windows_created, published.FIGURE_6[name][level]
            exponent = None if last is None else math.log(made / last, 4)
            last = made
            points.append((len(mesh.faces), made))
            rows.append(
                [
                    f"{name} ({level})",
                    beside(seconds, theirs.seconds, 3),
                    f"{len(mesh.faces):,} ({theirs.faces:,})",
                    f"{made:,} ({theirs.windows:,})",
                    beside(field.stats.windows_per_edge_created, theirs.wpe, 2),
                    "" if exponent is None else beside(exponent, theirs.exponent, 2),
                ]
            )
        axes.loglog(*zip(*points, strict=True), f"{color}o-", label=name)
        axes.loglog(
            [published.FIGURE_6[name][level].faces for level in levels[name]],
            [published.FIGURE_6[name][level].windows for level in levels[name]],
            f"{color}x:",
        )
    axes.set(xlabel="faces", ylabel="windows", title="dotted: the paper's")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return Report(
        "figure6",
        "Figure 6: windows by subdivision",
        f"Exact sweeps from vertex 0 on surfaces of Loop's scheme, prepared meshes, one thread, "
        f"medians of {runs}; the paper's numbers in parentheses, of its own control meshes. The "
        f"exponent p is that of windows ~ faces^p from one level to the next: 1.5 is expected.",
        ["surface (level)", "seconds", "faces", "windows", "per edge", "exponent"],
        rows,
        figure,
    )


def figure_7(runs: int, faces: int = KNOT_FACES) -> Report:
    """Return seconds and windows of a knot with more and more noise."""
    rows, made = [], []
    smooth = surfaces.knot(faces)
    for noise, (seconds, per_edge) in published.FIGURE_7.items():
        mesh = gc.TriangleMesh(*surfaces.noisy(smooth, noise, SEED))
        ((took, field),) = by_turns([partial(gc.exact_distance, mesh, 0)], runs)
        made.append(field.stats.windows_per_edge_created)
        rows.append([f"{noise:.0%}", beside(took, seconds, 3), beside(made[-1], per_edge, 1)])
    figure = Figure(figsize=(5, 3.4), layout="constrained")
    axes = figure.subplots()
    shares = [100 * noise for noise in published.FIGURE_7]
    axes.plot(shares, made, "C0o-", label="here")
    axes.plot(shares, [wpe for _, wpe in published.FIGURE_7.values()], "C0x:", label="the paper's")
    axes.set(xlabel="noise, % of the mean edge", ylabel="windows per edge", ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend()
    return Report(
        "figure7",
        "Figure 7: windows by noise",
        f"Exact sweeps from vertex 0 of a knot of {faces:,} faces whose vertices are moved in "
        f"random directions, by at most a share of the mean edge; medians of {runs}; the paper's "
        f"numbers in parentheses, of a knot of another size.",
        ["noise", "seconds", "windows per edge"],
        rows,
        figure,
    )

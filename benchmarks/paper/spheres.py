"""Figure 12 and Table 2: convergence to the distances of a smooth sphere."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

import geodesic_core as gc
from benchmarks.paper import published, surfaces
from benchmarks.paper.methods import Errors, errors_of, marching, with_windows
from benchmarks.paper.report import Report, beside

LEVELS = range(1, 8)
WINDOWS = (1.0, 1.5, 2.0, 2.5)
"""Windows per edge"""
SHOWN = 1.5
"""Those of Figure 12"""

OUT_OF_REACH = Errors(math.nan, math.nan)
"""Where no error has so few windows"""

ByLevel = Mapping[int, Errors]


class SphereErrors(NamedTuple):
    """Errors by level: of exact distances, with so many windows per edge, of fast marching."""

    exact: ByLevel
    merged: Mapping[float, ByLevel]
    marched: ByLevel


def errors_by_level(levels: Sequence[int]) -> SphereErrors:
    """Return the errors against the smooth sphere, from a vertex of the octahedron."""
    exact: dict[int, Errors] = {}
    marched: dict[int, Errors] = {}
    merged: dict[float, dict[int, Errors]] = {windows: {} for windows in WINDOWS}
    for level in levels:
        vertices, faces = surfaces.sphere(level)
        mesh = gc.TriangleMesh(vertices, faces)
        true = np.arccos(np.clip(vertices @ vertices[0], -1.0, 1.0))
        exact[level] = errors_of(gc.exact_distance(mesh, 0).distances, true)
        marched[level] = errors_of(marching(vertices, faces, 0), true)
        for windows in WINDOWS:
            field = with_windows(mesh, 0, windows)
            merged[windows][level] = (
                OUT_OF_REACH if field is None else errors_of(field.distances, true)
            )
    return SphereErrors(exact, merged, marched)


def rates(errors: ByLevel) -> dict[int, tuple[float, float]]:
    """Return the convergence of the largest and of the mean error, from each level's last."""
    return {
        level: (
            math.log2(errors[level - 1].largest / errors[level].largest),
            math.log2(errors[level - 1].mean / errors[level].mean),
        )
        for level in errors
        if level - 1 in errors
    }


def figure_12(found: SphereErrors) -> Report:
    """Return the errors of each level, and their plot."""
    series = (
        ("exact", found.exact, published.SPHERE_EXACT),
        (f"{SHOWN} WPE", found.merged[SHOWN], published.SPHERE_MERGED),
        ("fast marching", found.marched, published.SPHERE_MARCHING),
    )
    rows = []
    for level in found.exact:
        row = [str(level)]
        for part, name in enumerate(("largest", "mean")):
            for _, errors, theirs in series:
                row.append(beside(getattr(errors[level], name), theirs[level][part], 5))
                rate = rates(errors).get(level)
                row.append("" if rate is None else beside(rate[part], None, 2))
        rows.append(row)
    heads = [f"{kind}, {name}" for kind in ("largest", "mean") for name, *_ in series]
    return Report(
        "figure12",
        "Figure 12: convergence on a sphere",
        "Errors against the distances of the smooth unit sphere, from a vertex of the octahedron "
        "that Loop's scheme subdivides and whose vertices are projected at the end; the paper's "
        "numbers in parentheses. Largest errors are absolute, mean ones relative. R is the "
        "convergence rate. The error bound of the approximate solver is found by bisection, so "
        f"that it keeps {SHOWN} windows per edge on average, and may exceed WIDEST_ERROR for that. "
        "A dash: it keeps more, whatever the bound.",
        ["level", *(each for head in heads for each in (head, "R"))],
        rows,
        _plot(series),
    )


def _plot(series: Sequence[tuple[str, ByLevel, Mapping[int, tuple[float, float]]]]) -> Figure:
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    for part, (axes, name) in enumerate(
        zip(figure.subplots(1, 2), ("largest", "mean"), strict=True)
    ):
        for color, (label, errors, theirs) in zip(("C0", "C1", "C2"), series, strict=True):
            levels = list(errors)
            values = [getattr(errors[level], name) for level in levels]
            axes.semilogy(levels, values, f"{color}o-", label=label)
            axes.semilogy(
                levels, [theirs[level][part] for level in levels], f"{color}x:", label="the paper's"
            )
        axes.set(title=f"{name} error", xlabel="level")
        axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return figure


def table_2(found: SphereErrors) -> Report:
    """Return the convergence rates by windows per edge."""
    rows = []
    by_windows = {windows: rates(errors) for windows, errors in found.merged.items()}
    exact = rates(found.exact)
    for level in exact:
        row = [str(level)]
        for part in (0, 1):
            for windows in WINDOWS:
                theirs = published.RATES[windows].get(level, (None, None))[part]
                is_exact = found.merged[windows][level] == found.exact[level]
                ours = by_windows[windows][level][part]
                row.append("as exact" if is_exact else beside(ours, theirs, 2))
            row.append(beside(exact[level][part], published.EXACT_RATES[level][part], 2))
        rows.append(row)
    heads = [
        f"{kind}, {name}"
        for kind in ("largest", "mean")
        for name in (*(f"{windows} WPE" for windows in WINDOWS), "exact")
    ]
    return Report(
        "table2",
        "Table 2: convergence rates on a sphere",
        "Convergence rates of the largest absolute and of the mean relative error, from the level "
        "before, by windows per edge; the paper's numbers in parentheses. The spheres are those of "
        "[Figure 12](figure12.md), and so are the dashes.",
        ["level", *heads],
        rows,
    )

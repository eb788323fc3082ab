"""Draw the figures of the description of the algorithm.

    python docs/pictures/algorithm.py

It needs the extra ``plot``, which brings Matplotlib.
"""

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import geodesic_core as gc

INK, QUIET, FIRST, SECOND, PATH = "#1e293b", "#94a3b8", "#0f766e", "#b45309", "#d7301f"
Point = tuple[float, float]


def main() -> None:
    """Write each figure as SVG beside this file."""
    plt.rcParams |= {"font.size": 11, "svg.fonttype": "none", "svg.hashsalt": "geodesic"}
    for name, draw, size in (
        ("window", draw_window, (6, 4.4)),
        ("trimming", draw_trimming, (6, 4.4)),
        ("two-triangles", draw_two_triangles, (7.5, 4)),
    ):
        save(name, draw, size)


def save(name: str, draw: Callable[[Axes], None], size: tuple[float, float]) -> None:
    """Draw one figure into a file."""
    figure, axes = plt.subplots(figsize=size, layout="constrained")
    draw(axes)
    axes.set_axis_off()
    figure.savefig(Path(__file__).with_name(f"{name}.svg"), metadata={"Date": None})
    plt.close(figure)


def draw_window(axes: Axes) -> None:
    """Draw a window on an edge: its interval, and its pseudosource, unfolded."""
    length, b0, b1 = 5.0, 1.2, 3.6
    source, apex = (1.8, -2.4), (3.2, 2.4)
    axes.fill([0, length, apex[0]], [0, 0, apex[1]], color="#f1f5f9")
    lit = [reached_at(source, (x, 0.0), 2.4) for x in (b0, b1)]
    axes.fill([b0, b1, lit[1][0], lit[0][0]], [0, 0, 2.4, 2.4], color="#99f6e4", alpha=0.5)
    axes.fill([0, length, apex[0]], [0, 0, apex[1]], fill=False, edgecolor=INK)
    for end in (b0, b1):
        axes.plot([source[0], end], [source[1], 0], color=FIRST, linestyle="--")
    axes.plot([b0, b1], [0, 0], color=FIRST, linewidth=5, solid_capstyle="butt")
    dot(axes, source, "pseudosource (sx, sy),\nat distance σ", (12, -14))
    label(axes, (0, 0), "tail (0, 0)", (-10, -16))
    label(axes, (length, 0), "head (length, 0)", (-30, -16))
    label(axes, apex, "apex", (8, 0))
    label(axes, (b0, 0), "b0", (-6, 8))
    label(axes, (b1, 0), "b1", (0, 8))
    label(axes, middle(source, (b0, 0)), "d0", (-20, 0))
    label(axes, middle(source, (b1, 0)), "d1", (8, -4))
    axes.set_xlim(-0.8, 6.2)
    axes.set_ylim(-3.0, 2.7)
    axes.set_aspect("equal")


def draw_trimming(axes: Axes) -> None:
    """Draw two windows that overlap: each keeps the part where its distance is the smaller."""
    x = np.linspace(0.0, 5.0, 400)
    windows = (((1.0, -1.0), 0.0, (0.3, 3.4), FIRST), ((4.0, -0.8), 0.3, (1.2, 4.8), SECOND))
    heights = [sigma + np.hypot(x - sx, sy) for (sx, sy), sigma, _, _ in windows]
    crossing = float(x[np.abs(heights[0] - heights[1]).argmin()])
    for height, (_, _, (b0, b1), colour) in zip(heights, windows, strict=True):
        inside = (x >= b0) & (x <= b1)
        axes.plot(x[inside], height[inside], color=colour, linestyle=":")
        wins = inside & ((x <= crossing) == (colour == FIRST))
        axes.plot(x[wins], height[wins], color=colour, linewidth=2.5)
    for (_, _, (b0, b1), colour), y in zip(windows, (-0.25, -0.5), strict=True):
        kept = (b0, crossing) if colour == FIRST else (crossing, b1)
        axes.plot([b0, b1], [y, y], color=colour, linestyle=":")
        axes.plot(kept, [y, y], color=colour, linewidth=5, solid_capstyle="butt")
    axes.plot([crossing, crossing], [-0.7, float(heights[0][x <= crossing][-1])], color=QUIET)
    axes.annotate("", (5.3, 0), (-0.1, 0), arrowprops={"arrowstyle": "->", "color": INK})
    axes.annotate("", (0, 3.2), (0, -0.1), arrowprops={"arrowstyle": "->", "color": INK})
    label(axes, (5.0, 0), "along the edge", (-70, 6))
    label(axes, (0, 3.1), "distance", (6, 0))
    label(axes, (crossing, 0.5), "the bisector", (6, 0))
    label(axes, (0.3, -0.25), "kept of the first", (-10, -34), FIRST)
    label(axes, (4.8, -0.5), "kept of the second", (-120, -20), SECOND)
    axes.set_xlim(-0.3, 5.6)
    axes.set_ylim(-1.2, 3.3)


def draw_two_triangles(axes: Axes) -> None:
    """Draw the sweep over two triangles, with distances and the path that the library finds."""
    corners = [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 3.0, 0.0), (4.0, 3.0, 0.0)]
    field = gc.exact_distance(gc.TriangleMesh(corners, [(0, 1, 2), (1, 3, 2)]), 0)
    points = [corner[:2] for corner in corners]
    for face, colour in (((0, 1, 2), "#f1f5f9"), ((1, 3, 2), "#e2e8f0")):
        axes.fill(*zip(*(points[v] for v in face), strict=True), color=colour)
        axes.fill(*zip(*(points[v] for v in face), strict=True), fill=False, edgecolor=INK)
    axes.plot(*zip(points[2], points[1], strict=True), color=FIRST, linewidth=5)
    path = field.path_to(3).points
    axes.plot(path[:, 0], path[:, 1], color=PATH, linewidth=2, marker="o", markersize=4)
    places = ((-12, -18), (4, -18), (-12, 8), (4, 8))
    for v, place in enumerate(places):
        label(axes, points[v], f"v{v}: {field.distances[v]:g}", place)
    label(axes, (3.3, 0.55), "the window", (8, 4), FIRST)
    label(axes, (2.0, 1.5), "over the middle of the edge", (10, -4), PATH)
    label(axes, (0.5, 1.2), "face 0", (0, 0), QUIET)
    label(axes, (2.6, 2.5), "face 1", (0, 0), QUIET)
    axes.set_xlim(-0.6, 5.2)
    axes.set_ylim(-0.5, 3.5)
    axes.set_aspect("equal")


def reached_at(source: Point, through: Point, y: float) -> Point:
    """Return the point at height ``y`` on the ray from a source through a point."""
    share = (y - source[1]) / (through[1] - source[1])
    return source[0] + share * (through[0] - source[0]), y


def middle(a: Point, b: Point) -> Point:
    """Return the point half way."""
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


def dot(axes: Axes, at: Point, text: str, offset: tuple[int, int]) -> None:
    """Mark a point, with a label."""
    axes.plot(*at, marker="o", color=FIRST)
    label(axes, at, text, offset)


def label(axes: Axes, at: Point, text: str, offset: tuple[int, int], colour: str = INK) -> None:
    """Write a label beside a point, ``offset`` in points."""
    axes.annotate(text, at, offset, textcoords="offset points", color=colour)


if __name__ == "__main__":
    main()

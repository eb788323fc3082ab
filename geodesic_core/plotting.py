"""Surfaces and lines of PyVista, and pictures of them: in a window, a notebook, or a file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.extras import extra
from geodesic_core.files import as_output, written

_PICTURES = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}
"""Formats by suffix, as Pillow calls them, which PyVista requires."""

_SURFACE = "#d9d9d9"
_LINE = "#d7301f"
_LINE_WIDTH = 6  # pixels
_POINT_SIZE = 14  # pixels


def surface_of(vertices: Floats, faces: Ints, call: str) -> Any:
    """Return a ``pyvista.PolyData`` of a surface, with copies of the arrays.

    Raises
    ------
    MissingExtra
        PyVista is not installed.
    """
    with extra("plot", "PyVista", call):
        import pyvista
    return pyvista.PolyData.from_regular_faces(vertices.copy(), faces.copy())


def line_of(points: Floats, call: str) -> Any:
    """Return a ``pyvista.PolyData`` of the line through some points, or of the only one.

    Raises
    ------
    MissingExtra
        PyVista is not installed.
    """
    with extra("plot", "PyVista", call):
        import pyvista
    joined = [len(points), *range(len(points))] if len(points) > 1 else None
    return pyvista.PolyData(points.copy(), lines=joined)


def with_distances(surface: Any, distances: Floats, nearest_source: Ints) -> Any:
    """Return a surface after the distances of a field were added to its points."""
    surface.point_data["nearest_source"] = nearest_source
    surface.point_data["distance"] = distances
    surface.set_active_scalars("distance")
    return surface


def draw_distances(plotter: Any, surface: Any) -> None:
    """Draw a surface in the colours of its distances, and what is unreachable in grey."""
    distances = surface.point_data["distance"]
    surface.point_data["distance"] = np.where(np.isfinite(distances), distances, np.nan)
    plotter.add_mesh(surface, scalars="distance", cmap="viridis", nan_color=_SURFACE)


def draw_surface(plotter: Any, surface: Any) -> None:
    """Draw a surface in grey."""
    plotter.add_mesh(surface, color=_SURFACE)


def draw_line(plotter: Any, line: Any) -> None:
    """Draw a line."""
    plotter.add_mesh(line, color=_LINE, line_width=_LINE_WIDTH)


def draw_points(plotter: Any, points: Floats) -> None:
    """Draw points as balls."""
    plotter.add_points(points, color=_LINE, point_size=_POINT_SIZE, render_points_as_spheres=True)


@contextmanager
def picture(screenshot: str | Path | None, call: str) -> Iterator[Any]:
    """Yield a plotter to draw with, and show what was drawn, or write it into a file.

    Raises
    ------
    MissingExtra
        PyVista is not installed.
    InvalidArgument
        The file is no picture by its suffix, or its folder is not there.
    """
    with extra("plot", "PyVista", call):
        import pyvista
        from PIL import Image
    if screenshot is None:
        plotter = pyvista.Plotter()
        yield plotter
        plotter.show()
        return
    file = as_output(screenshot, *_PICTURES)
    plotter = pyvista.Plotter(off_screen=True)
    try:
        yield plotter
        pixels: Any = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    with written(file) as stream:
        Image.fromarray(pixels).save(stream, _PICTURES[file.suffix.lower()])

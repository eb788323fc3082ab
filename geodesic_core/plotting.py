"""Surfaces and lines of PyVista, and pictures of them: in a window, a notebook, or a file."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.extras import extra
from geodesic_core.files import as_output, written
from geodesic_core.validation import check_choice

Camera = Literal["iso", "+x", "-x", "+y", "-y", "+z", "-z"]
"""Where one looks from; along z, y is up, else z"""

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
PATH, PATH_WIDTH = "#d7301f", 6
"""Colour and width, in pixels, of the curves that a caller gave"""

ISOLINE, ISOLINE_WIDTH = "#ffffff", 2
"""The same of lines of equal values"""

_POINT_SIZE = 14  # pixels
_FLAT = 1e-2  # share of its size up to which a surface is flat


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


def line_of(points: Floats, call: str, *, closed: bool = False) -> Any:
    """Return a ``pyvista.PolyData`` of the line through some points, or of the only one.

    A closed line goes back to the first of them.

    Raises
    ------
    MissingExtra
        PyVista is not installed.
    """
    with extra("plot", "PyVista", call):
        import pyvista
    order = [*range(len(points)), *([0] if closed else [])]
    joined = [len(order), *order] if len(points) > 1 else None
    return pyvista.PolyData(points.copy(), lines=joined)


def with_distances(surface: Any, distances: Floats, nearest_source: Ints) -> Any:
    """Return a surface after the distances of a field were added to its points."""
    surface.point_data["nearest_source"] = nearest_source
    surface.point_data["distance"] = distances
    surface.set_active_scalars("distance")
    return surface


def draw_surface(plotter: Any, surface: Any) -> None:
    """Draw a surface in the colours of its active values, grey where there are none."""
    name = surface.active_scalars_name
    if name is None:
        shown = plotter.add_mesh(surface, color=_SURFACE)
    else:
        values = surface.point_data[name]
        surface.point_data[name] = np.where(np.isfinite(values), values, np.nan)
        shown = plotter.add_mesh(surface, scalars=name, cmap="viridis", nan_color=_SURFACE)
    # Lines on the surface are in front of it.
    shown.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    shown.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)


def draw_lines(plotter: Any, lines: Iterable[Any], colour: str, width: int) -> None:
    """Draw lines."""
    for line in lines:
        plotter.add_mesh(line, color=colour, line_width=width)


def draw_points(plotter: Any, points: Floats) -> None:
    """Draw points as balls."""
    if len(points):
        plotter.add_points(
            points, color=PATH, point_size=_POINT_SIZE, render_points_as_spheres=True
        )


def _look(plotter: Any, camera: Camera | None) -> None:
    """Look at what was drawn: by default at the flat side of what is flat, else from above."""
    size = np.diff(np.reshape(plotter.bounds, (3, 2))).ravel()
    if camera is None:
        thinnest = int(np.argmin(size))
        is_flat = size[thinnest] < _FLAT * size.max()
        camera = ("+x", "-y", "+z")[thinnest] if is_flat else "iso"
    match camera:
        case "iso":
            plotter.view_isometric()
        case "+x" | "-x":
            plotter.view_yz(negative=camera == "-x")
        case "+y" | "-y":
            plotter.view_xz(negative=camera == "+y")
        case "+z" | "-z":
            plotter.view_xy(negative=camera == "-z")


@contextmanager
def picture(
    save: str | Path | None, camera: Camera | None, title: str | None, call: str
) -> Iterator[Any]:
    """Yield a plotter to draw with, and show what was drawn, or write it into a file.

    Raises
    ------
    MissingExtra
        PyVista is not installed.
    InvalidArgument
        The file is no picture by its suffix, or its folder is not there; or the camera is none.
    """
    if camera is not None:
        check_choice("camera", camera, get_args(Camera))
    with extra("plot", "PyVista", call):
        import pyvista
        from PIL import Image
    file = None if save is None else as_output(save, *_PICTURES)
    plotter = pyvista.Plotter(off_screen=file is not None)
    try:
        yield plotter
        if title is not None:
            plotter.add_title(title, font_size=12)
        _look(plotter, camera)
        if file is None:
            plotter.show()
            return
        pixels: Any = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    with written(file) as stream:
        Image.fromarray(pixels).save(stream, _PICTURES[file.suffix.lower()])

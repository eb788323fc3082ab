"""Pictures of results, drawn by PyVista: in a window, in a notebook, or into a file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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

SURFACE = "#d9d9d9"
LINE = "#d7301f"
LINE_WIDTH = 6  # pixels
POINT_SIZE = 14  # pixels


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

"""Esri ASCII grids: heights in rows from north to south, with gaps."""

import re

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count
from geodesic_core.io.text import NUMBER, bad_row

_HEADER = re.compile(rb"\s*([a-z_]+)[ \t]+(" + NUMBER + rb")[ \t]*(?:\r?\n|\r)", re.IGNORECASE)
_NO_DATA = -9999.0
"""What stands for a gap where the header does not say"""


def read_grid(data: bytes, max_faces: int | None) -> FileContents:
    """Read the heights of an Esri ASCII grid: a vertex each, in the order of the file, but no gaps.

    Vertices lie at the centres of cells, x to the east and y to the north. Four neighbours make two
    faces, which the diagonal from north-west to south-east divides; where one is missing there is a
    hole.
    """
    header, at = _read_header(data)
    columns, rows = int(header["ncols"]), int(header["nrows"])
    if min(columns, rows) < 2:
        raise InvalidMesh(
            f"the grid has {columns} columns and {rows} rows; it must have two or more"
        )
    check_face_count(2 * (columns - 1) * (rows - 1), max_faces)
    words = data[at:].split()
    if len(words) != columns * rows:
        raise InvalidMesh(
            f"the grid declares {columns} columns and {rows} rows, but has {len(words)} heights"
        )
    try:
        heights = np.array(words, np.float64)
    except ValueError:
        bad = next(i for i, word in enumerate(words) if not re.fullmatch(NUMBER, word))
        raise bad_row("vertex", bad, words[bad], "it must be a number", "height") from None
    measured = np.isfinite(heights) & (heights != header.get("nodata_value", _NO_DATA))
    row, column = np.divmod(np.flatnonzero(measured), columns)
    with np.errstate(over="ignore", invalid="ignore"):  # the mesh refuses what is not finite
        x = _lowest(header, "x") + column * header.get("dx", header["cellsize"])
        y = _lowest(header, "y") + (rows - 1 - row) * header.get("dy", header["cellsize"])
    faces = grid_faces(measured.reshape(rows, columns))
    gaps = len(words) - len(row)
    word = "gap, which is a hole" if gaps == 1 else "gaps, which are holes"
    notes = (f"The grid has {gaps} {word} of the surface.",) if gaps else ()
    vertices = np.stack([x, y, heights[measured]], axis=1)
    return FileContents.of_triangles(vertices, faces, notes=notes)


def grid_faces(measured: NDArray[np.bool_]) -> Longs:
    """Return two faces for every four neighbours of a grid that are all measured, (F, 3).

    What is measured, (rows, columns), has the numbers of vertices in the order of the grid. Faces
    are wound as seen from above where rows go from north to south, and columns to the east.
    """
    number = np.where(measured, np.cumsum(measured).reshape(measured.shape) - 1, -1)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    squares = np.stack([corner.ravel() for corner in corners], axis=1)
    faces: Longs = squares[(squares >= 0).all(axis=1)][:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return faces


def _read_header(data: bytes) -> tuple[dict[str, float], int]:
    """Return the numbers of the header by name, in lower case, and where it ends."""
    header: dict[str, float] = {}
    at = 0
    while (line := _HEADER.match(data, at)) is not None:
        header[line[1].decode().lower()] = float(line[2])
        at = line.end()
    if "dx" in header:
        header.setdefault("cellsize", header["dx"])
    missing = {"ncols", "nrows", "cellsize"} - header.keys()
    if missing:
        raise InvalidMesh(f"the header of the grid lacks {', '.join(sorted(missing))}")
    for name in ("ncols", "nrows"):
        if not 0 <= header[name] <= len(data) or header[name] % 1:
            raise InvalidMesh(
                f"{name} of the grid is {header[name]:g}; the file is too short for it"
            )
    return header, at


def _lowest(header: dict[str, float], axis: str) -> float:
    """Return the least coordinate of a vertex: the centre of a cell, whose corner may be given."""
    if f"{axis}llcenter" in header:
        return header[f"{axis}llcenter"]
    return (
        header.get(f"{axis}llcorner", 0.0)
        + header[f"d{axis}" if f"d{axis}" in header else "cellsize"] / 2
    )

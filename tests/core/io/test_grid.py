"""Esri ASCII grids: heights, and gaps that are holes."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh, TooManyFaces

HEAD = "ncols 5\nnrows 5\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n"


def grid(heights: np.ndarray, head: str, no_data: str = "-9999") -> bytes:
    rows = [" ".join(no_data if np.isnan(z) else repr(float(z)) for z in row) for row in heights]
    return (head + "\n".join(rows) + "\n").encode()


def flat_with_gap() -> np.ndarray:
    heights = np.zeros((5, 5))
    heights[2, 2] = np.nan
    return heights


COUNTS = "ncols 5\nnrows 5\n"
HEADS = {
    "corner": (HEAD, 11, 21, 2, 2, "-9999"),
    "centre": (COUNTS + "xllcenter 3\nyllcenter 4\ncellsize 2\n", 3, 4, 2, 2, "-9999"),
    "capitals": (HEAD.upper(), 11, 21, 2, 2, "-9999.0"),
    "other value": (HEAD.replace("-9999", "-32768"), 11, 21, 2, 2, "-32768"),
    "NaN": (HEAD, 11, 21, 2, 2, "nan"),
    "GDAL's dx and dy": (COUNTS + "xllcorner 0\nyllcorner 0\ndx 2\ndy 4\n", 1, 2, 2, 4, "-9999"),
    "Windows": (HEAD.replace("\n", "\r\n"), 11, 21, 2, 2, "-9999"),
    "no origin": (COUNTS + "cellsize 1\n", 0.5, 0.5, 1, 1, "-9999"),
}


@pytest.mark.parametrize("name", HEADS)
def test_a_gap_is_a_hole_and_vertices_lie_at_the_centres_of_cells(name: str) -> None:
    head, x, y, dx, dy, no_data = HEADS[name]
    mesh = gc.load_mesh(grid(flat_with_gap(), head, no_data), "asc")
    row, column = np.divmod(np.delete(np.arange(25), 12), 5)
    expected = np.stack([x + column * dx, y + (4 - row) * dy, 0 * row], axis=1)
    assert mesh.vertices.tolist() == expected.tolist()
    assert len(mesh.faces) == 2 * 12
    assert any("1 gap" in note and "hole" in note for note in mesh.warnings)
    assert mesh.report.boundary_loops == 2
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.jit
def test_distances_go_around_a_gap() -> None:
    head = COUNTS + "cellsize 1\n"
    field = gc.exact_distance(gc.load_mesh(grid(flat_with_gap(), head), "asc"), 0)
    # The hole is 2 x 2 cells in the middle; the shortest way passes by one of its corners.
    assert field.distances.max() == pytest.approx(2 * np.sqrt(10))
    whole = gc.load_mesh(grid(np.zeros((5, 5)), head), "asc")
    row, column = np.divmod(np.arange(25), 5)
    np.testing.assert_allclose(gc.exact_distance(whole, 0).distances, np.hypot(row, column))


def test_heights_keep_the_order_of_the_file() -> None:
    heights = np.arange(6.0).reshape(2, 3) * 1.5
    mesh = gc.load_mesh(grid(heights, "ncols 3\nnrows 2\ncellsize 1\n"), "asc")
    assert mesh.vertices[:, 2].tolist() == heights.ravel().tolist()
    assert mesh.faces.tolist() == [[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2]]
    joined = grid(heights, "ncols 3\nnrows 2\ncellsize 1\n").replace(b"\n1", b" 1")
    again = gc.load_mesh(joined, "asc")  # rows are a habit
    assert again.vertices.tolist() == mesh.vertices.tolist()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"ncols 5\nnrows 5\n0 0 0\n", "header of the grid lacks cellsize"),
        (b"0 0 0\n", "lacks cellsize, ncols, nrows"),
        (b"ncols 1\nnrows 5\ncellsize 1\n0 0 0 0 0\n", "1 columns and 5 rows; it must have two"),
        (b"ncols 2\nnrows 2\ncellsize 1\n0 0 0\n", "declares 2 columns and 2 rows, but has 3 heig"),
        (b"ncols 2\nnrows 2\ncellsize 1\n0 0 0 0 0\n", "2 columns and 2 rows, but has 5 heights"),
        (b"ncols 2\nnrows 2\ncellsize 1\n0 0 0 1,5\n", "height 3 reads '1,5'"),
        (b"ncols 1e9\nnrows 2\ncellsize 1\n0 0 0 0\n", "ncols of the grid is 1e.09; the file is"),
        (b"ncols nan\nnrows 2\ncellsize 1\n0 0 0 0\n", "ncols of the grid is nan"),
        (b"ncols 2\nnrows 2\ncellsize nan\n0 0 0 0\n", "vertex 0 is at"),
        (b"ncols 2\nnrows 2\ncellsize 1\n0 0 0 -9999\n", "no faces"),
    ],
)
def test_damaged_grids_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        gc.load_mesh(data, "asc")


def test_a_grid_is_refused_by_its_header() -> None:
    with pytest.raises(TooManyFaces):
        gc.load_mesh(grid(np.zeros((5, 5)), HEAD), "asc", max_faces=31)

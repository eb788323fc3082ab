"""VTK's files: every kind of data set and cell, in every way in which VTK writes them.

Most are read in this process, as `load_mesh` has them read in one of its own.
"""

import re
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
import pyvista
from vtkmodules import vtkIOXML
from vtkmodules.vtkFiltersGeneral import vtkDataSetTriangleFilter
from vtkmodules.vtkIOLegacy import vtkDataSetWriter

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh, TooManyFaces
from geodesic_core.io import vtk
from geodesic_core.io.vtk_polygons import polygons_of, read_file
from tests.support.mutations import BYTES, TEXT, mutated

pytestmark = pytest.mark.slice(8)

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(4.0), np.arange(3.0)))
PLANE = np.stack([X, Y, 0 * X], axis=1)
"""Twelve points of a plane, as a grid of 4 × 3 numbers them"""
QUADS = [[i, i + 1, i + 5, i + 4] for i in (0, 1, 2, 4, 5, 6)]
MIXED = [QUADS[0], [1, 2, 6], [1, 6, 5], *QUADS[2:]]
PAIRS = [[a, *rest] for a, b, c, d in QUADS for rest in ([b, c], [c, d])]


def flat(polygons: list[list[int]]) -> list[int]:
    return [number for polygon in polygons for number in (len(polygon), *polygon)]


def grid_of(polygons: list[list[int]], types: list[int]) -> pyvista.UnstructuredGrid:
    return pyvista.UnstructuredGrid(flat(polygons), np.array(types, np.uint8), PLANE)


DATA_SETS = {
    "PolyData": (pyvista.PolyData(PLANE, faces=flat(MIXED)), MIXED),
    "UnstructuredGrid": (grid_of(MIXED, [9, 5, 5, 9, 9, 9, 9]), MIXED),
    "StructuredGrid": (pyvista.StructuredGrid(*PLANE.T.reshape(3, 1, 3, 4).swapaxes(1, 3)), QUADS),
    "ImageData": (pyvista.ImageData(dimensions=(4, 3, 1)), QUADS),
    "RectilinearGrid": (pyvista.RectilinearGrid(range(4), range(3), [0.0]), QUADS),
}
LEGACY = {
    f"{version / 10} {form}": (version, form)
    for version in (42, 51)
    for form in ("ASCII", "Binary")
}
XML: dict[str, dict[str, Any]] = {
    "ascii": {"DataMode": "Ascii"},
    "inline": {"DataMode": "Binary", "CompressorType": "None"},
    "inline big-endian zlib": {"DataMode": "Binary", "ByteOrder": 0},
    "inline lzma": {"DataMode": "Binary", "CompressorType": "LZMA"},
    "base64": {"DataMode": "Appended", "EncodeAppendedData": 1, "CompressorType": "None"},
    "base64 lz4": {"DataMode": "Appended", "EncodeAppendedData": 1, "CompressorType": "LZ4"},
    "raw": {"DataMode": "Appended", "EncodeAppendedData": 0, "CompressorType": "None"},
    "raw zlib": {"DataMode": "Appended", "EncodeAppendedData": 0, "HeaderType": 64},
    "raw big-endian": {"DataMode": "Appended", "EncodeAppendedData": 0, "ByteOrder": 0},
}


def legacy(data: Any, version: int, form: str, path: Path) -> bytes:
    writer = vtkDataSetWriter()
    writer.SetFileVersion(version)
    getattr(writer, f"SetFileTypeTo{form}")()
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    writer.Write()
    return path.read_bytes()


def xml(data: Any, options: dict[str, Any], path: Path) -> bytes:
    writer = vtkIOXML.vtkXMLDataSetWriter()
    for name, value in options.items():
        choose = getattr(writer, f"Set{name}To{value}", None)
        if choose is not None:
            choose()
        elif name == "HeaderType":
            writer.SetHeaderTypeToUInt64()
        else:
            getattr(writer, f"Set{name}")(value)
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    writer.Write()
    return path.read_bytes()


def polygons_in(data: Any) -> tuple[np.ndarray, list[list[int]], dict[str, int]]:
    points, corners, sizes, left_out = polygons_of(data)
    assert sizes.sum() == len(corners)
    return points, [each.tolist() for each in np.split(corners, np.cumsum(sizes)[:-1])], left_out


def turned(polygon: list[int]) -> list[int]:
    """Return a polygon from its lowest point on, whichever was its first."""
    first = polygon.index(min(polygon))
    return polygon[first:] + polygon[:first]


def check_plane(data: Any, polygons: list[list[int]]) -> None:
    points, found, left_out = polygons_in(data)
    assert points.tolist() == PLANE.tolist()
    assert list(map(turned, found)) == list(map(turned, polygons))
    assert not left_out


@pytest.mark.parametrize("way", LEGACY)
@pytest.mark.parametrize("kind", DATA_SETS)
def test_legacy_files(kind: str, way: str, tmp_path: Path) -> None:
    data, polygons = DATA_SETS[kind]
    content = legacy(data, *LEGACY[way], tmp_path / "mesh.vtk")
    assert content.startswith(f"# vtk DataFile Version {way[:3]}".encode())
    check_plane(read_file(content), polygons)


@pytest.mark.parametrize("way", XML)
@pytest.mark.parametrize("kind", DATA_SETS)
def test_xml_files(kind: str, way: str, tmp_path: Path) -> None:
    data, polygons = DATA_SETS[kind]
    content = xml(data, XML[way], tmp_path / "mesh.vtu")
    assert (b"BigEndian" in content) == (XML[way].get("ByteOrder") == 0)
    check_plane(read_file(content), polygons)


SUFFIXES = ("vtp", "vtu", "vts", "vti", "vtr")


@pytest.mark.jit
@pytest.mark.parametrize(("suffix", "kind"), list(zip(SUFFIXES, DATA_SETS, strict=True)))
def test_distances_on_a_file_of_each_kind_are_euclidean(
    suffix: str, kind: str, tmp_path: Path
) -> None:
    data, polygons = DATA_SETS[kind]
    path = tmp_path / f"plane.{suffix}"
    xml(data, XML["raw zlib"], path)
    mesh = gc.load_mesh(path)
    assert len(mesh.faces) == sum(len(polygon) - 2 for polygon in polygons)
    assert mesh.warnings == ()
    distances = gc.exact_distance(mesh, 0).distances
    np.testing.assert_allclose(distances, np.hypot(X, Y), rtol=1e-14)
    with pytest.raises(TooManyFaces):
        gc.load_mesh(path, max_faces=len(mesh.faces) - 1)


def test_files_by_hand_that_are_read_in_a_process(tmp_path: Path) -> None:
    square = "POINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\n"
    begin = "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET "
    grid = begin + "UNSTRUCTURED_GRID\n" + square
    for number, text in enumerate(
        (
            begin + "POLYDATA\n" + square + "POLYGONS 1 5\n4 0 1 3 2\n",
            begin + "POLYDATA\n" + square + "TRIANGLE_STRIPS 1 5\n4 0 1 2 3\n",
            grid + "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n8\n",  # a pixel
        )
    ):
        path = tmp_path / f"{number}.vtk"
        path.write_text(text)
        assert gc.load_mesh(path).faces.shape == (2, 3)


STRIPS = [[0, 4, 1, 5, 2, 6, 3], [4, 8, 5, 9]]


def test_strips_become_triangles_in_their_place_turned_alike() -> None:
    rows = [[0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 6], [2, 6, 3], [4, 8, 5], [5, 8, 9]]
    strips = pyvista.PolyData(PLANE, strips=flat(STRIPS))
    beside = pyvista.PolyData(PLANE, faces=flat([QUADS[2]]), strips=flat(STRIPS))
    cells = [QUADS[2], STRIPS[0], [3, 6, 7], STRIPS[1]]
    among = grid_of(cells, [9, 6, 5, 6])
    for data, expected in (
        (strips, rows),
        (beside, [QUADS[2], *rows]),
        (among, [QUADS[2], *rows[:5], [3, 6, 7], *rows[5:]]),
    ):
        points, found, left_out = polygons_in(data)
        assert list(map(turned, found)) == list(map(turned, expected))
        assert points.tolist() == PLANE.tolist()
        assert not left_out


T = 1 / 3
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
EDGES = [(0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5)]
CORNER = [(0, 0), (1, 0), (0, 1)]
SIXTHS = [(0.5, 0), (0.5, 0.5), (0, 0.5)]
THIRDS = [(T, 0), (2 * T, 0), (1, T), (1, 2 * T), (T, 1), (2 * T, 1), (0, T), (0, 2 * T)]
HIGHER_ORDER = {
    "quadratic triangle": (22, CORNER + SIXTHS, 0.5),
    "biquadratic triangle": (34, [*CORNER, *SIXTHS, (T, T)], 0.5),
    "quadratic quad": (23, SQUARE + EDGES, 1),
    "biquadratic quad": (28, [*SQUARE, *EDGES, (0.5, 0.5)], 1),
    "quadratic linear quad": (30, [*SQUARE, EDGES[0], EDGES[2]], 1),
    "quadratic polygon": (36, SQUARE + EDGES, 1),
    "Lagrange triangle of order 3": (
        69,
        [*CORNER, (T, 0), (2 * T, 0), (2 * T, T), (T, 2 * T), (0, 2 * T), (0, T), (T, T)],
        0.5,
    ),
    "Lagrange quad of order 3": (
        70,
        [*SQUARE, *THIRDS, (T, T), (2 * T, T), (T, 2 * T), (2 * T, 2 * T)],
        1,
    ),
}


def cell_of(kind: int, nodes: Any) -> pyvista.UnstructuredGrid:
    rows = np.pad(np.asarray(nodes, float), ((0, 0), (0, 3 - np.shape(nodes)[1])))
    return pyvista.UnstructuredGrid([len(rows), *range(len(rows))], np.array([kind]), rows)


def areas(points: np.ndarray, faces: Any) -> np.ndarray:
    a, b, c = np.moveaxis(points[np.asarray(faces)], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


@pytest.mark.parametrize("name", HIGHER_ORDER)
def test_cells_of_higher_order_are_split_through_all_their_nodes(name: str) -> None:
    kind, nodes, area = HIGHER_ORDER[name]
    points, triangles, left_out = polygons_in(cell_of(kind, nodes))
    assert not left_out
    assert set(map(len, triangles)) == {3}
    assert set(np.ravel(triangles)) == set(range(len(nodes)))  # no node left over
    assert areas(points, triangles).sum() == pytest.approx(area, rel=1e-12)  # none overlap
    distances = gc.exact_distance(gc.TriangleMesh(points, triangles), 0).distances
    np.testing.assert_allclose(distances, np.linalg.norm(points, axis=1), atol=1e-12)


@pytest.mark.parametrize("name", HIGHER_ORDER)
def test_bent_cells_of_higher_order_are_split_as_vtk_does(name: str) -> None:
    kind, nodes, _ = HIGHER_ORDER[name]
    x, y = np.array(nodes).T
    bent = cell_of(kind, np.stack([x, y, x * x - 0.3 * x * y], axis=1))
    points, triangles, _ = polygons_in(bent)
    split = vtkDataSetTriangleFilter()
    split.SetInputData(bent)
    split.Update()
    faces = pyvista.wrap(split.GetOutput()).cells.reshape(-1, 4)[:, 1:]
    expected = areas(points, faces)
    np.testing.assert_allclose(sorted(areas(points, triangles)), sorted(expected), rtol=1e-12)


def test_cells_keep_their_order_among_others_of_higher_order(tmp_path: Path) -> None:
    nodes = np.pad(np.array([*SQUARE, *EDGES, (2, 0), (2, 1)]), ((0, 0), (0, 1)))
    cells = [[1, 8, 9, 2], [0, 1, 2, 3, 4, 5, 6, 7], [8, 9], [5, 8, 9]]
    grid = pyvista.UnstructuredGrid(flat(cells), np.array([9, 23, 3, 5]), nodes)
    path = tmp_path / "mixed.vtu"
    grid.save(path)
    mesh = gc.load_mesh(path)
    assert mesh.faces[:2].ravel().tolist() == [1, 8, 9, 1, 9, 2]
    assert mesh.faces[-1].tolist() == [5, 8, 9]
    assert len(mesh.faces) == 2 + 6 + 1
    assert any("1 line cells" in note for note in mesh.warnings)


TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (cell_of(76, HIGHER_ORDER["Lagrange triangle of order 3"][1]), "Bézier cells"),
        (cell_of(77, HIGHER_ORDER["Lagrange quad of order 3"][1]), "Bézier cells"),
        (cell_of(10, TETRAHEDRON), r"1 tetra cells\. Extract its surface .*extract_surface"),
        (cell_of(24, np.random.default_rng(1).random((10, 3))), "1 quadratic tetra cells"),
        (pyvista.ImageData(dimensions=(3, 3, 2)), "4 voxel cells"),
        (pyvista.ImageData(dimensions=(3, 1, 1)), "2 line cells"),
        (cell_of(99, SQUARE), "1 cells of type 99"),
        (cell_of(8, CORNER), "cell 0 has 3 points; its type has 4"),
        (cell_of(22, SQUARE), "cell 0 has 4 points; its type has 6"),
        (
            pyvista.UnstructuredGrid([6, 0, 1, 2, 3, 4, 12], np.array([22]), PLANE),
            "cell 0 has the point 12, but points are numbered 0 to 11",
        ),
    ],
)
def test_what_is_no_surface_is_refused_with_its_cells(data: Any, message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        gc.as_mesh(data)


def test_solid_cells_beside_polygons_are_left_out_with_a_note() -> None:
    cells = [[0, 1, 5, 4], [0, 1, 4, 8]]
    mesh = gc.as_mesh(grid_of(cells, [9, 10]))
    assert len(mesh.faces) == 2
    assert "1 tetra cells of the mesh were left out." in mesh.warnings


def test_hidden_cells_are_left_out(tmp_path: Path) -> None:
    hidden = 32
    duplicate, of_hidden_point = 1, 2
    for kind, (data, polygons) in DATA_SETS.items():
        by_cell = data.copy()
        flags = np.zeros(by_cell.n_cells, np.uint8)
        flags[[0, -1]] = hidden, duplicate
        by_cell.cell_data["vtkGhostType"] = flags
        _, found, left_out = polygons_in(by_cell)
        assert list(map(turned, found)) == list(map(turned, polygons[1:-1])), kind
        assert left_out == {"hidden cells": 2}

        by_point = data.copy()
        flags = np.zeros(12, np.uint8)
        flags[0] = of_hidden_point
        by_point.point_data["vtkGhostType"] = flags
        assert polygons_in(by_point)[2] == {"hidden cells": 1}, kind
    path = tmp_path / "hidden.vtp"
    data.cast_to_unstructured_grid().extract_surface(algorithm="dataset_surface").save(path)
    by_cell.save(tmp_path / "hidden.vtr")
    mesh = gc.load_mesh(tmp_path / "hidden.vtr")
    assert len(mesh.faces) == 2 * 4
    assert any("2 hidden cells" in note for note in mesh.warnings)


def piece(points: str, ids: str, name: str) -> str:
    data = '<DataArray type="{}" Name="{}" {}format="ascii">{}</DataArray>'.format
    position = data("Float32", "Points", 'NumberOfComponents="3" ', points)
    cells = data("Int32", "connectivity", "", ids) + data("Int32", "offsets", "", "3")
    if name == "UnstructuredGrid":
        cells = f"<Cells>{cells}{data('UInt8', 'types', '', '5')}</Cells>"
        head = 'NumberOfCells="1"'
    else:
        cells, head = f"<Polys>{cells}</Polys>", 'NumberOfPolys="1"'
    return f'<Piece NumberOfPoints="3" {head}><Points>{position}</Points>{cells}</Piece>'


@pytest.mark.parametrize("kind", ["UnstructuredGrid", "PolyData"])
@pytest.mark.parametrize("count", [1, 2, 5])
def test_pieces_follow_each_other(kind: str, count: int) -> None:
    pieces = [piece(f"0 0 {i} 1 0 {i} 0 1 {i}", "0 1 2", kind) for i in range(count)]
    content = f'<VTKFile type="{kind}" version="0.1"><{kind}>{"".join(pieces)}</{kind}></VTKFile>'
    points, found, _ = polygons_in(read_file(content.encode()))
    assert found == [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(count)]
    assert points[:, 2].tolist() == np.repeat(np.arange(count), 3).tolist()


def test_files_that_lead_to_other_files_and_files_that_lie_are_refused() -> None:
    parallel = b'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid/></VTKFile>'
    blocks = b'<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet"></VTKFile>'
    head = b"# vtk DataFile Version 5.1\nby hand\nASCII\nDATASET "
    square = b"POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
    for content, message in (
        (parallel, "its type is 'PUnstructuredGrid'; it must be one of PolyData, Unstr"),
        (blocks, "its type is 'vtkMultiBlockDataSet'"),
        (head + b"NOTHING\n", "cannot be read"),
        (head + square + b"POLYGONS 2 3\nOFFSETS vtktypeint64\n0 3\n", "cannot be read: Error re"),
        (head + square, "no polygons: it has no cells"),
    ):
        with pytest.raises(InvalidMesh, match=message) as refusal:
            gc.load_mesh(content, "vtk")
        assert "\n" not in str(refusal.value)


@pytest.mark.jit
@pytest.mark.parametrize(
    ("kind", "way", "left_out"),
    [
        ("StructuredGrid", "4.2 Binary", 100),
        ("PolyData", "5.1 Binary", 9),
        ("PolyData", "5.1 ASCII", 20),
        ("RectilinearGrid", "4.2 ASCII", 40),
        ("StructuredGrid", "raw", 60),
    ],
)
def test_no_memory_is_read_beyond_the_end_of_a_file(
    kind: str, way: str, left_out: int, tmp_path: Path
) -> None:
    data, _ = DATA_SETS[kind]
    path = tmp_path / "cut.vtk"
    content = legacy(data, *LEGACY[way], path) if way in LEGACY else xml(data, XML[way], path)
    with pytest.raises(InvalidMesh, match="VTK file cannot be read: ") as refusal:
        gc.load_mesh(content[:-left_out], "vtk")
    assert "0x" not in str(refusal.value)


@pytest.mark.jit
@pytest.mark.parametrize("way", ["inline", "inline lzma"])
@pytest.mark.parametrize("kind", ["float32", "float64"])
def test_no_points_without_values(kind: str, way: str, tmp_path: Path) -> None:
    grid = pyvista.RectilinearGrid(*(np.arange(n, dtype=kind) for n in (4, 3, 1)))
    content = xml(grid, XML[way], tmp_path / "grid.vtr")
    begin = content.index(b">", content.index(b"<DataArray")) + 1
    end = content.index(b"</DataArray>")
    nothing = content[:begin] + b"AAAAAA==" + content[end:]  # VTK (9.7) finds no error in it
    for cut in (nothing, content[:begin] + content[end:]):
        with pytest.raises(InvalidMesh, match="VTK file cannot be read"):
            gc.load_mesh(cut, "vtr")


def test_blocks_of_pyvista_are_joined_in_their_order() -> None:
    one, two = (pyvista.PolyData.from_regular_faces(PLANE + z, PAIRS) for z in (0, 5))
    nested = pyvista.MultiBlock(
        [one, None, pyvista.MultiBlock([DATA_SETS["ImageData"][0]]), pyvista.Table(X[:, None]), two]
    )
    mesh = gc.as_mesh(nested)
    assert len(mesh.vertices) == 36
    assert mesh.vertices[24:].tolist() == (PLANE + 5).tolist()
    assert mesh.faces[:12].tolist() == PAIRS
    assert mesh.faces[24:].tolist() == (np.array(PAIRS) + 24).tolist()
    for nothing in (pyvista.MultiBlock(), pyvista.MultiBlock([pyvista.Table(X[:, None])])):
        with pytest.raises(InvalidMesh, match="MultiBlock is not a surface: it has no cells"):
            gc.as_mesh(nothing)


@pytest.mark.parametrize("kind", DATA_SETS)
def test_pyvista_s_data_keep_their_numbers(kind: str) -> None:
    data, polygons = DATA_SETS[kind]
    mesh = gc.as_mesh(data)
    assert mesh.vertices.tolist() == PLANE.tolist()
    assert len(mesh.faces) == sum(len(polygon) - 2 for polygon in polygons)
    field = gc.exact_distance(data, 11).distances
    np.testing.assert_allclose(field, np.hypot(X - 3, Y - 2), atol=1e-14)


def test_cells_are_named_in_words() -> None:
    data = pyvista.PolyData(PLANE, lines=[3, 0, 1, 2], verts=[1, 5])
    with pytest.raises(InvalidMesh) as refusal:
        gc.as_mesh(data)
    assert re.search(r"1 vertex cells, 1 poly line cells", str(refusal.value))


@pytest.mark.jit
@pytest.mark.parametrize("hostile", ["while True: pass", "import time; time.sleep(600)"])
def test_the_time_of_a_read_is_limited_by_the_clock(
    hostile: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "hostile.py"
    program.write_text(f"print('ready', flush=True)\n{hostile}")
    monkeypatch.setattr(vtk.vtk_polygons, "__file__", str(program))
    assert vtk._SECONDS < 10
    monkeypatch.setattr(vtk, "_SECONDS", 1)
    with pytest.raises(InvalidMesh, match=r"VTK cannot read the file in 1 s .* it takes longer"):
        gc.load_mesh(b"# vtk DataFile Version 3.0\n", "vtk")


def test_a_refusal_does_not_repeat_the_file(tmp_path: Path) -> None:
    content = xml(DATA_SETS["UnstructuredGrid"][0], XML["ascii"], tmp_path / "mesh.vtu")
    content = content.replace(b"Float64", b"Float6" + b"/" * 2000, 1)
    with pytest.raises(
        InvalidMesh, match=r"cannot be read: Unknown data type .Float6/+$"
    ) as caught:
        gc.load_mesh(content, "vtu")
    assert len(str(caught.value)) < 400


def test_an_error_that_is_no_text_counts() -> None:
    head = b"# vtk DataFile Version 3.0\nby hand\n\xb5\xffASCII\nDATASET POLYDATA\n"
    with pytest.raises(ValueError, match="its text is damaged"):
        read_file(head + b"POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n")


def mutant(number: int, path: Path) -> bytes:
    random = Random(f"vtk {number}")
    data, _ = DATA_SETS[random.choice(list(DATA_SETS))]
    way = random.choice([*LEGACY, *XML])
    content = legacy(data, *LEGACY[way], path) if way in LEGACY else xml(data, XML[way], path)
    content = re.sub(rb"0x[0-9a-f]+", b"0x0", content)  # addresses, of which VTK makes names
    return mutated(random, content, random.choice((TEXT, BYTES)))


def read(content: bytes) -> gc.TriangleMesh | InvalidMesh:
    try:
        return gc.load_mesh(content, "vtk", max_faces=1000)
    except InvalidMesh as refusal:
        return refusal


@pytest.mark.jit
@pytest.mark.slice(10)
@pytest.mark.parametrize("number", range(500))
def test_a_mutated_file_is_read_or_refused_and_always_alike(number: int, tmp_path: Path) -> None:
    content = mutant(number, tmp_path / "mesh.vtk")
    one, other = read(content), read(content)  # memory that is not filled would differ
    if isinstance(one, InvalidMesh):
        assert "\n" not in str(one)
        assert len(str(one)) < 400
        assert isinstance(other, InvalidMesh)
    else:
        assert isinstance(other, gc.TriangleMesh)
        assert np.isfinite(one.vertices).all()
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()

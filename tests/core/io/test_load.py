"""Mesh files, good and bad."""

import builtins
import io
import re
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.load import load_mesh
from geodesic_core.mesh.report import Sample
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.solvers import exact_distance
from tests.support.mesh_files import (
    glb,
    glb_of,
    glb_tree,
    obj,
    off,
    ply,
    ply_big_endian,
    ply_binary,
    ply_header,
    stl,
    stl_binary,
)
from tests.support.meshes import real_mesh

KINDS = ["obj", "off", "ply", "stl", "glb"]

# Two triangles, then one apart; vertex 4 belongs to no face and comes before others that do.
VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0.25], [0, 1, 0], [9, 9, 9], [5, 0, 0], [6, 0, 0], [5, 1, 0]],
    dtype=float,
)
FACES = np.array([[0, 1, 2], [0, 2, 3], [7, 5, 6]])

# A pentagon, a triangle and a quad, in this order.
POLYGON_VERTICES = np.array(
    [[0, 0, 0], [2, 0, 0], [3, 1, 0], [2, 2, 0], [0, 2, 0], [3, 3, 0], [2, 4, 0], [0, 4, 0]], float
)
POLYGONS = [[0, 1, 2, 3, 4], [3, 2, 5], [4, 3, 6, 7]]
FANS = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 2, 5], [4, 3, 6], [4, 6, 7]]


# A convex pentagon, and a hexagon with a dent beside it.
DENTED_VERTICES = np.array(
    [[0, 0, 0], [4, 0, 0], [5, 2, 0], [2, 4, 0], [0, 4, 0], [2, 9, 0], [-3, 9, 0], [-3, 0, 0]],
    float,
)
DENTED = [[0, 1, 2, 3, 4], [4, 3, 5, 6, 7, 0]]


Writer = Callable[[Any, Any], bytes]
POLYGONAL: list[tuple[str, Writer]] = [
    ("obj", obj),
    ("off", off),
    ("ply", ply),
    ("ply", ply_binary),
    ("ply", ply_big_endian),
]
NUMBERED: list[tuple[str, Writer]] = [*POLYGONAL, ("glb", glb)]
SOUPS: list[tuple[str, Writer]] = [("stl", stl), ("stl", stl_binary)]
ALL = NUMBERED + SOUPS


def name_of(value: Any) -> str | None:
    return value.__name__ if callable(value) else None


every_writer = pytest.mark.parametrize(("kind", "write"), ALL, ids=name_of)
every_numbered_writer = pytest.mark.parametrize(("kind", "write"), NUMBERED, ids=name_of)
every_soup_writer = pytest.mark.parametrize(("kind", "write"), SOUPS, ids=name_of)


def refusal(data: bytes, kind: str) -> InvalidMesh:
    with pytest.raises(InvalidMesh) as caught:
        load_mesh(data, kind)
    assert "\n" not in str(caught.value)
    return caught.value


# --- What is read ---------------------------------------------------------------------------------


@every_numbered_writer
def test_vertices_and_faces_keep_the_order_of_the_file(kind: str, write: Writer) -> None:
    mesh = load_mesh(write(VERTICES, FACES), kind)
    assert mesh.vertices.tolist() == VERTICES.tolist()
    assert mesh.faces.tolist() == FACES.tolist()
    assert mesh.vertex_map is None


@every_soup_writer
def test_stl_corners_are_merged_in_order_of_first_appearance(kind: str, write: Writer) -> None:
    mesh = load_mesh(write(VERTICES, FACES), kind)
    assert mesh.vertices.tolist() == VERTICES[[0, 1, 2, 3, 7, 5, 6]].tolist()
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert mesh.vertex_map is not None
    assert mesh.vertex_map.tolist() == [0, 1, 2, 0, 2, 3, 4, 5, 6]


@every_numbered_writer
def test_equal_positions_stay_apart_unless_asked(kind: str, write: Writer) -> None:
    vertices, faces = VERTICES[[0, 1, 2, 0, 2, 3]], [[0, 1, 2], [3, 4, 5]]
    assert len(load_mesh(write(vertices, faces), kind).vertices) == 6
    merged = load_mesh(write(vertices, faces), kind, merge="exact")
    assert merged.vertices.tolist() == VERTICES[:4].tolist()
    assert merged.vertex_map is not None
    assert merged.vertex_map.tolist() == [0, 1, 2, 0, 2, 3]


@pytest.mark.parametrize(("kind", "write"), POLYGONAL, ids=name_of)
def test_convex_polygons_become_fans_in_place(kind: str, write: Writer) -> None:
    mesh = load_mesh(write(POLYGON_VERTICES, POLYGONS), kind)
    assert mesh.faces.tolist() == FANS
    assert mesh.face_map is not None
    assert mesh.face_map.tolist() == [0, 0, 0, 1, 2, 2]


@pytest.mark.parametrize(("kind", "write"), POLYGONAL, ids=name_of)
def test_quads_become_pairs_in_place(kind: str, write: Writer) -> None:
    quads = [[0, 1, 3, 4], [4, 3, 6, 7]]
    mesh = load_mesh(write(POLYGON_VERTICES, quads), kind)
    assert mesh.faces.tolist() == [[0, 1, 3], [0, 3, 4], [4, 3, 6], [4, 6, 7]]


@pytest.mark.parametrize(("kind", "write"), POLYGONAL, ids=name_of)
def test_concave_polygons_are_cut_inside(kind: str, write: Writer) -> None:
    mesh = load_mesh(write(DENTED_VERTICES, DENTED), kind)
    assert mesh.face_map is not None
    assert mesh.face_map.tolist() == [0, 0, 0, 1, 1, 1, 1]
    corners = mesh.vertices[mesh.faces][:, :, :2]
    (ux, uy), (wx, wy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    assert (ux * wy - uy * wx > 0).all()
    assert mesh.report.triangulated_polygons == 2
    assert (mesh.report.euler_characteristic, mesh.report.boundary_loops) == (1, 1)


@pytest.mark.parametrize(("kind", "write"), POLYGONAL, ids=name_of)
def test_polygons_of_fewer_than_three_corners_keep_their_place(kind: str, write: Writer) -> None:
    polygons = [[0], [0, 1, 2, 3], [1, 2], [0, 0, 3, 3], [3, 4, 0, 0], [1, 1, 0]]
    mesh = load_mesh(write(POLYGON_VERTICES, polygons), kind)
    assert mesh.faces.tolist() == [
        [0, 0, 0],
        [0, 1, 2],
        [0, 2, 3],
        [1, 2, 2],
        [0, 3, 3],
        [3, 4, 0],
        [1, 1, 0],
    ]
    assert mesh.face_map is not None
    assert mesh.face_map.tolist() == [0, 1, 1, 2, 3, 4, 5]
    assert mesh.report.repeated_vertex_faces == Sample(4, (0, 3, 4, 6))
    assert "4 faces are made of fewer than three different vertices" in mesh.warnings[-1]
    refusal(write(POLYGON_VERTICES, [[1, 2], [3, 3, 4]]), kind)


@every_writer
def test_a_path_gives_what_its_bytes_give(kind: str, write: Writer, tmp_path: Path) -> None:
    data = write(VERTICES, FACES)
    path = tmp_path / f"Mesh.{kind.upper()}"
    path.write_bytes(data)
    expected = load_mesh(data, kind)
    for mesh in (
        load_mesh(path),
        load_mesh(str(path)),
        load_mesh(bytearray(data), f".{kind}"),
        load_mesh(memoryview(data), kind),
    ):
        assert mesh.vertices.tobytes() == expected.vertices.tobytes()
        assert mesh.faces.tobytes() == expected.faces.tobytes()


@pytest.mark.parametrize("kind", ["obj", "off", "ply"])
def test_numbers_are_read_to_the_last_bit(kind: str) -> None:
    write = dict(NUMBERED[:3])[kind]
    vertices = [[0.1, 1 / 3, 1e-17], [1.0000000000000002, -2.5e-8, 3e15], [-7.0, 1e9, 0.3]]
    assert load_mesh(write(vertices, [[0, 1, 2]]), kind).vertices.tolist() == vertices


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "stl"])
def test_windows_line_ends_and_blank_lines_are_read(kind: str) -> None:
    write = {"obj": obj, "off": off, "ply": ply, "stl": stl}[kind]
    head, mark, body = write(VERTICES, FACES).rpartition(b"end_header\n")
    data = (head + mark).replace(b"\n", b"\r\n") + body.replace(b"\n", b"\r\n\r\n")
    expected = load_mesh(write(VERTICES, FACES), kind)
    assert load_mesh(data, kind).faces.tolist() == expected.faces.tolist()
    assert load_mesh(data, kind).vertices.tolist() == expected.vertices.tolist()


OBJ_AS_ARTISTS_LEAVE_IT = b"""# a seam: one position, two texture coordinates
mtllib nowhere.mtl
o first
v 0 0 0
v 1 0 0 1.0
  v 1 1 0 0.5 0.5 0.5 # a comment
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
g top
usemtl red
s off
f 1/1/1 2/2/1 3/1/1
usemtl blue
f 1/2 \\
 3/2 4/1
o second
v 5 0 0
v 6 0 0
v 5 1 0
usemtl red
f -3//1 -2//1 -1//1
v 7 7 7
l 1 2
"""


def test_obj_textures_groups_materials_and_relative_indices() -> None:
    mesh = load_mesh(OBJ_AS_ARTISTS_LEAVE_IT, "obj")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert mesh.vertices[:, 0].tolist() == [0, 1, 1, 0, 5, 6, 5, 7]


def test_obj_lines_points_and_curves_are_told_of() -> None:
    rows = b"l 1 2 3\np 1\nl 2/1 3/2\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2 3\ncurv2 1 2\nend\n"
    (note,) = load_mesh(obj(VERTICES[:3], FACES[:1]) + rows, "obj").warnings
    assert all(what in note for what in ("2 lines", "1 points", "2 curves", "1 surfaces"))
    refusal(obj(VERTICES, []) + rows, "obj")


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b""])
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_obj_line_ends_and_byte_order_marks(end: bytes, mark: bytes) -> None:
    data = mark + obj(VERTICES, FACES).strip().replace(b"\n", end)
    mesh = load_mesh(data, "obj")
    assert mesh.vertices.tolist() == VERTICES.tolist()
    assert mesh.faces.tolist() == FACES.tolist()


def test_obj_comments_may_end_in_a_backslash() -> None:
    rows = obj(VERTICES, FACES[:2]).replace(
        b"v 1.0 0.0 0.0", b"# C:\\new\\\nv 1.0 \\\r\n0.0 \\ \n0.0", 1
    )
    mesh = load_mesh(rows, "obj")
    assert mesh.vertices.tolist() == VERTICES.tolist()


def test_obj_colours_and_weights_after_positions_are_stepped_over() -> None:
    rows = b"v 0 0 0 0.5\nv 1 0 0\nv 0 1 0 1 0.5 0\nf 1 2 3"
    assert load_mesh(rows, "obj").vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_obj_seams_split_no_vertex() -> None:
    """A ring of quads whose texture begins and ends at one row of vertices."""
    turn = 2 * np.pi * np.arange(6) / 6
    low = [
        f"v {x!r} {y!r} 0"
        for x, y in zip(np.cos(turn).tolist(), np.sin(turn).tolist(), strict=True)
    ]
    rows = low + [row[:-1] + "1" for row in low]
    rows += [f"vt {k / 6} {side}" for side in (0, 1) for k in range(7)]
    rows += ["vn 0 0 1", "g wall", "usemtl stripes"]
    for k in range(6):
        corners = [(k, k), ((k + 1) % 6, k + 1), ((k + 1) % 6 + 6, k + 8), (k + 6, k + 7)]
        rows.append("f " + " ".join(f"{v + 1}/{t + 1}/1" for v, t in corners))
    mesh = load_mesh("\n".join(rows).encode(), "obj")
    assert (len(mesh.vertices), len(mesh.faces)) == (12, 12)
    assert (mesh.report.components, mesh.report.boundary_loops) == (1, 2)
    assert mesh.report.duplicate_vertices.count == 0
    assert mesh.report.triangulated_polygons == 6


def test_off_header_variants() -> None:
    rows = b"0 0 0 255 0 0\n1 0 0 0 0 0\n\n0 1 0 0 0 0 # last\n3 0 1 2 255 0 0\n"
    for header in (b"COFF\n3 1 0\n", b"OFF 3 1 0\n", b"# made by hand\nNOFF\n# sizes\n3 1\n"):
        assert load_mesh(header + rows, "off").faces.tolist() == [[0, 1, 2]]


PLY_WITH_ALL_SORTS = b"""ply
format ascii 1.0
comment TextureFile nowhere.png
obj_info of no interest
element material 1
property uchar shine
element vertex 3
property float nx
property float x
property float y
property float z
property float s
property float t
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar uint vertex_index
property list uchar float texcoord
property uchar red
element edge 1
property int vertex1
property int vertex2
end_header
7
0 0 0 0 .5 .5 1 2 3
0 1 0 0 .5 .6 1 2 3
0 0 1 0 .5 .7 1 2 3
3 0 1 2 6 0 0 1 0 1 1 9
3 2 1 0 6 1 1 0 0 0 1 9
0 1
"""


def test_ply_elements_and_properties_that_are_no_geometry_are_stepped_over() -> None:
    # Both windings in one file: read alone, since such a mesh is refused.
    data = PLY_WITH_ALL_SORTS.replace(b"face 2", b"face 1").replace(
        b"3 2 1 0 6 1 1 0 0 0 1 9\n", b""
    )
    mesh = load_mesh(data, "ply")
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_binary_ply_with_faces_first_and_a_flag_per_face() -> None:
    header = (
        b"ply\nformat binary_little_endian 1.0\nelement face 1\nproperty uchar flag\n"
        b"property list uchar ushort vertex_indices\nelement vertex 3\nproperty float x\n"
        b"property float y\nproperty float z\nproperty uchar red\nend_header\n"
    )
    body = struct.pack("<BB3H", 1, 3, 0, 1, 2)
    body += b"".join(struct.pack("<3fB", *row, 200) for row in [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    assert load_mesh(header + body, "ply").vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


# --- What is never touched ------------------------------------------------------------------------


@pytest.fixture
def sealed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no file be opened and no connection be made."""

    load_mesh(obj(VERTICES, FACES), "obj")  # what is imported or compiled first is read before

    def refuse(*args: Any, **_: Any) -> None:
        raise AssertionError(f"opened {args}")

    for where, name in ((builtins, "open"), (io, "open"), (socket, "socket")):
        monkeypatch.setattr(where, name, refuse)


@pytest.mark.usefixtures("sealed")
@pytest.mark.parametrize("there", ["seen.mtl", "/etc/hostname", "http://127.0.0.1:9/x.mtl"])
def test_files_that_a_mesh_names_are_not_read(there: str) -> None:
    obj_file = OBJ_AS_ARTISTS_LEAVE_IT.replace(b"nowhere.mtl", there.encode())
    assert len(load_mesh(obj_file, "obj").faces) == 3
    ply_file = ply(VERTICES, FACES).replace(b"by hand", b"TextureFile " + there.encode())
    assert len(load_mesh(ply_file, "ply").faces) == 3
    tree, binary = glb_tree(VERTICES, FACES)
    tree["buffers"][0]["uri"] = there
    assert "another file" in str(refusal(glb_of(tree, binary), "glb"))


def test_a_name_is_a_path_and_nothing_else() -> None:
    for name in ("http://127.0.0.1:9/mesh.ply", "no/such/mesh.ply", "\0.ply"):
        with pytest.raises(InvalidMesh, match="cannot read"):
            load_mesh(name)
    with pytest.raises(InvalidMesh, match=r"cannot read .*directory"):
        load_mesh(Path(__file__).parent, "ply")


# --- What is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("data", [b"", b"\n", b"\0", b"garbage", b"\xff" * 200, b"solid " * 40])
def test_what_is_no_mesh_file_is_refused(kind: str, data: bytes) -> None:
    refusal(data, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_file_is_called_empty(kind: str) -> None:
    assert str(refusal(b"", kind)) == f"the {kind.upper()} file is empty"


@pytest.mark.parametrize("kind", ["zip", "dae", "3mf", "xyz", "obj.gz", "json"])
def test_other_types_are_refused_by_name(kind: str) -> None:
    assert re.search(f"'{kind}'.*obj, off, ply, stl, glb", str(refusal(b"x", kind)))


def test_bytes_without_a_type_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidMesh, match="type is missing"):
        load_mesh(b"v 0 0 0\n")
    (tmp_path / "mesh").write_bytes(b"v 0 0 0\n")
    with pytest.raises(InvalidMesh, match="type is missing"):
        load_mesh(tmp_path / "mesh")


@every_writer
def test_a_file_of_another_type_is_refused(kind: str, write: Writer) -> None:
    for other in KINDS:
        if other != kind:
            refusal(write(VERTICES, FACES), other)


def ends_inside_its_last_number(data: bytes, end: int) -> bool:
    """Whether what is cut off a text file leaves whole rows, if with fewer digits."""
    return data[end:].strip(b"\n0123456789.") == b""


@every_writer
def test_a_file_cut_short_anywhere_is_refused(kind: str, write: Writer) -> None:
    data = write(VERTICES, FACES[:2])
    for end in range(len(data)):
        if kind == "obj" and re.search(rb"\nf \d+ \d+ \d", data[:end]):
            continue  # an OBJ file may end after any face: nothing tells that more was to come
        if ends_inside_its_last_number(data, end):
            continue
        if write is stl and b"endsolid" in data[:end]:
            continue
        refusal(data[:end], kind)


@pytest.mark.parametrize(
    ("kind", "write", "index"),
    [
        (kind, write, index)
        for kind, write in NUMBERED
        for index in (8, -1, 2**31 - 1)
        if index >= 0 or kind not in ("obj", "glb")  # OBJ counts from 1, glTF has no sign
    ],
    ids=name_of,
)
def test_an_index_out_of_range_names_its_face(kind: str, write: Writer, index: int) -> None:
    faces = FACES.copy()
    faces[1, 2] = index
    error = refusal(write(VERTICES, faces), kind)
    assert (error.kind, error.elements) == ("face", (1,))
    assert re.search("face 1 .* numbered [01] to [78]", str(error))


@pytest.mark.parametrize(
    "row", [b"f 1 0 2", b"f 1 2 -99", b"f 1 2 99", b"f 1 2 x", b"f 1 2.5 3", b"f 0", b"f -0 1 2"]
)
def test_a_bad_obj_face_names_itself(row: bytes) -> None:
    error = refusal(obj(VERTICES, FACES) + row + b"\n", "obj")
    assert (error.kind, error.elements) == ("face", (3,))
    assert repr(row[2:].decode()) in str(error)


@pytest.mark.parametrize("row", [b"v 1 2", b"v 1 2 x", b"v 1 2 3x", b"v 1,0 2 3", b"v 1 2 --3"])
def test_a_bad_obj_vertex_names_itself(row: bytes) -> None:
    error = refusal(obj(VERTICES, FACES) + row + b"\n", "obj")
    assert (error.kind, error.elements) == ("vertex", (8,))


@every_numbered_writer
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_coordinates_that_are_not_finite_name_their_vertex(
    kind: str, write: Writer, value: float
) -> None:
    vertices = VERTICES.copy()
    vertices[2, 1] = value
    error = refusal(write(vertices, FACES), kind)
    assert (error.kind, error.elements) == ("vertex", (2,))


@every_soup_writer
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_stl_coordinates_that_are_not_finite_are_refused(
    kind: str, write: Writer, value: float
) -> None:
    vertices = VERTICES.copy()
    vertices[2, 1] = value
    error = refusal(write(vertices, FACES), kind)
    assert (error.kind, error.elements[0]) == ("vertex", 2)


@every_writer
def test_a_file_without_faces_is_refused(kind: str, write: Writer) -> None:
    refusal(write(VERTICES, FACES[:0]), kind)


@pytest.mark.usefixtures("capped_memory")
@pytest.mark.parametrize("count", [b"1000000000", b"9", b"99999999999999999999", b"-8", b"7", b"0"])
@pytest.mark.parametrize("write", [ply, ply_binary, off], ids=name_of)
def test_lying_vertex_counts_are_refused_before_memory_is_taken(
    write: Writer, count: bytes
) -> None:
    data = write(VERTICES, FACES)
    for honest in (b"vertex 8", b"OFF\n8"):
        data = data.replace(honest, honest[:-1] + count)
    refusal(data, "off" if write is off else "ply")


@pytest.mark.usefixtures("capped_memory")
@pytest.mark.parametrize("count", [b"1000000000", b"4", b"99999999999999999999", b"-3", b"0"])
@pytest.mark.parametrize("write", [ply, ply_binary, off], ids=name_of)
def test_lying_face_counts_are_refused_before_memory_is_taken(write: Writer, count: bytes) -> None:
    data = write(VERTICES, FACES)
    for honest, lie in ((b"face 3", b"face %b"), (b"8 3 0", b"8 %b 0")):
        data = data.replace(honest, lie % count)
    refusal(data, "off" if write is off else "ply")


@pytest.mark.usefixtures("capped_memory")
@pytest.mark.parametrize("count", [4, 10**9, 2**32 - 2])
def test_lying_stl_counts_are_refused_before_memory_is_taken(count: int) -> None:
    data = stl_binary(VERTICES, FACES)
    error = refusal(data[:80] + struct.pack("<I", count) + data[84:], "stl")
    assert f"declares {count} triangles" in str(error)


def lie(tree: dict[str, Any], *where: str | int, to: Any) -> None:
    for step in where[:-1]:
        tree = tree[step]  # type: ignore[index]
    tree[where[-1]] = to  # type: ignore[index]


@pytest.mark.usefixtures("capped_memory")
@pytest.mark.parametrize(
    ("where", "to"),
    [
        (("accessors", 0, "count"), 10**9),
        (("accessors", 0, "count"), 9),
        (("accessors", 0, "count"), 0),
        (("accessors", 0, "count"), -1),
        (("accessors", 0, "count"), "8"),
        (("accessors", 1, "count"), 10**12),
        (("accessors", 1, "count"), 8),
        (("accessors", 0, "byteOffset"), 8),
        (("accessors", 0, "bufferView"), 7),
        (("accessors", 0, "componentType"), 5123),
        (("accessors", 0, "componentType"), 17),
        (("accessors", 0, "type"), "VEC2"),
        (("accessors", 0, "sparse"), {"count": 1}),
        (("accessors", 0), {"componentType": 5126, "count": 8, "type": "VEC3"}),
        (("bufferViews", 0, "byteLength"), 10**9),
        (("bufferViews", 0, "byteStride"), 10**6),
        (("bufferViews", 0, "byteStride"), 0),
        (("bufferViews", 0, "byteStride"), -12),
        (("extensionsRequired",), ["EXT_meshopt_compression"]),
        (("bufferViews", 1, "buffer"), 3),
        (("meshes", 0, "primitives", 0, "attributes"), {}),
        (("meshes", 0, "primitives", 0, "mode"), 7),
        (("meshes", 0, "primitives", 0, "indices"), 5),
        (("meshes", 0, "primitives"), []),
        (("meshes",), 5),
        (("nodes", 0, "mesh"), 4),
        (("nodes", 0, "matrix"), [1, 2, 3]),
        (("nodes", 0, "scale"), [float("nan")] * 3),
        (("nodes", 0, "children"), [0]),
        (("scenes", 0, "nodes"), []),
        (("scenes", 0, "nodes"), [0, 0]),
        (("scenes",), []),
        (("scene",), 3),
    ],
)
def test_lying_glb_trees_are_refused(where: tuple[str | int, ...], to: Any) -> None:
    tree, binary = glb_tree(VERTICES, FACES)
    lie(tree, *where, to=to)
    refusal(glb_of(tree, binary), "glb")


@pytest.mark.parametrize(
    "row", [b"0", b"4 0 1 2", b"x 0 1 2", b"3 0 1", b"3 0 1 x", b"-3 0 1 2", b"2 0 99"]
)
@pytest.mark.parametrize("write", [ply, off], ids=name_of)
def test_bad_face_rows_are_refused(write: Writer, row: bytes) -> None:
    data = write(VERTICES, FACES).replace(b"3 0 2 3", row)
    refusal(data, write.__name__)


@pytest.mark.parametrize("row", [b"1.0 0.0", b"1.0 0.0 x", b"1.0 0.0 0.0.0"])
@pytest.mark.parametrize("write", [ply, off], ids=name_of)
def test_bad_vertex_rows_are_refused(write: Writer, row: bytes) -> None:
    data = write(VERTICES, FACES).replace(b"1.0 0.0 0.0", row)
    error = refusal(data, write.__name__)
    assert (error.kind, error.elements) == ("vertex", (1,))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"format ascii 1.0\n", b""),
        (b"format ascii", b"format utf8"),
        (b"end_header\n", b""),
        (b"property double x", b"property quadruple x"),
        (b"property double x", b"property double w"),
        (b"property double x\n", b""),
        (b"comment by hand", b"property int early"),
        (b"comment by hand", b"element vertex 8"),
        (b"comment by hand", b"nonsense"),
        (b"element vertex 8", b"element vertex"),
        (b"element vertex 8", b"element vertex 8.5"),
        (b"list uchar int", b"list uchar"),
        (b"vertex_indices", b"something_else"),
        (b"list uchar int vertex_indices", b"int vertex_indices"),
    ],
)
@pytest.mark.parametrize("write", [ply, ply_binary], ids=name_of)
def test_damaged_ply_headers_are_refused(write: Writer, old: bytes, new: bytes) -> None:
    old = old.replace(b"ascii", b"binary_little_endian") if write is ply_binary else old
    data = write(VERTICES, FACES)
    assert old in data
    refusal(data.replace(old, new), "ply")


def test_binary_ply_faces_of_no_corners_are_refused() -> None:
    assert "face 1 has no corners" in str(refusal(ply_binary(VERTICES, [[0, 1, 2], []]), "ply"))


@pytest.mark.parametrize("polygons", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3, 4]]])
def test_binary_ply_lists_of_a_negative_length_are_refused(polygons: list[list[int]]) -> None:
    data = ply_binary(VERTICES, polygons).replace(b"list uchar int", b"list char int")
    at = data.index(b"end_header\n") + len("end_header\n") + 8 * 24
    refusal(data[:at] + b"\xff" + data[at + 1 :], "ply")


def test_binary_ply_with_uneven_lists_everywhere() -> None:
    header = ply_header("binary_little_endian", 4, 2)
    header = header.replace(
        b"element face", b"element strip 2\nproperty list int short seen\nelement face"
    )
    header = header.replace(
        b"end_header", b"property list uchar float uv\nproperty uchar flag\nend_header"
    )
    body = b"".join(struct.pack("<3d", *vertex) for vertex in VERTICES[:4])
    body += struct.pack("<i2hi", 2, 7, 7, 0)
    body += struct.pack("<B3iB2fB", 3, 0, 1, 2, 2, 0.5, 0.5, 1)
    body += struct.pack("<B3iB1fB", 3, 0, 2, 3, 1, 0.5, 1)
    mesh = load_mesh(header + body, "ply")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert "2 strip" in mesh.warnings[0]
    for end in range(len(body)):
        refusal(header + body[:end], "ply")
    assert "1 bytes behind its last" in load_mesh(header + body + b"x", "ply").warnings[0]


def test_numbers_are_of_the_type_that_a_ply_header_says() -> None:
    data = ply([[0.1, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    single = data.replace(b"property double x", b"property float x")
    assert load_mesh(single, "ply").vertices[0, 0] == np.float32(0.1)
    assert load_mesh(data, "ply").vertices[0, 0] == 0.1


def test_ascii_ply_without_another_list_that_it_declares_is_refused() -> None:
    data = ply(VERTICES, FACES).replace(
        b"property list uchar int v",
        b"property list uchar float weights\nproperty list uchar int v",
    )
    assert "lists with their counts" in str(refusal(data, "ply"))


@pytest.fixture
def capped_memory() -> Any:
    """Fail where a gibibyte more than now is asked for."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = Path("/proc/self/statm")
    if not pages.exists():
        pytest.skip("the process's size is read from /proc")
    size = int(pages.read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + 2**30, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


LONG = b"9" * 5000


@pytest.mark.parametrize(
    ("kind", "old", "new", "says"),
    [
        ("off", b"8 3 0", LONG + b" 3 0", "begin with OFF and its counts"),
        ("off", b"3 0 2 3", b"3 0 2 " + LONG, "face 1 reads"),
        ("off", b"3 0 2 3", b"3 0 2 " + b"9" * 25, "face 1 reads"),
        ("off", b"3 0 2 3", LONG + b" 0 2 3", "face 1 reads"),
        ("off", b"3 0 2 3", b"3 0 2 1.5", "face 1 reads"),
        ("off", b"3 0 2 3", b"3 0 2 0_3", "face 1 reads"),
        ("ply", b"vertex 8", b"vertex " + LONG, "unknown line"),
        ("ply", b"3 0 2 3", b"3 0 2 " + LONG, "face 1 reads"),
        ("ply", b"3 0 2 3", LONG + b" 0 2 3", "face 1 reads"),
        ("ply", b"3 0 2 3", b"3 0 2 nan", "face 1 reads"),
        ("obj", b"f 1 3 4", b"f 1 3 " + b"0" * 5000 + b"4", "face 1 reads"),
    ],
)
def test_integers_that_are_none_or_too_long_name_their_row(
    kind: str, old: bytes, new: bytes, says: str
) -> None:
    data = {"off": off, "ply": ply, "obj": obj}[kind](VERTICES, FACES)
    assert data.count(old) == 1
    assert says in str(refusal(data.replace(old, new), kind))


@pytest.mark.parametrize("third", [[7, 5, 6], [7, 5, 6, 4]])
def test_a_binary_ply_that_is_cut_short_names_the_face_where_it_ends(third: list[int]) -> None:
    data = ply_binary(VERTICES, [[0, 1, 2], [0, 2, 3], third])
    last = 1 + 4 * len(third)
    for cut, face in ((1, 2), (last, 2), (last + 1, 1), (last + 13, 1)):
        assert f"ends within face {face}" in str(refusal(data[:-cut], "ply"))


def test_a_binary_ply_list_of_four_billion_corners_names_its_face() -> None:
    data = ply_binary(VERTICES, []).replace(b"face 0", b"face 1")
    data = data.replace(b"list uchar int", b"list uint int") + struct.pack(
        "<I3i", 2**32 - 1, 0, 1, 2
    )
    assert "ends within face 0" in str(refusal(data, "ply"))


SIGNALLING_NAN = bytes.fromhex("010080ff")
"""A NaN whose conversion numpy warns of"""


@pytest.mark.parametrize("kind", ["ply", "stl", "glb"])
def test_coordinates_without_a_value_are_refused_without_a_warning(kind: str) -> None:
    axis = np.array([1.0], "<f4").tobytes()
    body = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0).replace(axis, SIGNALLING_NAN, 1)
    header = ply_header("binary_little_endian", 3, 1).replace(b"double", b"float")
    tree, binary = glb_tree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    data = {
        "ply": header + body + struct.pack("<B3i", 3, 0, 1, 2),
        "stl": bytes(80) + struct.pack("<I3f", 1, 0, 0, 1) + body + bytes(2),
        "glb": glb_of(tree, body + binary[36:]),
    }[kind]
    assert "must be finite" in str(refusal(data, kind))


# --- Whatever the bytes ---------------------------------------------------------------------------


def loads_or_is_refused(data: bytes, kind: str) -> None:
    try:
        mesh = load_mesh(data, kind)
    except InvalidMesh:
        return
    assert isinstance(mesh, TriangleMesh)
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)


NUMBERS = st.sampled_from(["0", "1", "2", "3", "-1", "0.5", "1e300", "nan", "1e999", "x", "9" * 30])


def rows(data: st.DataObject, *starts: str) -> bytes:
    """Draw lines of numbers, each after one of some words."""
    line = st.tuples(st.sampled_from(starts), st.lists(NUMBERS, min_size=2, max_size=5))
    drawn = data.draw(st.lists(line, max_size=12))
    return "".join(f"{start} {' '.join(numbers)}\n" for start, numbers in drawn).encode()


def after_a_good_header(kind: str, data: st.DataObject) -> bytes:
    """Draw a file whose header promises a little, and whose rest is anything."""
    counts = data.draw(st.integers(0, 6)), data.draw(st.integers(0, 4))
    anything = data.draw(st.binary(max_size=50 * (counts[0] + counts[1])))
    match kind:
        case "obj":
            return b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" + rows(data, "v", "f", "vt", "f 1")
        case "off":
            return f"OFF\n{counts[0]} {counts[1]} 0\n".encode() + rows(data, "", "3", "0 0")
        case "ply":
            form = data.draw(st.sampled_from(["binary_little_endian", "binary_big_endian"]))
            if data.draw(st.booleans()):
                return ply_header("ascii", *counts) + rows(data, "", "3", "0 0")
            return ply_header(form, *counts) + anything
        case "stl":
            size = 50 * counts[1]
            return bytes(80) + struct.pack("<I", counts[1]) + (anything + bytes(size))[:size]
    return glb_of(data.draw(st.dictionaries(st.sampled_from(GLB_KEYS), GLB_VALUES)), anything)


GLB_KEYS = ["asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers"]
GLB_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.integers(-2, 5) | st.sampled_from(["2.0", "VEC3", "SCALAR", None, 5126, 5125]),
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.dictionaries(
            st.sampled_from(["nodes", "mesh", "primitives", "attributes", "POSITION", "indices"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=8,
)


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
def test_whatever_follows_a_good_header_loads_or_is_refused(kind: str, data: st.DataObject) -> None:
    loads_or_is_refused(after_a_good_header(kind, data), kind)


@given(data=st.data())
@pytest.mark.parametrize(("kind", "write"), ALL, ids=name_of)
def test_any_damage_loads_or_is_refused(kind: str, write: Writer, data: st.DataObject) -> None:
    damaged = bytearray(write(VERTICES, FACES))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(damaged)))
        width = data.draw(st.integers(0, 8))
        damaged[at : at + width] = data.draw(
            st.binary(max_size=8)
            | st.sampled_from([b"-1", b"9999999999", b"nan", b"\n", b" ", b"1e999"])
        )
    loads_or_is_refused(bytes(damaged), kind)


# --- Real files -----------------------------------------------------------------------------------

# Of the files themselves, counted by other means: components, boundary loops, vertices where fans
# meet, vertices of no face, vertices at the position of an earlier one.
REAL = {
    "spot.obj": (1, 0, 0, 0, 0),
    "cow.obj": (1, 0, 1, 0, 0),
    "teapot.obj": (4, 25, 38, 0, 403),
    "alligator.obj": (1, 1, 0, 0, 0),
    "bunny.obj": (1, 5, 0, 1113, 0),
}


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", REAL)
def test_real_obj_files_keep_their_numbering_and_get_a_true_report(name: str) -> None:
    rows = [row.split() for row in real_mesh(name).read_text().splitlines()]
    vertices = [[float(x) for x in row[1:4]] for row in rows if row and row[0] == "v"]
    faces = [
        [int(corner.split("/")[0]) - 1 for corner in row[1:]]
        for row in rows
        if row and row[0] == "f"
    ]
    mesh = load_mesh(real_mesh(name))
    assert mesh.vertices.tolist() == vertices
    assert mesh.faces.tolist() == faces
    assert mesh.face_map is None

    components, loops, fans, isolated, duplicates = REAL[name]
    report = mesh.report
    used = {v for face in faces for v in face}
    places = [tuple(vertices[v]) for v in sorted(used)]
    edges = {frozenset((face[i], face[i - 1])) for face in faces for i in range(3)}
    assert report.edges == len(edges)
    assert report.euler_characteristic == len(used) - len(edges) + len(faces)
    assert report.isolated_vertices.count == len(vertices) - len(used) == isolated
    assert report.duplicate_vertices.count == len(places) - len(set(places)) == duplicates
    assert len(mesh_parts(faces)) == report.components == components
    assert (report.boundary_loops, report.bow_tie_vertices.count) == (loops, fans)
    found = exact_distance(mesh, faces[0][0]).distances
    part = next(part for part in mesh_parts(faces) if faces[0][0] in part)
    assert np.flatnonzero(np.isfinite(found)).tolist() == sorted(part)


def mesh_parts(faces: list[list[int]]) -> list[set[int]]:
    """Return the vertices of each connected component."""
    near: dict[int, set[int]] = {}
    for face in faces:
        for v in face:
            near.setdefault(v, set()).update(face)
    parts = []
    while near:
        part, new = set(), {next(iter(near))}
        while new:
            part |= new
            new = set().union(*(near.pop(v) for v in new)) - part
        parts.append(part)
    return parts


@pytest.mark.parametrize(
    ("rows", "held"),
    [
        (b"l 1 2 3\nl 3 1\np 1\n", "2 lines, 1 points"),
        (b"p 1 2\n", "1 points"),
        (b"curv 0 1 1 2\n", "1 curves"),
    ],
)
def test_obj_without_faces_is_refused_with_what_it_holds(rows: bytes, held: str) -> None:
    error = refusal(obj(VERTICES[:3], FACES[:0]) + rows, "obj")
    assert str(error) == f"the OBJ file holds no faces, only {held}"
    assert error.kind == "face"


def test_obj_of_vertices_alone_is_refused() -> None:
    assert str(refusal(obj(VERTICES[:3], FACES[:0]), "obj")) == "the OBJ file holds no faces"

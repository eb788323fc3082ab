"""PLY beyond vertices and faces: strips, lists anywhere, bytes behind, capitals, line ends."""

import struct
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh
from tests.support.mesh_files import ply, ply_big_endian, ply_binary

pytestmark = pytest.mark.slice(8)

VERTICES = np.array([(x, y, 0.0) for y in range(3) for x in range(2)])
"""Two columns of a plane, in rows from below"""
QUADS = [[0, 1, 3, 2], [2, 3, 5, 4]]
FORMS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
WRITERS = {"ascii": ply, "binary_little_endian": ply_binary, "binary_big_endian": ply_big_endian}
every_form = pytest.mark.parametrize("form", FORMS)


def file_of(form: str, elements: list[tuple[str, list[str], list[list[Any]]]]) -> bytes:
    """Return a file of elements: name, properties, and rows; a list of a row with its count."""
    head, body = ["ply", f"format {form} 1.0"], b""
    for name, properties, rows in elements:
        head += [f"element {name} {len(rows)}", *(f"property {each}" for each in properties)]
        for row in rows:
            for given, value in zip(properties, row, strict=True):
                body += value_of(FORMS[form], given.split()[-2], value)
            body += b"" if FORMS[form] else b"\n"
    return "\n".join([*head, "end_header", ""]).encode() + body


def value_of(order: str, kind: str, value: Any) -> bytes:
    several = value if isinstance(value, list) else [value]
    if not order:
        counted = [len(several), *several] if isinstance(value, list) else several
        return " ".join(map(str, [*counted, ""])).encode()
    code = {"float": "f", "int": "i"}[kind]
    count = struct.pack("B", len(several)) if isinstance(value, list) else b""
    return count + struct.pack(f"{order}{len(several)}{code}", *several)


XYZ = ["float x", "float y", "float z"]
CORNERS = ["list uchar int vertex_indices"]
ROWS = [list(row) for row in VERTICES.tolist()]


def check_plane(mesh: gc.TriangleMesh, faces: int = 4) -> None:
    assert mesh.vertices.tolist() == VERTICES.tolist()
    assert len(mesh.faces) == faces
    distances = gc.exact_distance(mesh, 0).distances
    np.testing.assert_allclose(distances, np.hypot(*VERTICES.T[:2]), rtol=1e-14)


@every_form
@pytest.mark.parametrize(
    "strips",
    [
        [[0, 1, 2, 3, 4, 5]],
        [[0, 1, 2, 3, -1, 2, 3, 4, 5]],
        [[0, 1, 2, 3], [2, 3, 4, 5]],
        [[0, 1, 2, 3, -1], [2, 3, 4, 5, -1, 1, 2]],
        [[0, 1, 2, 3, 3, 2, 2, 3, 4, 5]],  # goes on elsewhere through triangles without area
    ],
)
def test_strips_of_triangles(form: str, strips: list[list[int]]) -> None:
    data = file_of(form, [("vertex", XYZ, ROWS), ("tristrips", CORNERS, [[s] for s in strips])])
    mesh = gc.load_mesh(data, "ply")
    check_plane(mesh)
    normals = np.cross(
        VERTICES[mesh.faces[:, 1]] - VERTICES[mesh.faces[:, 0]],
        VERTICES[mesh.faces[:, 2]] - VERTICES[mesh.faces[:, 0]],
    )
    assert (normals[:, 2] > 0).all()  # all turned alike


@every_form
@pytest.mark.parametrize("uneven", [False, True])
def test_lists_may_stand_anywhere(form: str, uneven: bool) -> None:
    several = [[[7] * (1 + uneven * (i % 3))] for i in range(6)]
    vertices = [[x, *near, y, z] for (x, y, z), near in zip(ROWS, several, strict=True)]
    in_vertex = ["float x", "list uchar int near", "float y", "float z"]
    texture = ["list uchar float texcoord", *CORNERS, "list uchar int more", "int flag"]
    faces = [[[0.5] * (8 + uneven * i), quad, [1, 2], 3] for i, quad in enumerate(QUADS)]
    data = file_of(form, [("vertex", in_vertex, vertices), ("face", texture, faces)])
    check_plane(gc.load_mesh(data, "ply"))


@every_form
@pytest.mark.parametrize(
    ("behind", "words"),
    [(b"\n", ""), (b"\r\n\r\n", ""), (b"7 7 7\n", "1 row|6 bytes"), (bytes(64), "1 row|64 byt")],
)
def test_what_lies_behind_the_last_element_is_left_out(
    form: str, behind: bytes, words: str
) -> None:
    mesh = gc.load_mesh(WRITERS[form](VERTICES, QUADS) + behind, "ply")
    check_plane(mesh)
    notes = [note for note in mesh.warnings if "left out" in note]
    assert len(notes) == bool(words)
    if words:
        assert any(word in notes[0] for word in words.split("|"))


@every_form
@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("capitals", [False, True])
def test_headers_in_capitals_and_of_any_line_ends(form: str, end: bytes, capitals: bool) -> None:
    head, mark, body = WRITERS[form](VERTICES, QUADS).partition(b"end_header\n")
    head = (head + mark).replace(b"\n", end)
    if capitals:
        head = b"PLY" + head[3:].replace(b"vertex", b"VERTEX").replace(b"format", b"Format")
    check_plane(gc.load_mesh(head + (body if FORMS[form] else body.replace(b"\n", end)), "ply"))


@every_form
def test_lists_and_strips_that_lie_are_refused(form: str) -> None:
    beyond = file_of(form, [("vertex", XYZ, ROWS), ("tristrips", CORNERS, [[[0, 1, 9]]])])
    short = file_of(form, [("vertex", XYZ, ROWS), ("tristrips", CORNERS, [[[0, 1]], [[-1]]])])
    flat = file_of(form, [("vertex", XYZ, ROWS), ("tristrips", ["int flag"], [[1]])])
    no_x = file_of(form, [("vertex", ["list uchar float x", *XYZ[1:]], [[[1.0], 0, 0]] * 6)])
    for data, message in (
        (beyond, r"face 0 is \[0, 1, 9\], but vertices"),
        (short, "no faces|there is no surface|has no corners|-1"),
        (flat, "PLY tristrips elements have no 'list"),
        (no_x, "no face elements"),
    ):
        with pytest.raises(InvalidMesh, match=message):
            gc.load_mesh(data, "ply")


@every_form
def test_axes_are_found_by_their_names_and_each_is_there_once(form: str) -> None:
    turned = [[z, 7.0, x, y] for x, y, z in ROWS]
    properties = ["float z", "float weight", "float x", "float y"]
    faces = ("face", CORNERS, [[quad] for quad in QUADS])
    check_plane(gc.load_mesh(file_of(form, [("vertex", properties, turned), faces]), "ply"))
    for axes in (["float x", "float y", "float w"], ["float x", "float y", "float x"]):
        data = file_of(form, [("vertex", axes, ROWS), faces])
        with pytest.raises(InvalidMesh, match="must have x, y and z once each"):
            gc.load_mesh(data, "ply")


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("first", [3, -1])
def test_a_list_with_fewer_items_than_none_is_refused(order: str, first: int) -> None:
    """In the first record, by which the others are read, and in a later one."""
    form = {"<": "little", ">": "big"}[order]
    head = file_of(f"binary_{form}_endian", [("vertex", XYZ, ROWS), ("face", CORNERS, [])])
    head = head.replace(b"element face 0", b"element face 2").replace(b"list uchar", b"list char")
    lists = [struct.pack(f"{order}b3i", count, 0, 1, 2) for count in (first, -1)]
    bad = 0 if first < 0 else 1
    with pytest.raises(InvalidMesh, match=f"list of face {bad} of the PLY file has -1 items"):
        gc.load_mesh(head + b"".join(lists), "ply")


def test_a_row_without_its_list_names_itself() -> None:
    data = file_of("ascii", [("vertex", XYZ, ROWS), ("face", ["list uchar int a", *CORNERS], [])])
    data = data.replace(b"element face 0", b"element face 2")
    for rows, bad in ((b"1 7 4 0 1 3 2\n9 7 4 2 3 5 4\n", 1), (b"x 4 0 1 3 2\n1 7 3 0 1 2\n", 0)):
        with pytest.raises(InvalidMesh, match=f"face {bad} reads") as refusal:
            gc.load_mesh(data + rows, "ply")
        assert refusal.value.elements == (bad,)


@pytest.mark.parametrize(("kind", "number"), [("float", "1e300"), ("char", "nan"), ("int", "1e99")])
def test_numbers_beyond_the_type_of_a_property_give_no_warning(kind: str, number: str) -> None:
    data = file_of("ascii", [("vertex", [*XYZ[:2], f"{kind} z"], ROWS), ("face", CORNERS, [])])
    data = data.replace(b"face 0", b"face 1").replace(b"1.0 2.0 0.0", f"1 2 {number}".encode())
    data += b"3 0 1 2\n"
    # A warning would be an error. A NaN of an integer type is any number.
    if kind == "float":
        with pytest.raises(InvalidMesh, match="vertex 5 is at"):
            gc.load_mesh(data, "ply")
    else:
        assert np.isfinite(gc.load_mesh(data, "ply").vertices).all()

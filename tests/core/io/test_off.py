"""OFF in its layouts: any white space, binary, with weights, colours and normals."""

import struct
from collections.abc import Callable

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh
from tests.support.mesh_files import off

CUBE = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TEXT = off(np.array(CUBE), QUADS)


def with_each_vertex(keyword: str, *more: float, scale: float = 1) -> bytes:
    """Return the cube with numbers behind each position."""
    words = " ".join(map(str, more))
    rows = [f"{scale * x} {scale * y} {scale * z} {words}" for x, y, z in CUBE]
    rows += [" ".join(map(str, (4, *quad))) for quad in QUADS]
    return "\n".join([keyword, "8 6 12", *rows, ""]).encode()


def binary(keyword: str = "OFF", *more: float, colours: int = 0) -> bytes:
    data = f"{keyword} BINARY\n".encode() + struct.pack(">3i", 8, 6, 12)
    for vertex in CUBE:
        data += struct.pack(f">{3 + len(more)}f", *vertex, *more)
    for quad in QUADS:
        data += struct.pack(f">6i{colours}f", 4, *quad, colours, *[0.5] * colours)
    return data


def words(data: bytes, separator: bytes) -> bytes:
    return separator.join(data.split())


LAYOUTS: dict[str, bytes] = {
    "rows": TEXT,
    "one line": words(TEXT, b" "),
    "a number a line": words(TEXT, b"\n"),
    "tabs": words(TEXT, b"\t"),
    "counts on three lines": TEXT.replace(b"8 6 0", b"8\n6\n0"),
    "no count of edges": TEXT.replace(b"8 6 0", b"8 6"),
    "counts behind the keyword": TEXT.replace(b"OFF\n", b"OFF "),
    "two vertices a line": TEXT.replace(b"0.0\n0.0", b"0.0 0.0"),
    "classic Mac line ends": TEXT.replace(b"\n", b"\r"),
    "Windows line ends": TEXT.replace(b"\n", b"\r\n"),
    "comments": b"# first\n" + TEXT.replace(b"\n", b" # here\n"),
    "rows behind": TEXT + b"7 7 7\nand words\n",
    "4OFF": with_each_vertex("4OFF", 1),
    "4OFF with weights": with_each_vertex("4OFF", 4, scale=4),
    "4OFF of words": words(with_each_vertex("4OFF", 0.5, scale=0.5), b" "),
    "COFF": with_each_vertex("COFF", 0.1, 0.2, 0.3, 1),
    "COFF of words": words(with_each_vertex("COFF", 0.1, 0.2, 0.3, 1), b" "),
    "NOFF of words": words(with_each_vertex("NOFF", 0, 0, 1), b"\r\n"),
    "STOFF of words": words(with_each_vertex("STOFF", 0.5, 0.5), b"\n"),
    "binary": binary(),
    "binary with colours": binary(colours=4),
    "binary COFF": binary("COFF", 0.1, 0.2, 0.3, 1),
    "binary NOFF": binary("NOFF", 0, 0, 1, colours=3),
    "binary 4OFF": binary("4OFF", 1),
    "binary and more behind": binary() + bytes(range(40)),
}


@pytest.mark.jit
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_cube_is_read_from_every_layout(name: str) -> None:
    mesh = gc.load_mesh(LAYOUTS[name], "off")
    assert mesh.vertices.tolist() == [list(vertex) for vertex in CUBE]
    assert len(mesh.faces) == 12
    distances = gc.exact_distance(mesh, 0).distances
    assert distances.argmax() == 7
    assert distances[7] == pytest.approx(np.sqrt(5))
    assert any("left out" in note for note in mesh.warnings) == ("behind" in name[-13:])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (TEXT[:-12], "header declares .* 13 rows follow|face 5 reads"),
        (words(TEXT, b" ")[:-2], "declares"),
        (words(TEXT, b" ") + b" 3", "declares"),
        (binary()[:-8], "face 5 of the OFF file is damaged, or the file ends before it"),
        (binary()[:30], "header declares"),
        (binary()[:12], "ends before its counts"),
        (b"nOFF 3\n1 1 0\n", r"any dimension \(nOFF\)"),
        (with_each_vertex("4OFF", 0), "vertex 0 is at"),
        (with_each_vertex("4OFF"), "vertex 0 reads .* it must have 4 numbers"),
        (binary().replace(struct.pack(">i", 4), struct.pack(">i", -4)), "face 0 .* damaged"),
        (b"OFFSET 3 1 0\n", "does not begin with OFF"),
    ],
    ids=range(11),
)
def test_what_does_not_add_up_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(InvalidMesh, match=message) as refusal:
        gc.load_mesh(data, "off")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("make", [lambda: words(TEXT, b" "), binary])
def test_limits_hold_in_every_layout(make: Callable[[], bytes]) -> None:
    with pytest.raises(gc.errors.TooManyFaces):
        gc.load_mesh(make(), "off", max_faces=11)
    assert len(gc.load_mesh(make(), "off", max_faces=12).faces) == 12

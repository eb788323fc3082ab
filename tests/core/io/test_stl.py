"""STL files, in text and binary."""

import struct

import numpy as np
import pytest

from geodesic_core.errors import TooManyFaces
from geodesic_core.io.load import load_mesh
from geodesic_core.solvers import exact_distance
from tests.core.io.test_load import FACES, LONG, VERTICES, refusal
from tests.support.mesh_files import stl, stl_binary

pytestmark = pytest.mark.slice(8)

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
HALVES = [[0, 1, 2], [0, 2, 3]]


def counted(data: bytes, count: int) -> bytes:
    return data[:80] + struct.pack("<I", count) + data[84:]


def test_ascii_stl_of_several_solids() -> None:
    data = stl(VERTICES, FACES[:2]) + stl(VERTICES, FACES[2:])
    assert load_mesh(data, "stl").faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]


def test_binary_stl_whose_header_says_solid() -> None:
    data = b"solid as some exporters write" + stl_binary(VERTICES, FACES)[29:]
    assert len(load_mesh(data, "stl").faces) == 3


def test_an_ascii_stl_that_loses_a_corner_is_refused() -> None:
    data = stl(VERTICES, FACES).replace(b"vertex 1.0 0.0 0.0\n", b"", 1)
    error = refusal(data, "stl")
    assert "facet 0" in str(error)
    assert (error.kind, error.elements) == ("face", (0,))
    refusal(stl(VERTICES, FACES).replace(b"vertex 1.0 0.0 0.0", b"vertex 1.0 0.0"), "stl")


def test_ascii_stl_normals_that_cannot_be_read_leave_no_line_in_the_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    data = stl(VERTICES, FACES)
    expected = load_mesh(data, "stl")
    mesh = load_mesh(data.replace(b"normal 0 0 1", b"normal 0 x " + LONG), "stl")
    assert mesh.vertices.tolist() == expected.vertices.tolist()
    assert mesh.faces.tolist() == expected.faces.tolist()
    assert not caplog.records


@pytest.mark.parametrize("row", [b"endloop\nendfacet\n", b"facet normal 0 0 1\n"])
def test_ascii_stl_facets_that_run_into_each_other_are_refused(row: bytes) -> None:
    data = stl(VERTICES, FACES)
    head, _, tail = data.partition(row)
    error = refusal(head + row + tail.replace(row, b"", 1), "stl")
    assert (error.kind, error.elements) == ("face", (1,))


@pytest.mark.parametrize(
    "header", [b"solid by some writer", b"SOLID facet", b"\0\xff made by hand"]
)
@pytest.mark.parametrize("behind", [b"\n", b"\0" * 49, bytes(328), bytes(3000), b"endsolid\n"])
def test_bytes_behind_the_last_triangle_are_left_out_with_a_note(
    header: bytes, behind: bytes
) -> None:
    data = header.ljust(80) + stl_binary(SQUARE, HALVES)[80:]
    assert not load_mesh(data, "stl").warnings
    mesh = load_mesh(data + behind, "stl")
    assert exact_distance(mesh, 0).distances.tolist() == pytest.approx([0, 1, 2.0**0.5, 1])
    (note,) = mesh.warnings
    assert f"{len(behind)} bytes behind its last triangle" in note


def test_triangles_beyond_those_declared_are_bytes_behind() -> None:
    mesh = load_mesh(counted(stl_binary(VERTICES, FACES), 2), "stl")
    assert len(mesh.faces) == 2
    assert "50 bytes behind its last triangle" in mesh.warnings[0]


@pytest.mark.parametrize("count", [0, 2**32 - 1])
def test_triangles_that_a_writer_did_not_count_are_all_read(count: int) -> None:
    data = counted(stl_binary(SQUARE, HALVES), count)
    mesh = load_mesh(data, "stl")
    assert len(mesh.faces) == 2
    assert mesh.warnings == (
        f"The STL file declares {count} triangles; all 2 that it holds were read.",
    )
    with pytest.raises(TooManyFaces):
        load_mesh(data, "stl", max_faces=1)
    for cut in (data[:-1], data + b"\n"):
        assert f"declares {count} triangles" in str(refusal(cut, "stl"))


def test_binary_numbers_are_those_of_single_precision() -> None:
    corners = np.random.default_rng(0).normal(size=(30, 3)).astype(np.float32)
    mesh = load_mesh(stl_binary(corners, np.arange(30).reshape(-1, 3)), "stl")
    assert mesh.vertices.tolist() == corners.astype(float).tolist()


def test_the_attribute_of_a_triangle_means_nothing() -> None:
    data = bytearray(stl_binary(VERTICES, FACES))
    for face in range(3):
        data[84 + 50 * face + 48 : 84 + 50 * face + 50] = b"\x1f\xfc"
    expected = load_mesh(stl_binary(VERTICES, FACES), "stl")
    assert load_mesh(bytes(data), "stl").vertices.tobytes() == expected.vertices.tobytes()


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b"\r\r\n", b"\n\n"])
@pytest.mark.parametrize("begin", [b"", b"\xef\xbb\xbf", b" \t", b"\n\n", b"\xef\xbb\xbf\r\n "])
@pytest.mark.parametrize("is_upper", [False, True])
def test_text_is_read_whatever_its_line_ends_its_begin_and_its_case(
    begin: bytes, end: bytes, *, is_upper: bool
) -> None:
    data = stl(SQUARE, HALVES)
    data = begin + (data.upper() if is_upper else data).replace(b"\n", end)
    mesh = load_mesh(data, "stl")
    assert exact_distance(mesh, 0).distances.tolist() == pytest.approx([0, 1, 2.0**0.5, 1])
    assert not mesh.warnings


@pytest.mark.parametrize("name", [b"", b" ", b" another", b" facet vertex endfacet"])
@pytest.mark.parametrize("solids", [1, 2, 3])
def test_solids_end_with_their_name_or_another_or_none(name: bytes, solids: int) -> None:
    data = stl(VERTICES, FACES).replace(b"endsolid part", b"endsolid" + name)
    mesh = load_mesh(data.replace(b"solid part", b"solid" + name, 1) * solids, "stl")
    assert len(mesh.faces) == 3 * solids
    assert len(mesh.vertices) == 7

"""Whatever is wrong is refused, by type, and the message names the element."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tolerances import LARGEST_COORDINATE, SHORTEST_EDGE
from tests.support import zoo

POINTS = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
FACES = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def with_value(array, place, value):
    changed = array.copy()
    changed[place] = value
    return changed


@pytest.fixture
def mesh():
    return gc.TriangleMesh(POINTS, FACES)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [(0, 0), (3, 2)])
def test_coordinates_must_be_finite(value, place):
    with pytest.raises(gc.errors.InvalidMesh, match=rf"vertex {place[0]}\b") as caught:
        gc.TriangleMesh(with_value(POINTS, place, value), FACES)
    assert caught.value.kind == "vertex"
    assert caught.value.elements == (place[0],)


def test_unused_vertices_must_be_finite_too():
    with pytest.raises(gc.errors.InvalidMesh, match=r"vertex 4\b"):
        gc.TriangleMesh(np.vstack([POINTS, (0, np.nan, 0)]), FACES)


@pytest.mark.parametrize("index", [-1, 4, 2**31, -(2**31), 2**40])
def test_indices_must_be_in_range(index):
    with pytest.raises(gc.errors.InvalidMesh, match=r"face 2\b") as caught:
        gc.TriangleMesh(POINTS, with_value(FACES.astype(np.int64), (2, 1), index))
    assert caught.value.kind == "face"
    assert caught.value.elements == (2,)
    assert str(index) in str(caught.value)


def test_unsigned_indices_must_be_in_range():
    with pytest.raises(gc.errors.InvalidMesh, match=r"face 0\b"):
        gc.TriangleMesh(POINTS, with_value(FACES.astype(np.uint64), (0, 0), 2**64 - 1))


def test_the_first_ten_faults_are_named():
    faces = np.tile(np.array([(0, 0, 1)]), (25, 1))
    with pytest.raises(gc.errors.InvalidMesh, match="each face repeats a vertex") as caught:
        gc.TriangleMesh(POINTS, faces)
    assert caught.value.elements == tuple(range(10))


@pytest.mark.parametrize(
    "faces", [np.zeros((0, 3), int), np.zeros(0, int), [], np.zeros((0, 4), int)]
)
def test_a_mesh_has_faces(faces):
    with pytest.raises(gc.errors.InvalidMesh, match="no faces"):
        gc.TriangleMesh(POINTS, faces)


def test_a_mesh_has_vertices():
    with pytest.raises(gc.errors.InvalidMesh):
        gc.TriangleMesh(np.zeros((0, 3)), FACES)
    with pytest.raises(gc.errors.InvalidMesh):
        gc.TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), int))


@pytest.mark.parametrize(
    "vertices",
    [
        POINTS[:, :2], POINTS.reshape(-1), POINTS[None], [[0, 0, 0], [1, 0]], None, "mesh",
        [["a", "b", "c"]] * 4, POINTS + 1j, POINTS.astype(object), [[None] * 3] * 4,
    ],
    ids=[
        "two columns", "flat", "three dimensions", "ragged", "None", "text", "letters", "complex",
        "objects", "nones",
    ],
)  # fmt: skip
def test_vertices_are_rows_of_three_numbers(vertices):
    if isinstance(vertices, np.ndarray) and vertices.dtype == object:
        assert len(gc.TriangleMesh(vertices, FACES).vertices) == 4  # floats all the same
        return
    with pytest.raises(gc.errors.InvalidMesh) as caught:
        gc.TriangleMesh(vertices, FACES)
    assert caught.value.kind == "vertex"


@pytest.mark.parametrize(
    "faces",
    [
        FACES[:, :2], np.hstack([FACES, FACES]), FACES.reshape(-1), FACES[None],
        FACES.astype(float), FACES.astype(bool), [[0, 1, 2], [0, 1]], None, "mesh",
        FACES.astype(str), FACES + 0j,
    ],
    ids=[
        "two columns", "six columns", "flat", "three dimensions", "floats", "booleans", "ragged",
        "None", "text", "digits", "complex",
    ],
)  # fmt: skip
def test_faces_are_rows_of_three_integers(faces):
    with pytest.raises(gc.errors.InvalidMesh) as caught:
        gc.TriangleMesh(POINTS, faces)
    assert caught.value.kind == "face"


@pytest.mark.parametrize("length", [1e-51, 1e-200, 5e-324])
def test_an_edge_that_is_too_short_is_refused(length):
    points = [(0, 0, 0), (length, 0, 0), (0, 1, 0), (1, 1, 0)]
    with pytest.raises(gc.errors.InvalidMesh, match=r"face 1\b.*shorter than 1e-50") as caught:
        gc.TriangleMesh(points, [(0, 2, 3), (0, 1, 2)])
    assert caught.value.elements == (1,)


def test_faces_of_edges_of_no_length_alone_are_no_surface():
    points = [(0, 0, 0), (0, 0, 0), (0, 0, -0.0), (0, 1, 0)]
    with pytest.raises(gc.errors.InvalidMesh, match="no surface") as caught:
        gc.TriangleMesh(points, [(0, 1, 2), (0, 1, 3), (3, 3, 1)])
    assert caught.value.elements == (0, 1, 2)


@pytest.mark.parametrize(
    ("corners", "sizes", "what"),
    [
        ([0, 1, 2], [], "no faces"),
        ([0, 1, 2, 3], [3], "sum to 3"),
        ([0, 1, 2], [3, 0], r"face 1 has no corners"),
        ([0, 1, 2], [4, -1], r"face 1 has no corners"),
        ([0, 1, 2, 1, 2, 3, 4], [3, 4], r"face 1 is \[1, 2, 3, 4\].* 0 to 3"),
        ([0, 1, 2, -1], [4], r"face 0\b"),
        ([0.0, 1.0, 2.0], [3], "integers"),
        ([[0, 1, 2]], [3], "integers"),
        (["0", "1", "2"], [3], "integers"),
        ([0, 1, 2], [3.0], "integers"),
        ([[0, 1, 2], [0, 1]], [3, 2], "rows of corners"),
        ([0, 0, 1, 1, 1], [4, 1], "repeats a vertex"),
    ],
)
def test_polygons_are_rows_of_vertices(corners, sizes, what):
    with pytest.raises(gc.errors.InvalidMesh, match=what) as caught:
        gc.TriangleMesh.from_polygons(POINTS, corners, sizes)
    assert caught.value.kind == "face"


def test_vertices_of_polygons_must_be_finite():
    with pytest.raises(gc.errors.InvalidMesh, match=r"vertex 2\b"):
        gc.TriangleMesh.from_polygons(with_value(POINTS, (2, 0), np.nan), [0, 1, 2, 3], [4])


def test_a_face_out_of_range_is_named_past_one_that_repeats_a_vertex():
    with pytest.raises(gc.errors.InvalidMesh, match=r"face 1 is \[0, 1, 9\]"):
        gc.TriangleMesh(POINTS, [(0, 0, 1), (0, 1, 9)])


def test_merge_is_one_of_two():
    with pytest.raises(gc.errors.InvalidArgument, match="merge"):
        gc.TriangleMesh(POINTS, FACES, merge="sometimes")


BAD_INDICES = [
    -1,
    4,
    2**31,
    2**70,
    np.int64(-1),
    True,
    np.True_,
    1.0,
    1.5,
    np.float64(1),
    "1",
    None,
]


@pytest.mark.parametrize("index", BAD_INDICES, ids=repr)
@pytest.mark.parametrize(
    "spelling", [lambda i: i, lambda i: [0, i], gc.SurfacePoint.vertex, gc.Source]
)
def test_sources_are_vertices(mesh, index, spelling):
    with pytest.raises((gc.errors.InvalidPoint, gc.errors.InvalidArgument)) as caught:
        gc.exact_distance(mesh, spelling(index))
    assert str(index) in str(caught.value) or repr(index) in str(caught.value)


@pytest.mark.parametrize("index", BAD_INDICES, ids=repr)
def test_targets_are_vertices(mesh, index):
    field = gc.exact_distance(mesh, 0)
    with pytest.raises((gc.errors.InvalidPoint, gc.errors.InvalidArgument)):
        field.path_to(index)
    with pytest.raises((gc.errors.InvalidPoint, gc.errors.InvalidArgument)):
        gc.shortest_path(mesh, 0, index)


def test_an_index_out_of_range_is_an_invalid_point(mesh):
    for index in (-1, 4):
        with pytest.raises(gc.errors.InvalidPoint, match=str(index)):
            gc.exact_distance(mesh, index)
        with pytest.raises(gc.errors.InvalidPoint, match=str(index)):
            gc.exact_distance(mesh, 0).path_to(index)


@pytest.mark.parametrize("sources", [[], (), np.array([], dtype=int)], ids=repr)
def test_there_is_a_source(mesh, sources):
    with pytest.raises(gc.errors.InvalidPoint, match="source"):
        gc.exact_distance(mesh, sources)


@pytest.mark.parametrize(
    "sources", [np.array([[0, 1]]), np.array([0.0, 1.0]), {"vertex": 0}, [[0]]]
)
def test_sources_of_another_kind(mesh, sources):
    with pytest.raises((gc.errors.InvalidPoint, gc.errors.InvalidArgument)):
        gc.exact_distance(mesh, sources)


@pytest.mark.parametrize("start", [-1.0, -1e-300, np.nan, np.inf, -np.inf, "0", None, 1j], ids=repr)
def test_start_distances_are_finite_and_not_negative(mesh, start):
    with pytest.raises(gc.errors.InvalidArgument, match="start"):
        gc.exact_distance(mesh, [0, gc.Source(1, start)])


@pytest.mark.parametrize(
    "limit",
    [-1.0, -1e-300, np.nan, -np.inf, "1", 1j, np.complex128(1), 10**400],
    ids=lambda limit: repr(limit)[:20],
)
def test_max_distance_is_a_distance(mesh, limit):
    with pytest.raises(gc.errors.InvalidArgument, match="max_distance"):
        gc.exact_distance(mesh, 0, max_distance=limit)


@pytest.mark.parametrize(
    "value",
    [
        0,
        -1,
        1,
        2,
        0.0,
        -0.0,
        1.0,
        -1e-300,
        np.nan,
        np.inf,
        -np.inf,
        True,
        False,
        "x",
        "0.1",
        1j,
        [0.1],
    ],
    ids=repr,
)
@pytest.mark.parametrize("absolute", [None, 0.1])
def test_relative_error_lies_between_zero_and_one(mesh, value, absolute):
    with pytest.raises(gc.errors.InvalidArgument, match=r"^relative_error") as caught:
        gc.approximate_distance(mesh, 0, value, absolute)
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize(
    "value", [0, -1, 0.0, -1e-300, np.nan, np.inf, -np.inf, True, False, "x", 1j, [0.1]], ids=repr
)
@pytest.mark.parametrize("relative", [None, 1e-3])
def test_absolute_error_is_finite_and_above_zero(mesh, value, relative):
    with pytest.raises(gc.errors.InvalidArgument, match=r"^absolute_error") as caught:
        gc.approximate_distance(mesh, 0, relative, value)
    assert repr(value) in str(caught.value)


def test_some_error_is_granted(mesh):
    with pytest.raises(gc.errors.InvalidArgument, match=r"relative_error.*absolute_error.*None"):
        gc.approximate_distance(mesh, 0, None)
    with pytest.raises(gc.errors.InvalidArgument, match="None"):
        gc.approximate_distance(mesh, 0, relative_error=None, absolute_error=None)


@pytest.mark.parametrize("value", [np.nextafter(0, 1), 1e-300, np.nextafter(1, 0), np.float32(0.5)])
def test_errors_at_the_limits_of_their_domain(mesh, value):
    distances = gc.exact_distance(mesh, 0).distances
    for arguments in ((value,), (None, value), (value, value), (value, 1e300)):
        found = gc.approximate_distance(mesh, 0, *arguments).distances
        np.testing.assert_allclose(found, distances, rtol=2 * float(value) + 1e-12)


def test_approximate_distances_refuse_what_exact_ones_refuse(mesh):
    refused = [
        ({"sources": -1}, gc.errors.InvalidPoint),
        ({"sources": []}, gc.errors.InvalidPoint),
        ({"sources": gc.Source(0, np.nan)}, gc.errors.InvalidArgument),
        ({"sources": 0, "max_distance": -1.0}, gc.errors.InvalidArgument),
    ]
    for arguments, error in refused:
        with pytest.raises(error):
            gc.approximate_distance(mesh, **arguments)
    with pytest.raises(gc.errors.InvalidPoint, match="4"):
        gc.approximate_distance(mesh, 0).path_to(4)


def test_an_array_of_no_dimensions_is_the_index_in_it(mesh):
    index, other = np.array(3), np.array(0, np.int32)
    expected = gc.exact_distance(mesh, 3).distances
    for sources in (index, [index], gc.Source(index)):
        np.testing.assert_array_equal(gc.exact_distance(mesh, sources).distances, expected)
    assert gc.exact_distance(mesh, 3, targets=other).distance_at(other) == expected[0]
    assert gc.distance_matrix(mesh, index, other).tolist() == [[expected[0]]]
    assert gc.shortest_path(mesh, index, other).length == expected[0]
    np.testing.assert_array_equal(mesh.position(index), mesh.vertices[3])
    for wrong in (np.array(4), np.array(1.0), np.array(None), np.array(True)):
        with pytest.raises(gc.errors.InvalidPoint):
            gc.exact_distance(mesh, wrong)
    with pytest.raises(gc.errors.InvalidArgument, match="must be a sequence of face ids"):
        gc.exact_distance(mesh, 0, barriers=np.array(3))


@pytest.mark.parametrize("effort", [2.0, np.float64(2), 3, True, "2"], ids=repr)
def test_effort_is_one_of_four_integers(mesh, effort):
    with pytest.raises(gc.errors.InvalidArgument, match=r"effort is .*; it must be 1, 2, 4 or 8"):
        gc.fast_distance(mesh, 0, effort)


@pytest.mark.parametrize("t", ["x", None, True], ids=repr)
def test_the_share_of_an_edge_is_a_number(t):
    with pytest.raises(gc.errors.InvalidPoint, match=r"t is .*; it must be a number from 0 to 1"):
        gc.SurfacePoint.edge(0, 0, t)


def test_every_refusal_is_a_geodesic_error():
    for error in (gc.errors.InvalidMesh, gc.errors.InvalidPoint, gc.errors.InvalidArgument):
        assert issubclass(error, gc.errors.GeodesicError)


@pytest.mark.jit
@pytest.mark.parametrize("exponent", [-300, -150, -100, -80, -60, -40, 40, 60, 80, 100, 150, 300])
def test_extreme_coordinates_are_right_or_refused(exponent):
    case, scale = zoo.SMALL["crumpled_sphere"], 10.0**exponent
    sources = [gc.Source(0), gc.Source(20, 0.3)]
    distances = gc.exact_distance(gc.TriangleMesh(case.vertices, case.faces), sources).distances
    try:
        mesh = gc.TriangleMesh(case.vertices * scale, case.faces)
    except gc.errors.InvalidMesh:
        return
    scaled = gc.exact_distance(mesh, [gc.Source(0), gc.Source(20, 0.3 * scale)]).distances
    np.testing.assert_allclose(scaled / scale, distances, rtol=1e-12)


def masked(array, place):
    mask = np.zeros(array.shape, bool)
    mask[place] = True
    return np.ma.masked_array(array, mask)


@pytest.mark.parametrize("place", [3, (3, 2), (slice(3, None), 0)])
def test_masked_vertices_are_refused(place):
    with pytest.raises(gc.errors.InvalidMesh, match="vertex 3 is masked: leave masked") as caught:
        gc.TriangleMesh(masked(POINTS, place), FACES)
    assert (caught.value.kind, caught.value.elements) == ("vertex", (3,))
    with pytest.raises(gc.errors.InvalidMesh, match="vertex 3 is masked"):
        gc.as_mesh((masked(POINTS, place), FACES))
    with pytest.raises(gc.errors.InvalidMesh, match="vertex 3 is masked"):
        gc.TriangleMesh.from_polygons(masked(POINTS, place), [0, 1, 2], [3])


@pytest.mark.parametrize("place", [1, (1, 2), (slice(1, 2), slice(None))])
def test_masked_faces_are_refused(place):
    with pytest.raises(gc.errors.InvalidMesh, match="face 1 is masked") as caught:
        gc.TriangleMesh(POINTS, masked(FACES, place))
    assert (caught.value.kind, caught.value.elements) == ("face", (1,))
    with pytest.raises(gc.errors.InvalidMesh, match="is masked"):
        gc.TriangleMesh.from_polygons(POINTS, masked(FACES.ravel(), 4), [3] * 4)


def test_several_masked_vertices_are_counted():
    with pytest.raises(gc.errors.InvalidMesh, match=r"vertex 1 is masked \(and 2 more\)"):
        gc.TriangleMesh(masked(POINTS, slice(1, None)), FACES)


def test_arrays_that_mask_nothing_are_as_others():
    mesh = gc.TriangleMesh(np.ma.masked_array(POINTS), np.ma.masked_less(FACES, 0))
    assert mesh.faces.tolist() == FACES.tolist()


@pytest.mark.parametrize(("share", "is_taken"), [(1.0, True), (1.01, False)])
def test_largest_coordinate_is_the_most_that_is_taken(share, is_taken):
    points, faces = zoo.octahedron()
    points = points / np.abs(points).max()
    vertices = share * LARGEST_COORDINATE * points
    if is_taken:
        distance = gc.exact_distance(gc.TriangleMesh(vertices, faces), 0).distances
        expected = gc.exact_distance(gc.TriangleMesh(points, faces), 0).distances
        np.testing.assert_allclose(distance / LARGEST_COORDINATE, expected, rtol=1e-14)
    else:
        with pytest.raises(gc.errors.InvalidMesh, match="at most"):
            gc.TriangleMesh(vertices, faces)


@pytest.mark.parametrize(("share", "is_taken"), [(1.01, True), (0.99, False)])
def test_shortest_edge_is_the_least_that_is_taken(share, is_taken):
    vertices = share * SHORTEST_EDGE * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    if is_taken:
        distance = gc.exact_distance(gc.TriangleMesh(vertices, [(0, 1, 2)]), 1).distances
        np.testing.assert_allclose(distance / vertices[1, 0], [1, 0, math.sqrt(2)], rtol=1e-14)
    else:
        with pytest.raises(gc.errors.InvalidMesh, match="shorter than"):
            gc.TriangleMesh(vertices, [(0, 1, 2)])

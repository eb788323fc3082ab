"""The mesh: its report, its warnings, merging, and what a store keeps of it."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tolerances import ROUGH, ROUGH_VERTICES, SHARP_SADDLE

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_report_of_a_closed_mesh():
    report = gc.TriangleMesh(CORNERS, TETRAHEDRON).report

    assert (report.vertices, report.faces, report.edges) == (4, 4, 6)
    assert (report.components, report.boundary_loops, report.euler_characteristic) == (1, 0, 2)
    assert (report.saddle_vertices, report.boundary_vertices) == (0, 0)
    assert report.bounds == ((0, 0, 0), (1, 1, 1))
    assert report.mean_edge_length == pytest.approx((3 + 3 * np.sqrt(2)) / 6, rel=1e-15)


def test_report_of_an_open_mesh():
    report = gc.samples.plane(200).report

    assert (report.boundary_loops, report.euler_characteristic) == (1, 1)
    assert report.boundary_vertices == 40


def test_report_of_a_handle():
    assert gc.samples.knot(600).report.euler_characteristic == 0


def test_nothing_to_warn_of():
    assert gc.TriangleMesh(CORNERS, TETRAHEDRON).warnings == ()


def test_warns_of_components():
    mesh = gc.TriangleMesh(
        TRIANGLE + [[9, 9, z] for z in (0, 1, 3)] + [[8, 8, 8]], [[0, 1, 2], [3, 6, 5]]
    )
    (components, isolated) = mesh.warnings

    assert "2 connected components" in components
    assert "first is vertex 4" in isolated


def test_warns_of_a_seam_and_names_the_remedy():
    apart = gc.TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [3, 4, 5]]
    )
    assert "merge='exact'" in apart.warnings[1]

    joined = gc.TriangleMesh(apart.vertices, apart.faces, merge="exact")
    assert joined.warnings == ()
    np.testing.assert_array_equal(joined.vertex_map, [0, 1, 2, 1, 3, 2])
    np.testing.assert_array_equal(joined.vertices[joined.vertex_map], apart.vertices)
    assert gc.exact_distance(joined, 0).distances[3] == pytest.approx(np.sqrt(2), rel=1e-15)


def test_merging_takes_the_two_zeros_as_one():
    points = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [0, 0, 1], [1, 0, 0]]
    mesh = gc.TriangleMesh(points, [[0, 1, 2], [3, 4, 5]], merge="exact")

    assert len(mesh.vertices) == 4


def test_merge_must_be_known():
    with pytest.raises(gc.errors.InvalidArgument, match="'near'"):
        gc.TriangleMesh(TRIANGLE, [[0, 1, 2]], merge="near")


def test_warns_of_faces_without_area():
    mesh = gc.TriangleMesh([*TRIANGLE, [0.5, 0.5, 0]], [[0, 1, 2], [2, 1, 3]])

    assert mesh.report.degenerate_faces == gc.Sample(1, (1,))
    assert "first is face 1" in mesh.warnings[0]


def test_warns_of_fans_that_meet():
    mesh = gc.TriangleMesh([*TRIANGLE, [-1, 0, 0], [0, -1, 0]], [[0, 1, 2], [0, 3, 4]])

    assert mesh.report.bow_tie_vertices == gc.Sample(1, (0,))
    assert "first is vertex 0" in mesh.warnings[0]


@pytest.mark.jit
def test_what_a_store_keeps_makes_the_same_mesh():
    ball = gc.samples.sphere(320)
    mesh = gc.TriangleMesh(ball.vertices, ball.faces, merge="exact")
    again = gc.TriangleMesh.from_arrays(mesh.arrays())

    assert again.report == mesh.report
    assert again.nbytes == mesh.nbytes == sum(array.nbytes for array in mesh.arrays().values())
    field, twin = gc.exact_distance(mesh, 3), gc.exact_distance(again, 3)
    assert field.distances.tobytes() == twin.distances.tobytes()


def test_is_frozen_and_apart_from_what_was_given():
    points = np.array(CORNERS, float)
    mesh = gc.TriangleMesh(points, TETRAHEDRON)
    points[:] = 7

    assert mesh.vertices.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 1
    with pytest.raises(AttributeError, match="a TriangleMesh does not change"):
        mesh.vertices = mesh.vertices * 10  # type: ignore[misc]
    assert mesh.vertices.max() == 1
    assert repr(mesh) == "TriangleMesh(4 vertices, 4 faces)"


def is_rough(saddles: int, excess: float, vertices: int = 2 * ROUGH_VERTICES) -> bool:
    """Whether a flat mesh counts as rough when some of its vertices have so much excess."""
    mesh = gc.samples.plane(8)
    angles = np.full(vertices, 2 * math.pi)
    angles[:saddles] += excess
    rough = mesh.topology._replace(total_angle=angles)
    vars(mesh)["embedding"] = mesh.embedding._replace(topology=rough)
    return mesh.is_rough


@pytest.mark.parametrize(("excess", "expected"), [(0.99, False), (1.01, True)])
def test_sharp_saddle_is_the_least_excess_that_makes_a_mesh_rough(excess, expected):
    assert is_rough(2 * ROUGH_VERTICES, excess * SHARP_SADDLE) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.99, False), (1.01, True)])
def test_rough_is_the_least_share_of_sharp_saddles(share, expected):
    assert is_rough(round(share * ROUGH * 2 * ROUGH_VERTICES), 1.0) == expected


@pytest.mark.parametrize(("vertices", "expected"), [(-1, False), (0, True)])
def test_rough_vertices_are_the_fewest_of_a_rough_mesh(vertices, expected):
    count = ROUGH_VERTICES + vertices
    assert is_rough(count, 1.0, count) == expected

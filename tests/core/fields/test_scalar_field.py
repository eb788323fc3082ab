"""Level sets, gradients and values of functions that are linear on each face."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint
from tests.support import zoo
from tests.support.isoline_checks import check_ends, check_locations, check_pieces
from tests.support.meshes import mesh_of, random_points

DIRECTION = np.array([0.48, -0.36, 0.8])


@pytest.mark.parametrize(
    "mesh", [gc.samples.sphere(2000), gc.samples.knot(2000)], ids=["ball", "knot"]
)
def test_levels_of_a_linear_function_are_plane_sections(mesh: gc.TriangleMesh) -> None:
    """Against the sections of trimesh: the same length, and each of its points on the lines."""
    field = gc.ScalarField(mesh, mesh.vertices @ DIRECTION)
    levels = np.quantile(field.values, [0.2, 0.5, 0.77])
    for level, lines in zip(levels, field.isolines(levels), strict=True):
        section = mesh.to_trimesh().section(DIRECTION, level * DIRECTION)
        assert sum(line.length for line in lines) == pytest.approx(section.length, rel=1e-9)
        for line in lines:
            assert line.closed
            np.testing.assert_allclose(line.points @ DIRECTION, level, atol=1e-12)
            check_pieces(mesh, line)
            check_locations(mesh, line)


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_lines_of_any_values_on_any_surface(case: zoo.Case | zoo.Irregular) -> None:
    """The value at each point is the level, all crossings are found, and lines end as they may."""
    mesh = mesh_of(case)
    values = np.random.default_rng(7).normal(size=len(mesh.vertices))
    field = gc.ScalarField(mesh, values)
    for level, lines in zip([-0.5, 0.1], field.isolines([-0.5, 0.1]), strict=True):
        for line in lines:
            np.testing.assert_allclose(field.at(line.locations), level, atol=1e-9)
            check_locations(mesh, line)
            if np.ptp(mesh.vertices) < 1e3:
                check_ends(mesh, line)
        found = {point for line in lines for point in line.locations}
        assert len(found) == count_of_crossings(mesh, values, level)


def count_of_crossings(mesh: gc.TriangleMesh, values: np.ndarray, level: float) -> int:
    """Edges of the surface that have the level in between."""
    inner = np.flatnonzero(mesh.inner_face >= 0)
    nodes = mesh.topology.inner_vertex[mesh.faces[inner]]
    edges = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    at = values[mesh.topology.outer_vertex]
    return int(((at[edges[:, 0]] <= level) != (at[edges[:, 1]] <= level)).sum())


def test_higher_values_are_on_the_left() -> None:
    """On a plane seen from above, by the rise of the function to the left of each segment."""
    mesh = gc.samples.plane(200)
    rise = np.array([0.6, 0.8, 0.0])
    lines = gc.ScalarField(mesh, mesh.vertices @ rise).isolines([0.3, 0.7])
    lines += gc.exact_distance(mesh, 0).isolines([0.3, 0.7])
    for (line,) in lines:
        along = np.diff(line.points, axis=0)
        left = np.stack([-along[:, 1], along[:, 0]], axis=1)
        uphill = rise[:2] if line in lines[0] + lines[1] else line.points[:-1, :2]
        assert ((left * uphill).sum(axis=1) > 0.0).all()


def test_a_surface_that_is_wound_the_other_way_has_its_lines_turned() -> None:
    mesh = gc.samples.plane(50)
    turned = gc.TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])
    (line,), (other,) = (
        gc.ScalarField(each, each.vertices[:, 0]).isolines([0.4])[0] for each in (mesh, turned)
    )
    np.testing.assert_array_equal(line.points, other.points[::-1])


def test_what_is_at_the_level_counts_as_below() -> None:
    """A plateau's rim, where values rise from it; through vertices; nothing where all are below."""
    mesh = gc.samples.plane(200)
    across = np.maximum(mesh.vertices[:, 0] - 0.5, 0.0)  # flat up to the middle
    (line,) = gc.ScalarField(mesh, across).isolines([0.0])[0]
    np.testing.assert_array_equal(line.points[:, 0], 0.5)
    assert all(point.vertex_index is not None for point in line.locations)
    assert line.length == pytest.approx(1.0, abs=1e-15)
    assert gc.ScalarField(mesh, -across).isolines([0.0]) == [[]]
    assert gc.ScalarField(mesh, np.zeros(len(mesh.vertices))).isolines([0.0]) == [[]]


def test_lines_end_where_values_are_missing() -> None:
    mesh = gc.samples.plane(200)
    values = mesh.vertices[:, 1].copy()
    middle = int(np.hypot(*(mesh.vertices[:, :2] - 0.5).T).argmin())
    values[middle] = np.nan
    field = gc.ScalarField(mesh, values)
    lines = field.isolines([0.47])[0]
    assert len(lines) == 2
    beside = np.flatnonzero((mesh.faces == middle).any(axis=1))
    assert not np.isin(np.concatenate([line.faces for line in lines]), beside).any()
    assert np.isnan(field.at(middle))
    assert np.isnan(field.gradient()[beside]).all()


@given(st.lists(st.integers(-3, 3), min_size=9, max_size=9), st.integers(-3, 3))
def test_ties_of_whole_numbers(heights: list[int], level: int) -> None:
    """Lines are closed or end at the boundary, and have a length, whatever is at the level."""
    mesh = gc.samples.plane(8)
    assert len(mesh.vertices) == 9
    for line in gc.ScalarField(mesh, heights).isolines([level])[0]:
        assert line.length > 0.0
        check_ends(mesh, line)
        check_locations(mesh, line)


def test_values_may_be_as_large_as_numbers_are() -> None:
    mesh = gc.samples.plane(2)
    (line,) = gc.ScalarField(mesh, [-1.7e308, 1.7e308, -1.7e308, 1.7e308]).isolines([0.85e308])[0]
    np.testing.assert_allclose(line.points[:, 0], 0.75, atol=1e-15)


def test_gradients_are_those_of_a_linear_function() -> None:
    mesh = gc.samples.knot(500)
    found = gc.ScalarField(mesh, mesh.vertices @ DIRECTION + 3.0).gradient()
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    expected = DIRECTION - (normals @ DIRECTION)[:, None] * normals
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_values_at_points_are_interpolated() -> None:
    mesh = gc.samples.knot(500)
    field = gc.ScalarField(mesh, mesh.vertices @ DIRECTION)
    points = random_points(mesh, 12)
    expected = [mesh.position(point) @ DIRECTION for point in points]
    np.testing.assert_allclose(field.at(points), expected, atol=1e-12)
    assert field.at(points[0]) == pytest.approx(expected[0], abs=1e-12)


def test_a_surface_of_lengths_has_lines_as_locations() -> None:
    mesh = gc.samples.knot(500)
    steps = mesh.vertices[np.roll(mesh.faces, -1, axis=1)] - mesh.vertices[mesh.faces]
    twin = gc.TriangleMesh.from_lengths(mesh.faces, np.linalg.norm(steps, axis=2))
    values = mesh.vertices @ DIRECTION
    (expected,), (found,) = (gc.ScalarField(each, values).isolines([0.1]) for each in (mesh, twin))
    assert len(found) == len(expected)
    for line, other in zip(found, expected, strict=True):
        assert set(line.locations) == set(other.locations)
        assert line.length == pytest.approx(other.length, rel=1e-12)
        with pytest.raises(InvalidArgument, match="lengths alone: use locations"):
            _ = line.points
    with pytest.raises(InvalidArgument, match="by its lengths"):
        gc.ScalarField(twin, values).gradient()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1.0, 2.0], r"shape \(2,\); it must be \(4,\)"),
        ("abcd", "not real numbers"),
        ([[0.0]] * 4, r"shape \(4, 1\)"),
        ([1j, 0, 0, 0], "not real numbers"),
    ],
)
def test_other_values_are_refused(values: object, words: str) -> None:
    with pytest.raises(InvalidArgument, match=words):
        gc.ScalarField(gc.samples.plane(2), values)  # type: ignore[arg-type]


@pytest.mark.parametrize("levels", [1.0, "1", [np.nan], [np.inf], [None], [True]])
def test_other_levels_are_refused(levels: object) -> None:
    field = gc.ScalarField(gc.samples.plane(2), [0, 1, 2, 3])
    with pytest.raises(InvalidArgument, match="level"):
        field.isolines(levels)  # type: ignore[arg-type]
    with pytest.raises(InvalidPoint, match="point 1"):
        field.at([0, 9])


def test_levels_lie_evenly_between_the_lowest_and_the_highest_value() -> None:
    field = gc.ScalarField(gc.samples.plane(2), [-1.0, np.nan, 3.0, np.inf])
    assert field.levels(3).tolist() == [0.0, 1.0, 2.0]
    for count in (0, 1.5, True):
        with pytest.raises(InvalidArgument, match="an integer, 1 or more"):
            field.levels(count)  # type: ignore[arg-type]
    for values in ([2.0] * 4, [np.nan] * 4):
        with pytest.raises(InvalidArgument, match="no two values differ"):
            gc.ScalarField(field.mesh, values).levels(1)

"""Exact distances on the zoo: to every vertex, from every vertex, against the oracles."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import expected, zoo

EXACT = 1e-9
"""Relative error allowed at every vertex. Lengths are sums of a few hundred roundings of 1e-16."""


def sources_of(case: zoo.Case, count: int) -> np.ndarray:
    """Up to ``count`` sources, the first and the last vertex among them."""
    last = len(case.vertices) - 1
    return np.unique(np.linspace(0, last, min(count, last + 1)).astype(int))


def check_source(mesh, source, distances):
    field = gc.exact_distance(mesh, source)
    np.testing.assert_allclose(field.distances, distances, rtol=EXACT, atol=0)
    np.testing.assert_array_equal(field.nearest_source, np.where(np.isfinite(distances), 0, -1))


@pytest.mark.slice(12)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_small_meshes_from_every_vertex(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in sources_of(case, 12 if WITHOUT_JIT else len(case.vertices)):
        check_source(mesh, source, expected.matrix(case)[source])


@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_closed_forms(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in sources_of(case, 4 if case.name.endswith("_grid") else 12):
        check_source(mesh, source, case.distances(source))


@pytest.mark.full
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_closed_forms_from_every_vertex(case):
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in range(len(case.vertices)):
        check_source(mesh, source, case.distances(source))


@pytest.mark.jit
@pytest.mark.parametrize("name", ["flat", "slivers_1e-05", "crowded_lines", "pleats_slivers"])
@pytest.mark.parametrize("seed", range(3))
def test_slivers_after_rigid_motion(name, seed):
    """Rotated coordinates are rounded, so that what was flat is only nearly so."""
    case = zoo.KNOWN[name].moved(zoo.rotation(seed), (1.0, 2.0, -3.0))
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in sources_of(case, 5):
        distances = case.distances(source)
        found = gc.exact_distance(mesh, source).distances
        # The motion itself moves each vertex by some 1e-15: that much is not the solver's.
        np.testing.assert_allclose(found, distances, rtol=EXACT, atol=1e-14)


def test_field_has_the_documented_arrays():
    case = zoo.SMALL["two_components"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    field = gc.exact_distance(mesh, 1)
    assert field.distances.shape == field.nearest_source.shape == (len(case.vertices),)
    assert field.distances.dtype == np.float64
    assert field.nearest_source.dtype == np.int32
    assert field.mesh is mesh
    assert field.max_distance == np.inf
    assert [source.start_distance for source in field.sources] == [0.0]
    assert (field.error_bound.type, field.error_bound.value) == ("relative", 0.0)
    assert field.error_bound.kind == "guaranteed"


def test_stats_are_plausible():
    case = zoo.SMALL["sphere"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    stats = gc.exact_distance(mesh, 0).stats
    assert 0 < stats.windows_peak <= stats.windows_created
    assert stats.windows_per_edge_created == pytest.approx(
        stats.windows_created / mesh.report.edges
    )
    assert stats.peak_bytes > 0
    assert stats.seconds > 0
    assert stats.as_dict()["windows_created"] == stats.windows_created


def test_other_components_and_isolated_vertices_are_unreachable():
    case = zoo.SMALL["isolated_vertices"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    isolated = np.setdiff1d(np.arange(len(case.vertices)), case.faces)
    field = gc.exact_distance(mesh, case.faces[0, 0])
    np.testing.assert_array_equal(np.flatnonzero(np.isinf(field.distances)), isolated)
    np.testing.assert_array_equal(np.flatnonzero(field.nearest_source == -1), isolated)
    lonely = gc.exact_distance(mesh, isolated[0])
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(lonely.distances)), isolated[:1])
    assert lonely.distances[isolated[0]] == 0


def test_faces_of_no_area_carry_paths_along_them():
    """A vertex in the middle of an edge, joined to it by a face without area."""
    vertices = [(0, 0, 0), (2, 0, 0), (1, 0, 0), (1, 1, 0), (1, -1, 0)]
    faces = [(0, 2, 3), (2, 1, 3), (0, 1, 2), (1, 0, 4)]
    mesh = gc.TriangleMesh(vertices, faces)
    assert mesh.report.degenerate_faces.ids == (2,)
    points = np.array(vertices, dtype=float)
    for source in range(5):
        check_source(mesh, source, np.linalg.norm(points - points[source], axis=1))

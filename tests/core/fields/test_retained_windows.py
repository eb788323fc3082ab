"""Points of an exact field by the windows that it kept: the same as by a search, or on the way."""

import itertools
import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.errors import MemoryLimitExceeded, NoPath
from geodesic_core.fields import point_query
from tests.conftest import WITHOUT_JIT
from tests.core.fields.test_points import SAME, random_points
from tests.support import zoo
from tests.support.certificates import check_path
from tests.support.meshes import mesh_of


def kept_field(mesh, sources, **options):
    return gc.exact_distance(mesh, sources, retain="windows", **options)


@pytest.mark.slice(4)
@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_windows_find_what_a_sweep_to_the_point_finds(case):
    mesh = mesh_of(case)
    points = random_points(mesh, 4 if WITHOUT_JIT else 12, seed=21)
    for source in points[:6]:
        kept, told = kept_field(mesh, source), gc.exact_distance(mesh, source, targets=points)
        np.testing.assert_array_equal(kept.distances, told.distances)
        for target in points:
            distance = told.distance_at(target)
            assert kept.distance_at(target) == pytest.approx(distance, rel=SAME, abs=1e-14)
            assert kept.nearest_source_at(target) == told.nearest_source_at(target)
            if math.isinf(distance):
                with pytest.raises(NoPath, match="component"):
                    kept.path_to(target)
            else:
                check_path(mesh, kept.path_to(target), source, target, distance)


@pytest.mark.slice(3)
@pytest.mark.jit
@zoo.each(zoo.KNOWN)
def test_windows_on_meshes_of_closed_forms(case):
    mesh = mesh_of(case)
    source, *targets = random_points(mesh, 30, seed=22)
    kept, told = kept_field(mesh, source), gc.exact_distance(mesh, source, targets=targets)
    for target in targets:
        distance = told.distance_at(target)
        assert kept.distance_at(target) == pytest.approx(distance, rel=SAME, abs=1e-14)
        check_path(mesh, kept.path_to(target), source, target, distance)


@zoo.each(zoo.SMALL)
def test_several_sources_with_start_distances(case):
    mesh = mesh_of(case)
    points = random_points(mesh, 4 if WITHOUT_JIT else 9, seed=23)
    sources = [gc.Source(point, 0.1 * i * mesh.diagonal) for i, point in enumerate(points[:3])]
    kept, plain = kept_field(mesh, sources), gc.exact_distance(mesh, sources)
    for point in points:
        assert kept.distance_at(point) == pytest.approx(plain.distance_at(point), rel=SAME)
        nearest, other = kept.nearest_source_at(point), plain.nearest_source_at(point)
        if nearest != other:  # two that are as near
            alone = [gc.exact_distance(mesh, s.point).distance_at(point) for s in sources]
            ways = [s.start_distance + way for s, way in zip(sources, alone, strict=True)]
            assert ways[nearest] == pytest.approx(ways[other], rel=SAME)


@zoo.each(zoo.SMALL)
def test_windows_keep_to_max_distance(case):
    mesh = mesh_of(case)
    source, *targets = random_points(mesh, 4 if WITHOUT_JIT else 10, seed=24)
    full = gc.exact_distance(mesh, source, targets=targets)
    known = sorted(full.distance_at(target) for target in targets)
    limit = 0.5 * (known[1] + known[2])
    near = kept_field(mesh, source, max_distance=limit)
    for target in targets:
        distance = full.distance_at(target)
        if distance > limit:
            assert near.distance_at(target) == math.inf
            assert near.nearest_source_at(target) == -1
            with pytest.raises(NoPath):
                near.path_to(target)
        else:
            assert near.distance_at(target) == pytest.approx(distance, rel=SAME, abs=1e-14)


@pytest.mark.jit
def test_what_is_kept_changes_nothing_else():
    mesh = gc.samples.knot(500)
    kept, plain = kept_field(mesh, [3, 50]), gc.exact_distance(mesh, [3, 50])
    np.testing.assert_array_equal(kept.distances, plain.distances)
    np.testing.assert_array_equal(kept.nearest_source, plain.nearest_source)
    for target in (0, 40, 199):
        np.testing.assert_array_equal(kept.path_to(target).points, plain.path_to(target).points)
    assert kept.stats.windows_kept == plain.stats.windows_kept
    assert kept.stats.peak_bytes >= plain.stats.peak_bytes + 64 * kept.stats.windows_kept


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_kept_windows_hold_nothing_that_was_in_memory_before(solve):
    """A file of a field is the same to the bit, and tells nothing of others."""
    mesh = gc.samples.knot(500)
    contents = set()
    for filled in range(3):
        junk = [np.full((2000, 8), 1.5 + filled) for _ in range(50)]
        del junk
        contents.add(solve(mesh, 0, retain="windows").arrays()["windows"].tobytes())
    assert len(contents) == 1


@pytest.mark.parametrize("solve", [gc.exact_distance, gc.approximate_distance])
def test_kept_windows_count_against_the_memory_limit(solve):
    mesh = gc.samples.knot(500)
    lean = solve(mesh, 0).stats.peak_bytes
    solve(mesh, 0, memory_limit=lean)
    with pytest.raises(MemoryLimitExceeded):
        solve(mesh, 0, memory_limit=lean, retain="windows")
    needed = solve(mesh, 0, retain="windows").stats.peak_bytes
    solve(mesh, 0, memory_limit=needed, retain="windows")


@pytest.mark.jit
def test_points_of_an_approximate_field_mean_the_same_whether_it_kept_windows_or_not():
    mesh = gc.samples.knot(500)
    source, *targets = random_points(mesh, 8, seed=25)
    fields = [
        gc.approximate_distance(mesh, source, 0.05, retain=retain)
        for retain in ("windows", "distances")
    ]
    exact = gc.exact_distance(mesh, source, targets=targets)
    for field, target in itertools.product(fields, targets):
        if target.vertex_index is None:
            expected = exact.distance_at(target)
            assert field.distance_at(target) == pytest.approx(expected, rel=SAME)


@pytest.mark.jit
def test_a_point_is_added_without_a_copy(monkeypatch):
    field = kept_field(gc.samples.plane(8), 0)
    location = gc.SurfacePoint.face(3, (0.2, 0.3, 0.5))
    traced = []

    def checked_path(*arguments):
        traced.extend(arguments)
        return whole(*arguments)

    whole = point_query.checked_path
    monkeypatch.setattr(point_query, "checked_path", checked_path)
    field.path_to(location)
    winners, _ = field._points.exact.get(Control())
    _, added, nodes, node = traced
    assert added.vertices is winners.vertices
    assert added.sites is winners.sites
    assert nodes.site(node) == location
    assert added.reached(node) == (field.distance_at(location), 0)

"""Points of an exact field by the windows that it kept: the same as by a search, or on the way."""

import itertools

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.errors import MemoryLimitExceeded
from geodesic_core.fields import point_query
from tests.core.fields.test_points import SAME
from tests.support.meshes import random_points


def kept_field(mesh, sources, **options):
    return gc.exact_distance(mesh, sources, retain="windows", **options)


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

"""Fields by the error that is granted, 0 for exact ones; checks of them and of their paths."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from tests.conftest import WITHOUT_JIT
from tests.support import zoo
from tests.support.path_checks import LENGTH, check_path

ERRORS = (1e-4, 1e-3, 1e-2, 5e-2)
GRANTED = (0, 1e-2) if WITHOUT_JIT else (0, *ERRORS)
"""Errors of exact distances, and of approximate ones."""
each_error = pytest.mark.parametrize("error", GRANTED)
"""Run a test with each of them, as its argument ``error``."""
exact_or_not = pytest.mark.parametrize("error", [0, 1e-2])
"""The same with fewer, where an answer takes long."""
ROUNDING = 1e-9
"""Relative: what exact distances themselves are allowed."""


def _hilly(vertices, height, seed):
    """A mesh over the plane, with smooth random hills."""
    phase = np.random.default_rng(seed).uniform(0, 6, 4)
    x, y = vertices[:, 0], vertices[:, 1]
    hills = np.sin(x + phase[0]) * np.sin(y + phase[1]) + np.sin(2 * x + phase[2] - y + phase[3])
    return np.stack([x, y, height * hills], axis=1)


def _terrain(columns, rows, height, seed, holes=()):
    points, faces = zoo.grid(columns, rows, seed=seed, jitter=0.22)
    faces = zoo.without_cells(faces, columns, holes)
    return zoo.drop_unused(_hilly(points, height, seed), faces)


def _pulled(mesh, factors):
    return mesh[0] * factors, mesh[1]


MERGING = {
    case.name: case
    for case in (
        zoo.Case("ball", *zoo.icosphere(2)),
        zoo.Case("dented_ball", zoo.crumpled(zoo.icosphere(2)[0], 0.1, 3), zoo.icosphere(2)[1]),
        zoo.Case("spindle", *_pulled(zoo.icosphere(2), (1, 0.3, 3))),
        zoo.Case("ring", *zoo.torus(16, 10)),
        zoo.Case("dented_ring", zoo.crumpled(zoo.torus(16, 10)[0], 0.15, 4), zoo.torus(16, 10)[1]),
        zoo.Case("land", *_terrain(12, 10, 0.3, 5)),
        zoo.Case("islands", *_terrain(12, 10, 0.4, 6, [(3, 3), (4, 3), (8, 6), (8, 7), (2, 7)])),
        zoo.Case("furrows", *_pulled(_terrain(12, 10, 0.5, 7), (1, 0.02, 0.1))),
    )
}
"""Some hundred faces each, on which much is merged and many vertices are lit from several sides."""


def solve(mesh: gc.TriangleMesh, sources, error: float, **options) -> gc.DistanceField:
    """The exact field if no error is granted, else the approximate one."""
    if error == 0:
        return gc.exact_distance(mesh, sources, **options)
    return gc.approximate_distance(mesh, sources, error, **options)


def some_sources(case: zoo.Case, count: int) -> list[int]:
    """Up to ``count`` vertices, evenly spread, the first and the last among them."""
    last = len(case.vertices) - 1
    return np.unique(np.linspace(0, last, min(count, last + 1)).astype(int)).tolist()


def check_within(found, exact, relative=math.inf, absolute=math.inf, *, moved=0.0) -> None:
    """Never above the exact distances, below by the errors at most, reached where they are.

    ``moved`` is what rounding has done to the mesh itself.
    """
    found, exact = np.asarray(found), np.asarray(exact)
    reached = np.isfinite(exact)
    np.testing.assert_array_equal(np.isfinite(found), reached)
    np.testing.assert_array_equal(found[~reached], np.inf)
    found, exact = found[reached], exact[reached]
    rounding = ROUNDING * exact + moved
    assert (found <= exact + rounding).all()
    allowed = np.minimum(relative * exact if math.isfinite(relative) else np.inf, absolute)
    assert (exact - found <= allowed + rounding).all()


def check_limited(field: gc.DistanceField, exact, limit: float, relative: float) -> None:
    """What is near enough is reached, within the error, and nothing beyond the limit."""
    assert field.max_distance == limit
    reached = np.isfinite(field.distances)
    assert (field.distances[reached] <= limit).all()
    assert reached[exact <= limit * (1 - ROUNDING)].all()
    check_within(field.distances[reached], exact[reached], relative)
    np.testing.assert_array_equal(field.distances[~reached], np.inf)
    np.testing.assert_array_equal(field.nearest_source[~reached], -1)


def check_approximate_path(
    field: gc.DistanceField, target: int, exact: float, relative: float
) -> gc.GeodesicPath:
    """Over the surface, between the exact distance and that with the error; and it says so."""
    path = field.path_to(target)
    source = field.sources[field.nearest_source[target]]
    root = source.point if isinstance(source.point, int) else source.point.vertex_index
    check_path(field.mesh, path, int(root), target, path.length)
    reach, least = source.start_distance + path.length, field.distances[target]
    assert least <= exact * (1 + ROUNDING)
    assert exact * (1 - ROUNDING) <= reach <= exact * (1 + relative + ROUNDING)
    bound = path.error_bound
    if relative == 0:
        assert path.length == pytest.approx(least - source.start_distance, rel=LENGTH, abs=0)
        assert bound == field.error_bound
    else:
        assert (bound.type, bound.kind) == ("relative", "guaranteed")
        share = max(reach - least, 0.0) / least  # below 0 by rounding only
        assert bound.value == pytest.approx(share, rel=1e-9, abs=1e-13)
    return path

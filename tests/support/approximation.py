"""Checks of approximate fields and of their paths, given the exact distances."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo
from tests.support.certificates import check_path

ERRORS = (1e-4, 1e-3, 1e-2, 5e-2)
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


def solved(case: zoo.Case, *arguments, **options) -> gc.DistanceField:
    """The approximate field of a mesh."""
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    return gc.approximate_distance(mesh, *arguments, **options)


def some_sources(case: zoo.Case, count: int) -> list[int]:
    """Up to ``count`` vertices, evenly spread, the first and the last among them."""
    last = len(case.vertices) - 1
    return np.unique(np.linspace(0, last, min(count, last + 1)).astype(int)).tolist()


def check_within(found, exact, relative=math.inf, absolute=math.inf) -> None:
    """Never above the exact distances, below by the errors at most, reached where they are."""
    found, exact = np.asarray(found), np.asarray(exact)
    reached = np.isfinite(exact)
    np.testing.assert_array_equal(np.isfinite(found), reached)
    found, exact = found[reached], exact[reached]
    assert (found <= exact * (1 + ROUNDING)).all()
    allowed = np.minimum(relative * exact if math.isfinite(relative) else np.inf, absolute)
    assert (exact - found <= allowed + ROUNDING * exact).all()


def check_approximate_path(field, target: int, exact: float, relative: float) -> None:
    """Over the surface, between the exact distance and that with the error; and it says so."""
    path = field.path_to(target)
    source = field.sources[field.nearest_source[target]]
    root = source.point if isinstance(source.point, int) else source.point.vertex_index
    check_path(field.mesh, path, int(root), target, path.length)
    reach, least = source.start_distance + path.length, field.distances[target]
    assert exact * (1 - ROUNDING) <= reach <= exact * (1 + relative + ROUNDING)
    bound = path.error_bound
    assert (bound.type, bound.kind) == ("relative", "guaranteed")
    share = max(reach - least, 0.0) / least  # below 0 by rounding only
    assert bound.value == pytest.approx(share, rel=1e-9, abs=1e-13)
    assert least <= exact * (1 + ROUNDING)

"""The cost of samples: by a radius alone, about as many points as discs cover the surface."""

from typing import Any

import pytest

import geodesic_core as gc
from app.queries import MeshSize, SamplesQuery
from app.schemas.requests import SamplesRequest


def query(mesh: gc.TriangleMesh, **body: Any) -> SamplesQuery:
    report = mesh.report
    size = MeshSize(report.vertices, report.faces, report.mean_edge_length)
    return SamplesQuery.ask("a" * 32, size, SamplesRequest(**body))


@pytest.mark.parametrize("mesh", [gc.samples.plane(2000), gc.samples.knot(2000)])
@pytest.mark.parametrize("radius", [0.2, 1.0])
def test_as_many_points_are_expected_as_are_found(mesh: gc.TriangleMesh, radius: float) -> None:
    """Within a factor of 4: discs overlap, and surfaces are bent."""
    found = len(gc.farthest_points(mesh, radius=radius))
    asked = query(mesh, radius=radius)
    counts = (max(found // 4, 1), min(4 * found, len(mesh.vertices)))
    few, many = (query(mesh, count=count).rough_seconds() for count in counts)
    assert few <= asked.rough_seconds() <= many


def test_what_is_reached_first_counts() -> None:
    mesh = gc.samples.plane(2000)
    by_count, all_of_them = query(mesh, count=5), query(mesh, count=len(mesh.vertices))
    assert query(mesh, count=5, radius=0.0).rough_seconds() == by_count.rough_seconds()
    assert query(mesh, radius=0.0).rough_seconds() == all_of_them.rough_seconds()
    assert query(mesh, count=5, radius=9.0).rough_seconds() < by_count.rough_seconds()

"""Checks of the borders of any field, by separate fields of each source."""

from collections import Counter

import numpy as np

import geodesic_core as gc
from tests.support.isoline_checks import edge_kinds, from_segment, line_points

NEAR = 1e-8
"""Relative difference of two distances at a point of a border."""


def fields_of_each(mesh, sources, max_distance=None):
    """An exact field of each source alone."""
    return [gc.exact_distance(mesh, source, max_distance, retain="windows") for source in sources]


def check_points(mesh, sources, borders, most=60):
    """At points, evenly taken, both sources are equally near, and no other is nearer."""
    alone = fields_of_each(mesh, sources)
    for line in borders:
        points = line_points(mesh, line)
        for point in points[:: max(len(points) * len(borders) // most, 1)]:
            found = np.array([field.distance_at(point) for field in alone])
            first, second = found[list(line.sources)]
            np.testing.assert_allclose(first, second, rtol=NEAR)
            assert found.min() >= first * (1.0 - NEAR)


def check_chords(mesh, sources, borders, chord_error, most=40):
    """In the middle of a chord two distances differ by as much as it may stray, both ways."""
    alone = fields_of_each(mesh, sources)
    for line in borders:
        ends = np.vstack([line.points, line.points[:1]]) if line.closed else line.points
        middles = 0.5 * (ends[1:] + ends[:-1])
        step = max(len(middles) * len(borders) // most, 1)
        for face, middle in list(zip(line.faces.tolist(), middles, strict=True))[::step]:
            weights = np.linalg.lstsq(
                np.vstack([mesh.vertices[mesh.faces[face]].T, np.ones(3)]),
                [*middle, 1.0],
                rcond=None,
            )[0]
            weights = np.clip(weights, 0.0, None)
            point = gc.SurfacePoint.face(face, tuple(weights / weights.sum()))
            first, second = (alone[i].distance_at(point) for i in line.sources)
            assert abs(first - second) <= 2.0 * chord_error + NEAR * first


def check_crossings(mesh, field, borders):
    """Along each edge the lines lead from the nearest source of one end to that of the other.

    A line that crosses it has the source that is the nearest before, and leads to its other one.
    """
    crossing = {(*point, line.sources) for line in borders for point in line.points.tolist()}
    points = np.array([each[:3] for each in crossing]).reshape(-1, 3)
    sources = [each[3] for each in crossing]
    for u, v in edge_kinds(mesh):
        nearest, last = int(field.nearest_source[u]), int(field.nearest_source[v])
        if min(nearest, last) < 0:
            continue
        start, way = mesh.vertices[u], mesh.vertices[v] - mesh.vertices[u]
        rest = points - start
        places = rest @ way / (way @ way)
        off = np.linalg.norm(rest - places[:, None] * way, axis=1)
        on_edge = (off < 1e-10 * np.linalg.norm(way)) & (places > -1e-9) & (places < 1 + 1e-9)
        for i in sorted(np.flatnonzero(on_edge), key=lambda i: places[i]):
            assert nearest in sources[i], (u, v)
            nearest = sum(sources[i]) - nearest
        assert nearest == last, (u, v)


def check_ends(mesh, borders):
    """An open line ends where three or more meet, at the boundary, or at an irregular edge."""
    odd = [edge for edge, count in edge_kinds(mesh).items() if count != 2]
    ends = Counter(
        tuple(point)
        for line in borders
        if not line.closed
        for point in line.points[[0, -1]].tolist()
    )
    for point, count in ends.items():
        if count >= 3:
            continue
        assert odd
        assert min(from_segment(np.array(point), *mesh.vertices[list(e)]) for e in odd) < 1e-9, (
            point,
            count,
        )

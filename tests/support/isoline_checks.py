"""Checks of the isolines of any exact field."""

import numpy as np
from scipy.optimize import nnls

import geodesic_core as gc

LEVEL = 1e-9
"""Relative distance of points from their level."""


def weights_in(corners, points):
    """Barycentric weights (N, 3) of points (N, 3) of triangles (N, 3, 3), by least squares."""
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    offsets = points - corners[:, 0]
    inverses = np.linalg.pinv(edges, rcond=3 * np.finfo(float).eps)
    v, w = (inverses @ offsets[:, :, None])[:, :, 0].T
    weights = np.stack([1.0 - v - w, v, w], axis=1)
    # Of a triangle of no area, some that are not negative
    for k in np.flatnonzero(weights.min(axis=1) <= -1e-9):
        size = np.abs(edges[k]).max()
        scaled = np.vstack([edges[k] / size, np.ones(2)])
        system = np.hstack([[[0.0], [0.0], [0.0], [1.0]], scaled])
        weights[k] = nnls(system, [*offsets[k] / size, 1.0])[0]
    return np.clip(weights, 0.0, None)


def line_points(mesh, line):
    """The points of a line as points of the surface, found by their positions.

    Its locations are the same: nowhere else, and neighbours are in the face of their segment.
    """
    faces = line.faces if line.closed else [*line.faces, line.faces[-1]]
    weights = weights_in(mesh.vertices[mesh.faces[faces]], line.points)
    weights[weights < 1e-13] = 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    pairs = zip(np.asarray(faces).tolist(), weights.tolist(), strict=True)
    found = [mesh.point(gc.SurfacePoint.face(face, tuple(each))) for face, each in pairs]
    check_locations(mesh, line)
    return found


def check_locations(mesh, line):
    """Locations give the points, and each segment's face has both of its ends, to the bit.

    Vertices are one where an edge of no length joins them: an edge may have several names.
    """
    positions = [mesh.position(point) for point in line.locations]
    size = np.abs(mesh.vertices - mesh.vertices[0]).max()
    np.testing.assert_allclose(line.points, positions, rtol=0.0, atol=1e-11 * size)
    ends = [*line.locations, *line.locations[: int(line.closed)]]
    vertices = mesh.topology.inner_vertex[mesh.faces]
    for face, *segment in zip(line.faces.tolist(), ends[:-1], ends[1:], strict=True):
        corners = set(vertices[face].tolist())
        for point in segment:
            near = vertices[point.face_index][np.array(point.barycentric) > 0.0]
            assert point.face_index == face or set(near.tolist()) <= corners


def check_points(mesh, sources, level, lines, most=60):
    """Points, evenly taken, lie at the level, as a sweep to them says."""
    points = [point for line in lines for point in line_points(mesh, line)]
    points = points[:: max(len(points) // most, 1)]
    field = gc.exact_distance(mesh, sources, targets=points)
    found = [field.distance_at(point) for point in points]
    np.testing.assert_allclose(found, level, rtol=LEVEL)


def check_pieces(mesh, line):
    """Each piece lies in its face, and has a length, unless it crosses a face without width."""
    points = np.vstack([line.points, line.points[:1]]) if line.closed else line.points
    assert len(line.faces) == len(points) - 1
    corners = mesh.vertices[mesh.faces[line.faces]]
    size = np.abs(corners - corners[:, :1]).max(axis=(1, 2))
    has_length = np.linalg.norm(np.diff(points, axis=0), axis=1) > 0.0
    width = np.linalg.svd(corners - corners[:, :1], compute_uv=False)[:, 1]
    assert (has_length | (width < 1e-15 * size)).all()
    for i in np.flatnonzero(~has_length).tolist():  # from one of its edges to another
        assert line.locations[i] != line.locations[(i + 1) % len(line.points)]
    for ends in (points[:-1], points[1:]):
        weights = weights_in(corners, ends)
        weights /= weights.sum(axis=1, keepdims=True)
        off = np.abs(np.einsum("kc,kcd->kd", weights, corners) - ends).max(axis=1)
        outside = np.flatnonzero(~(off < 1e-9 * size)).tolist()
        assert not outside, f"pieces {outside} leave their faces"


def edge_kinds(mesh):
    """How many faces each edge has."""
    count = {}
    for a, b, c in mesh.faces.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            key = (min(edge), max(edge))
            count[key] = count.get(key, 0) + 1
    return count


def check_ends(mesh, line):
    """A line that is not closed ends at the boundary, or at an edge of several faces."""
    if line.closed:
        return
    odd = [edge for edge, count in edge_kinds(mesh).items() if count != 2]
    for point in (line.points[0], line.points[-1]):
        assert min(from_segment(point, *mesh.vertices[list(edge)]) for edge in odd) < 1e-9


def from_segment(point, start, end):
    t = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    return np.linalg.norm(start + t * (end - start) - point)


def crossings(line):
    """The points of a line between two faces, and its ends: an arc may also touch an edge."""
    if line.closed:
        return line.points[line.faces != np.roll(line.faces, 1)]
    return line.points[np.r_[True, line.faces[1:] != line.faces[:-1], True]]


def check_crossings(mesh, sources, levels, lines_of_each, samples=40):
    """On each edge the lines have as many points as its distances pass their level, sampled.

    A stretch between two samples may go unseen: there are lines at its two ends then. A vertex that
    is at the level itself may have a line through it, whose point is then on all of its edges.
    """
    edges = sorted(edge_kinds(mesh))
    shares = (np.arange(samples) + 0.5) / samples
    targets = [mesh.point_on_edge(u, v, float(t)) for u, v in edges for t in shares]
    field = gc.exact_distance(mesh, sources, targets=targets)
    found = np.array([field.distance_at(point) for point in targets]).reshape(len(edges), samples)
    along = np.hstack([field.distances[edges][:, :1], found, field.distances[edges][:, 1:]])
    for level, lines in zip(levels, lines_of_each, strict=True):
        _check_crossings(mesh, edges, field, along, level, lines)


def _check_crossings(mesh, edges, field, along, level, lines):
    """Check one level by the distances (E, S + 2) along the edges."""
    inside, samples = along <= level, along.shape[1] - 2
    is_at_level = np.isclose(field.distances, level, rtol=LEVEL, atol=0.0)
    # The point of a crossing is the same to the bit in all lines through it.
    points = np.array(
        sorted({tuple(point) for line in lines for point in crossings(line).tolist()})
    )
    for (u, v), row in zip(edges, inside, strict=True):
        passed = set(np.flatnonzero(row[1:] != row[:-1]).tolist())
        start, way = mesh.vertices[u], mesh.vertices[v] - mesh.vertices[u]
        rest = (points if len(points) else np.empty((0, 3))) - start
        places = rest @ way / (way @ way)
        off = np.linalg.norm(rest - places[:, None] * way, axis=1)
        on_edge = (off < 1e-10 * np.linalg.norm(way)) & (places > -1e-10) & (places < 1 + 1e-10)
        gaps = np.clip(np.floor(places[on_edge] * samples + 0.5), 0, samples).astype(int).tolist()
        for gap in range(int(is_at_level[u]), samples + 1 - int(is_at_level[v])):
            assert gaps.count(gap) % 2 == (gap in passed), (u, v, gap)


def some_levels(field, seed, count):
    finite = field.distances[np.isfinite(field.distances)]
    return (np.random.default_rng(seed).uniform(0.05, 1.1, count) * finite.max()).tolist()


def check_found_again(mesh, sources, seed):
    """Kept or found again by a second sweep, the windows where levels pass are the same."""
    field = gc.exact_distance(mesh, sources)
    finite = np.sort(field.distances[np.isfinite(field.distances) & (field.distances > 0.0)])
    levels = [*some_levels(field, seed, 4), *finite[:: len(finite) // 3 + 1].tolist()]
    for limit in (None, float(finite[len(finite) // 2])):
        kept, found = (
            gc.exact_distance(mesh, sources, limit, retain=retain)
            for retain in ("windows", "distances")
        )
        drawn = zip(levels, kept.isolines(levels), found.isolines(levels), strict=True)
        for level, expected, lines in drawn:
            check_same(lines, expected)
            check_same(found.isolines([level])[0], expected)


def check_same(lines, expected):
    """To the bit."""
    assert len(lines) == len(expected)
    for line, other in zip(lines, expected, strict=True):
        assert line.closed == other.closed
        np.testing.assert_array_equal(line.points, other.points)
        np.testing.assert_array_equal(line.faces, other.faces)


def distances_from(line, points):
    """Return how far points are from the chords of a line."""
    starts = line.points if line.closed else line.points[:-1]
    ways = (np.roll(line.points, -1, axis=0) if line.closed else line.points[1:]) - starts
    offsets = points.T[:, :, None] - starts.T[:, None]  # (3, N, chords): summed faster so
    shares = np.einsum("dnc,dc->nc", offsets, ways.T) / (ways**2).sum(axis=1)
    offsets -= np.clip(shares, 0.0, 1.0) * ways.T[:, None]
    return np.sqrt(np.einsum("dnc,dnc->nc", offsets, offsets).min(axis=1))

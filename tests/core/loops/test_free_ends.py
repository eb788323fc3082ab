"""Curves pulled tight whose ends slide along the boundary."""

import numpy as np
import pytest
import shapely

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, NoLoop
from tests.core.loops.test_straighten import TIGHT
from tests.support import zoo
from tests.support.meshes import mesh_of
from tests.support.straightness import worst_bend


def waisted(random, columns=9, rows=5):
    """A strip in the plane with a waist, and both rims; columns of vertices, from below."""
    x = np.linspace(0.0, 4.0, columns)
    waist = x[random.integers(2, columns - 2)]
    top = 1.0 + random.uniform(0.1, 0.5, 2)[(x > waist).astype(int)] * np.abs(x - waist)
    bottom = random.uniform(-0.09, 0.09) * x
    share = np.linspace(0.0, 1.0, rows)[None, :]
    y = (1 - share) * bottom[:, None] + share * top[:, None]
    vertices = np.stack([np.repeat(x, rows), y.ravel(), np.zeros(y.size)], axis=1)
    n = np.arange(y.size).reshape(columns, rows)
    low, right, up, far = (
        part.ravel() for part in (n[:-1, :-1], n[1:, :-1], n[:-1, 1:], n[1:, 1:])
    )
    faces = np.concatenate([np.stack([low, right, far], 1), np.stack([low, far, up], 1)])
    rims = [shapely.LineString(np.stack([x, rim], 1)) for rim in (bottom, top)]
    return gc.TriangleMesh(vertices, faces), n, rims


@pytest.mark.parametrize("seed", range(20))
def test_a_curve_across_a_strip_moves_to_its_waist(seed):
    random = np.random.default_rng(seed)
    mesh, columns, rims = waisted(random)
    start, end = (int(columns[random.integers(2, len(columns) - 2), k]) for k in (0, -1))
    tight = gc.straighten(gc.shortest_path(mesh, start, end), free_ends=True)
    assert tight.length == pytest.approx(rims[0].distance(rims[1]), rel=1e-12)
    for rim, point in zip(rims, (tight.points[0], tight.points[-1]), strict=True):
        assert rim.distance(shapely.Point(point[:2])) < 1e-12


@pytest.mark.jit
def test_the_shortest_of_all_is_the_least_distance_of_two_boundaries():
    mesh = gc.samples.obstacles(3000)
    outer, hole = mesh.boundaries()[:2]
    field = gc.exact_distance(mesh, outer)
    step = hole.length / 2000
    along = hole.resample(step)
    least = min(field.distance_at(mesh.locate(point)) for point in along.points)
    random, found = np.random.default_rng(1), []
    for _ in range(12):
        ends = (curve.locations[random.integers(len(curve.locations))] for curve in (outer, hole))
        path = gc.shortest_path(mesh, *ends)
        tight = gc.straighten(path, free_ends=True)
        assert tight.length <= path.length
        assert worst_bend(tight) < TIGHT
        found.append(tight.length)
    nearest = field.path_to(min(hole.locations, key=field.distance_at))
    found.append(gc.straighten(nearest, free_ends=True).length)
    assert least - step <= min(found) <= least * (1 + 1e-12)


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_no_place_beside_the_ends_is_nearer(case):
    mesh = mesh_of(case)
    rims = mesh.boundaries()
    if not rims:
        return
    random = np.random.default_rng(3)
    for _ in range(4):
        rim = rims[random.integers(len(rims))]
        i = int(random.integers(len(rim.locations)))
        inside = int(random.integers(len(mesh.vertices)))
        try:
            path = gc.shortest_path(mesh, inside, rim.locations[i])
            tight = gc.straighten(path, free_ends=True)
        except (gc.errors.NoPath, NoLoop, InvalidArgument):
            continue
        assert tight.length <= path.length * (1 + 1e-12)
        for point in beside(mesh, tight.locations[-1]):
            moved = gc.straighten(mesh.curve([*tight.locations, point]))
            assert moved.length >= tight.length * (1 - 1e-9)


def beside(mesh, point, step=1e-3):
    """Points of the boundary near one of its points, which share a face with it."""
    rims = [pair for rim in mesh.boundaries() for pair in pairs(rim)]
    if point.vertex_index is not None:
        near = [pair for pair in rims if point.vertex_index in pair]
        return [
            mesh.point_on_edge(
                point.vertex_index, *(v for v in pair if v != point.vertex_index), step
            )
            for pair in near
        ]
    corners = mesh.faces[point.face_index]
    edge = [int(v) for v, w in zip(corners, point.barycentric, strict=True) if w > 0.0]
    place = point.barycentric[corners.tolist().index(edge[1])]
    return [
        mesh.point_on_edge(*edge, place + move)
        for move in (-step, step)
        if 0.0 < place + move < 1.0
    ]


def pairs(rim):
    ends = rim.located.vertices.tolist()
    return [(u, v) for u, v in zip(ends, [*ends[1:], ends[0]], strict=True) if u >= 0 and v >= 0]


def test_what_has_no_free_end_is_refused():
    mesh = gc.samples.plane(200)
    with pytest.raises(InvalidArgument, match="none is on the boundary"):
        gc.straighten(gc.shortest_path(mesh, 12, 96), free_ends=True)
    torus = gc.samples.knot(500)
    with pytest.raises(InvalidArgument, match="it is closed"):
        gc.straighten(gc.shortest_loop(torus, 0), free_ends=True)
    with pytest.raises(NoLoop, match="shrinks to a point"):
        gc.straighten(gc.shortest_path(mesh, 3, 33), free_ends=True)


def test_an_end_inside_stays():
    mesh = gc.samples.plane(200)
    path = gc.shortest_path(mesh, 5, 60)
    tight = gc.straighten(path, free_ends=True)
    assert tight.locations[-1] == path.locations[-1]
    assert tight.length == pytest.approx(mesh.vertices[60, 1], rel=1e-12)

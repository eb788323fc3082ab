"""Checks of a path on any mesh, by the path itself."""

from functools import lru_cache

import numpy as np
import pytest

import geodesic_core as gc

LENGTH = 1e-10
"""Relative difference allowed between a path's length and the distance it stands for."""


def check_path(mesh: gc.TriangleMesh, path: gc.GeodesicPath, source, target, distance):
    """A path from source to target, over the surface, of the given length."""
    points, locations, faces = path.points, path.locations, path.faces
    assert points.shape == (len(locations), 3)
    assert len(faces) == len(locations) - 1
    assert (locations[0], locations[-1]) == (mesh.point(source), mesh.point(target))
    assert tuple(points[0]) == tuple(mesh.position(source))
    assert tuple(points[-1]) == tuple(mesh.position(target))
    assert path.length == pytest.approx(distance, rel=LENGTH, abs=0)
    pieces = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert pieces.sum() == pytest.approx(path.length, rel=LENGTH, abs=0)
    carriers = [_check_location(mesh, *pair) for pair in zip(points, locations, strict=True)]
    assert not set(faces.tolist()) & set(mesh.barriers.tolist()), "no piece crosses a blocked face"
    for face, start, end in zip(faces, carriers, carriers[1:], strict=False):
        # Both ends lie on the closed face: the piece between them does, a face is convex.
        assert start | end <= set(mesh.faces[face].tolist())


def _check_location(mesh, point, location) -> set[int]:
    """Check one surface point; return the vertices of the vertex, edge or face that carries it."""
    weights = np.array(location.barycentric)
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=1e-15)
    corners = mesh.faces[location.face_index]
    scale = np.abs(mesh.vertices[corners]).max()
    np.testing.assert_allclose(weights @ mesh.vertices[corners], point, rtol=0, atol=1e-14 * scale)
    carrier = corners[weights > 0].tolist()
    holders = {location.face_index}
    if len(carrier) < 3:  # two faces may have the same corners, but no point inside in common
        holders = set.intersection(*(_faces_at(mesh)[vertex] for vertex in carrier))
    assert location.face_index == min(holders), "the lowest face that holds the point"
    return set(carrier)


@lru_cache(maxsize=1)
def _faces_at(mesh) -> list[set[int]]:
    """The faces of each vertex, those that are free."""
    faces_at: list[set[int]] = [set() for _ in mesh.vertices]
    blocked = set(mesh.barriers.tolist())
    for number, face in enumerate(mesh.faces.tolist()):
        for vertex in face if number not in blocked else ():
            faces_at[vertex].add(number)
    return faces_at

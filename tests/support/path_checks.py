"""Checks of a path on any mesh, by the path itself."""

from functools import lru_cache

import numpy as np
import pytest

import geodesic_core as gc

LENGTH = 1e-10
"""Relative difference allowed between a path's length and the distance it stands for."""

NONE = -1
"""In place of a vertex or a face."""


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
    assert not set(faces.tolist()) & set(mesh.barriers.tolist()), "no piece crosses a blocked face"
    carriers = _check_locations(mesh, points, locations)
    # Both ends lie on the closed face: the piece between them does, a face is convex.
    corners = np.hstack([mesh.faces[faces], np.full((len(faces), 1), NONE)])
    for end in (carriers[:-1], carriers[1:]):
        is_corner = (end[:, :, None] == corners[:, None]).any(axis=2)
        wrong = np.flatnonzero(~is_corner.all(axis=1)).tolist()
        assert not wrong, f"pieces {wrong} leave their faces"


def _check_locations(mesh, points, locations) -> np.ndarray:
    """Check surface points; return the vertices (K, 3) of what carries each: vertex, edge or face.

    Those of a vertex or an edge are filled up with `NONE`.
    """
    faces = np.array([location.face_index for location in locations])
    weights = np.array([location.barycentric for location in locations])
    corners = mesh.faces[faces]
    places = mesh.vertices[corners]
    scale = np.abs(places).max(axis=(1, 2))
    away = np.abs(np.einsum("kc,kcd->kd", weights, places) - points).max(axis=1)
    carriers = np.where(weights > 0, corners, NONE)

    def claim(what, holds):
        wrong = [locations[k] for k in np.flatnonzero(~holds)]
        assert not wrong, f"{what}: not so of {wrong}"

    claim("weights are not negative", (weights >= 0).all(axis=1))
    claim("the sum of weights is 1", np.abs(weights.sum(axis=1) - 1) <= 1e-15)
    claim("weights give the point", away <= 1e-14 * scale)
    pairs = zip(faces.tolist(), carriers.tolist(), strict=True)
    lowest = np.array([_lowest_face(mesh, *pair) for pair in pairs])
    claim("the face is the lowest that holds the point", faces == lowest)
    return carriers


def _lowest_face(mesh, face, carrier) -> int:
    """Of the faces that hold a point on the given one."""
    vertices = [vertex for vertex in carrier if vertex != NONE]
    if len(vertices) == 3:  # two faces may have the same corners, but no point inside in common
        return face
    return min(set.intersection(*(_faces_at(mesh)[vertex] for vertex in vertices)), default=NONE)


@lru_cache(maxsize=1)
def _faces_at(mesh) -> list[set[int]]:
    """The faces of each vertex, those that are free."""
    faces_at: list[set[int]] = [set() for _ in mesh.vertices]
    blocked = set(mesh.barriers.tolist())
    for number, face in enumerate(mesh.faces.tolist()):
        for vertex in face if number not in blocked else ():
            faces_at[vertex].add(number)
    return faces_at

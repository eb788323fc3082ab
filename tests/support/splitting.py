"""The same surface with a vertex at a point: faces are split, distances stay."""

import numpy as np

import geodesic_core as gc

ON = 1e-9
"""Barycentric weight up to which a point counts as on an edge of a piece."""


def split_at(mesh: gc.TriangleMesh, points: list[gc.SurfacePoint]):
    """Return vertices, faces, and the vertex at each point."""
    vertices, added = mesh.vertices.tolist(), []
    pieces = [(tuple(face), origin) for origin, face in enumerate(mesh.faces.tolist())]
    for point in points:
        if point.vertex_index is not None:
            added.append(point.vertex_index)
            continue
        place = mesh.position(point)
        origins = _faces_of(mesh, point)
        near = [piece for piece in pieces if piece[1] in origins]
        weights = [_weights(np.array([vertices[v] for v in face]), place) for face, _ in near]
        held = [(p, w) for p, w in zip(near, weights, strict=True) if w.min() >= -ON]
        at = {face[int(w.argmax())] for (face, _), w in held if w.max() >= 1 - ON}
        if at:  # where an earlier point is
            added.append(at.pop())
            continue
        new = len(vertices)
        vertices.append(place.tolist())
        added.append(new)
        for (face, origin), w in held:
            pieces.remove((face, origin))
            pieces += [
                ((face[i], face[(i + 1) % 3], new), origin)
                for i in range(3)
                if w[(i + 2) % 3] > ON  # else the point is on this side
            ]
    return np.array(vertices), np.array([face for face, _ in pieces]), added


def _faces_of(mesh: gc.TriangleMesh, point: gc.SurfacePoint) -> set[int]:
    corners = mesh.faces[point.face_index]
    carrier = corners[np.array(point.barycentric) > 0]
    holds = np.isin(mesh.faces, carrier).sum(axis=1) == len(carrier)
    return set(np.flatnonzero(holds).tolist())


def _weights(corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    edges = (corners[1:] - corners[0]).T
    (v, w), *_ = np.linalg.lstsq(edges, place - corners[0], rcond=None)
    return np.array([1 - v - w, v, w])

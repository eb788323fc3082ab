"""A mesh cut along lines, step by step."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control
from geodesic_core.cutting.cut_mesh import CutMesh
from geodesic_core.cutting.lines import Line
from geodesic_core.cutting.locations import Locations, positions_of, weights_in
from geodesic_core.cutting.retriangulation import Children, retriangulated
from geodesic_core.cutting.separation import edges_of, halved, keys_of, separated
from geodesic_core.cutting.shapes import shapes_of, sides_of
from geodesic_core.cutting.whole_numbers import (
    Surroundings,
    points_of,
    segments_of,
    snapped_of,
    surroundings_of,
)
from geodesic_core.kernels.cutting.predicates import STEPS
from geodesic_core.mesh.triangle_mesh import TriangleMesh


class Joined(NamedTuple):
    """A mesh cut along curves, whole as yet."""

    faces: Longs
    """(F', 3)"""
    face_of: Longs
    """(F',) ascending"""
    locations: Locations
    """Of new vertices"""
    curve_edges: Longs
    """(E, 2)"""
    edge_curves: Longs
    """(P, 2)"""


def cut_along(
    mesh: TriangleMesh, lines: Sequence[Line], control: Control, *, separate: bool
) -> CutMesh:
    """Return the mesh cut along lines, one or more."""
    control.check_memory(2 * (mesh.vertices.nbytes + 2 * mesh.faces.nbytes))
    around = surroundings_of(mesh, lines)
    points, edge_points = points_of(mesh, around, lines)
    shapes = shapes_of(sides_of(mesh, around.faces)) / STEPS
    segments = segments_of(around, lines)
    children = retriangulated(
        around, points, segments, edge_points, shapes, len(mesh.vertices), control
    )
    joined = _joined(mesh, around, children)
    faces, copied = joined.faces, np.empty(0, np.int64)
    if separate:
        joined, faces, copied = _apart(mesh, joined)
    placed = positions_of(mesh.vertices, mesh.faces, joined.locations)
    vertices = np.concatenate([mesh.vertices, placed])
    copy_of = np.append(np.arange(len(vertices)), copied)
    control.checkpoint(1.0)
    return CutMesh(
        old=mesh,
        vertices=vertices[copy_of],
        faces=faces.astype(np.int32),
        face_of=joined.face_of,
        curve_edges=joined.curve_edges,
        edge_curves=joined.edge_curves,
        copy_of=copy_of,
        snapped=snapped_of(lines),
        _locations=joined.locations,
    )


def _joined(mesh: TriangleMesh, around: Surroundings, children: Children) -> Joined:
    """Return the mesh with the triangles of faces in the place of these."""
    first = len(mesh.vertices)
    is_used = children.made[:, 0] >= 0
    numbers = first + len(children.edge_points.edges) + np.cumsum(is_used) - 1

    def numbered(names: Longs) -> Longs:
        number = names.copy()
        number[names < 0] = numbers[-1 - names[names < 0]]
        return number

    counts = np.ones(len(mesh.faces), np.int64)
    rows, sizes = np.unique(children.triangles[:, 0], return_counts=True)
    counts[around.faces[rows]] = sizes
    face_of = np.repeat(np.arange(len(mesh.faces)), counts)
    is_cut = np.zeros(len(mesh.faces), bool)
    is_cut[around.faces[rows]] = True
    faces = mesh.faces[face_of].astype(np.int64)
    faces[is_cut[face_of]] = numbered(children.triangles[:, 1:])
    ends, curves = numbered(children.curve_edges[:, 1:3]), children.curve_edges[:, 3]
    locations = _locations_of(mesh, around, children, is_used)
    return Joined(faces, face_of, locations, *_owned(ends, curves))


def _owned(ends: Longs, curves: Longs) -> tuple[Longs, Longs]:
    """Return edges (E, 2), and (P, 2) pairs of an edge and a curve, from edges of curves."""
    keys = keys_of(ends)
    order = np.lexsort((curves, keys))
    keys, curves = keys[order], curves[order]
    is_new = np.ones(len(keys), bool)
    is_new[1:] = (keys[1:] != keys[:-1]) | (curves[1:] != curves[:-1])
    each, edge = np.unique(keys[is_new], return_inverse=True)
    return edges_of(each), np.stack([edge, curves[is_new]], axis=1)


def _locations_of(
    mesh: TriangleMesh, around: Surroundings, children: Children, is_used: NDArray[np.bool_]
) -> Locations:
    """Return where points on edges are, in the lowest face of the surface, and points in faces."""
    edges, steps = children.edge_points
    surface = np.flatnonzero(mesh.inner_face[around.faces] >= 0)[::-1]
    row_of = np.empty(len(around.ends), np.int64)
    row_of[around.edges[surface].reshape(-1)] = np.repeat(surface, 3)
    rows = row_of[edges]
    corners, (low, high) = around.corners[rows], around.ends[edges].T
    on_edge = np.where(corners == low[:, None], (STEPS - steps)[:, None], 0)
    on_edge += np.where(corners == high[:, None], steps[:, None], 0)
    row, x, y = children.made[is_used].T
    inside = np.stack([STEPS - x - y, x, y], axis=1)
    return Locations(
        len(mesh.vertices),
        around.faces[np.append(rows, row)],
        np.concatenate([on_edge, inside]) / STEPS,
    )


def _apart(mesh: TriangleMesh, joined: Joined) -> tuple[Joined, Longs, Longs]:
    """Return a cut mesh, its faces taken apart along curves, and the vertices that were copied.

    An edge of a curve opens only where one of its ends is doubled. So one where neither is, such as
    a curve of one edge, gets a vertex in its middle.
    """
    count = len(mesh.vertices) + len(joined.locations.faces)
    apart = separated(joined.faces, count, joined.curve_edges)
    if len(apart.shut):
        joined = _with_middles(mesh, joined, apart.shut)
        count += len(apart.shut)
        apart = separated(joined.faces, count, joined.curve_edges)
    return joined, apart.faces, apart.copied


def _with_middles(mesh: TriangleMesh, joined: Joined, edges: Longs) -> Joined:
    """Return a cut mesh with a vertex in the middle of some edges of curves, lower end first."""
    first = len(mesh.vertices) + len(joined.locations.faces)
    faces, face_of = halved(joined.faces, joined.face_of, edges, first)
    middles, old_face = first + np.arange(len(edges)), np.empty(len(edges), np.int64)
    rows, columns = np.nonzero(faces >= first)
    old_face[faces[rows, columns] - first] = face_of[rows]
    ends = [weights_in(joined.locations, mesh.faces, end, old_face) for end in edges.T]
    locations = joined.locations.joined(old_face, _middle_of(*ends))
    owned = joined.curve_edges[joined.edge_curves[:, 0]]
    place = np.searchsorted(keys_of(edges), keys_of(owned)).clip(max=len(edges) - 1)
    is_halved = keys_of(edges)[place] == keys_of(owned)
    curves, middle = joined.edge_curves[:, 1], middles[place[is_halved]]
    halves = [np.stack([end, middle], axis=1) for end in owned[is_halved].T]
    pieces = np.concatenate([owned[~is_halved], *halves])
    of_pieces = np.concatenate([curves[~is_halved], curves[is_halved], curves[is_halved]])
    return Joined(faces, face_of, locations, *_owned(pieces, of_pieces))


def _middle_of(start: Floats, end: Floats) -> Floats:
    """Return weights half-way; on an edge of the old mesh in whole steps, as its points are."""
    middle = 0.5 * (start + end)
    largest, each = middle.argmax(axis=1), np.arange(len(middle))
    whole: Floats = np.floor(middle * STEPS) / STEPS
    whole[each, largest] += 1.0 - whole.sum(axis=1)
    inside = np.flatnonzero(middle.min(axis=1) > 0.0)
    whole[inside] = middle[inside]
    return whole

"""Whether a curve is as short as those near it, from positions of vertices and faces alone."""

import math
from collections import defaultdict

import numpy as np


def worst_bend(curve):
    """Return by how much the curve could be straighter, at most: radians, 0 where it is tight.

    At a point of an edge the segments on both sides are to make equal angles with it. At a vertex
    the angle on each side is to be π or more, unless the surface ends on that side. The ends of an
    open curve are not looked at.
    """
    mesh, points, faces = curve.mesh, curve.points, curve.faces
    corners = fans(mesh)
    count, worst = len(points), 0.0
    for i in range(count) if curve.closed else range(1, count - 1):
        before, after = points[i - 1], points[(i + 1) % count]
        f, g = faces[i - 1], faces[i]
        v = int(curve.located.vertices[i])
        if v >= 0:
            sides = angles_at(mesh, corners, v, f, before, g, after)
            worst = max([worst, *(math.pi - side for side in sides)])
        elif f != g:
            (a, b) = sorted(set(mesh.faces[f].tolist()) & set(mesh.faces[g].tolist()))
            along = mesh.vertices[b] - mesh.vertices[a]
            bend = angle(along, points[i] - before) - angle(along, after - points[i])
            worst = max(worst, abs(bend))
        else:
            worst = max(worst, angle(points[i] - before, after - points[i]))
    return worst


def angle(a, b):
    return math.atan2(np.linalg.norm(np.cross(a, b)), float(np.dot(a, b)))


def fans(mesh):
    """Return by vertex and its neighbours the face between an edge and the next one, one way."""
    fan = defaultdict(list)
    for f, face in enumerate(mesh.faces.tolist()):
        if f in set(mesh.barriers.tolist()):
            continue
        for k in range(3):
            fan[face[k]].append((f, face[(k + 1) % 3], face[(k + 2) % 3]))
    return fan


def angles_at(mesh, corners, v, f, before, g, after):
    """Return the angles on the sides of v on which faces lie all the way from f to g."""
    at = mesh.vertices[v]
    sides = []
    for turned in (False, True):
        by_face = {each[0]: (each[2], each[1]) if turned else each[1:] for each in corners[v]}
        by_first = {first: (h, last) for h, (first, last) in by_face.items()}

        def within(first, second):
            return angle(first - at, second - at)

        first, last = (mesh.vertices[u] for u in by_face[f])
        if f == g and within(first, after) >= within(first, before):
            sides.append(within(before, after))
            continue
        total, h, edge = within(before, last), f, by_face[f][1]
        for _ in range(len(by_face) + 1):
            if edge not in by_first:
                total = None
                break
            h, following = by_first[edge]
            if h == g:
                total += within(mesh.vertices[edge], after)
                break
            total += within(mesh.vertices[edge], mesh.vertices[following])
            edge = following
        if total is not None:
            sides.append(total)
    return sides

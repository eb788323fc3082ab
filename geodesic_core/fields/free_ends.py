"""Ends of a strip on the boundary, moved along it to where the string is shortest.

Unfolded, a strip is flat and without holes. So the length of its string is a convex function of
where both ends are on two edges: steps that shorten it lead to the shortest.
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control, rounds
from geodesic_core.kernels.mesh.half_edges import (
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    NO_FACE,
    OPPOSITE,
    SIN_LEFT,
    following,
    previous,
)
from geodesic_core.kernels.paths import funnel
from geodesic_core.kernels.paths.funnel import LEFT, RIGHT, String, Strip
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import MOST_PASSES, SHORTER, TAUT

_FIXED = -1
"""The half-edge of an end that does not move"""
_INSIDE = 2.0**-40
"""Share of an edge that ends keep from its vertices while they move: so all portals stay"""
_HALVINGS = 40
"""Shorter steps that are tried before an end stays"""


class _Way(NamedTuple):
    """A strip, and the boundary edges of its end faces along which its ends may move."""

    strip: Strip
    half_edges: tuple[int, int]
    """In the first and in the last face; _FIXED for none"""


def has_free_end(mesh: TriangleMesh, strip: Strip, end: int) -> bool:
    """Whether an end of a strip, 0 or 1, is on the boundary."""
    ways = _ways(mesh, strip if end == 1 else _reversed(mesh, strip))
    return any(half_edge != _FIXED for _, half_edge in ways)


def slid(mesh: TriangleMesh, strip: Strip, is_free: tuple[bool, bool], control: Control) -> Strip:
    """Return a strip with its ends where its string is shortest along their boundary edges.

    Each end moves at most to the next vertex; from a vertex, either way.
    """
    ways = []
    for free, half_edge in _ways(mesh, strip) if is_free[1] else [(strip, _FIXED)]:
        back = _reversed(mesh, free)
        for both, first in _ways(mesh, back) if is_free[0] else [(back, _FIXED)]:
            ways.append(_Way(_reversed(mesh, both), (first, half_edge)))
    parts = (control.for_part(i, len(ways)) for i in range(len(ways)))
    moved = [_shortest(mesh, way, part) for way, part in zip(ways, parts, strict=True)]
    return min(moved, key=lambda pair: pair[1])[0]


def _ways(mesh: TriangleMesh, strip: Strip) -> Iterator[tuple[Strip, int]]:
    """Yield strips with the same string whose last face has a boundary edge with the end, and it.

    At a vertex the strip goes on around it, either way. Yields the strip as it is, and _FIXED,
    where the end is not on the boundary.
    """
    links, face, weights = mesh.topology.links, int(strip.faces[1]), strip.weights[1]
    corners = np.flatnonzero(weights)
    if len(corners) == 2:
        half_edge = 3 * face + (3 - int(corners.sum()) + 1) % 3
        is_rim = links[half_edge, OPPOSITE] == NO_FACE
        yield strip, half_edge if is_rim else _FIXED
        return
    found = False
    if len(corners) == 1:
        for side in (LEFT, RIGHT):
            h = 3 * face + int(corners[0])
            h = h if side == LEFT else previous(h)
            turned = _to_rim(links, h, side)
            if turned is None:
                continue
            portals, half_edge = turned
            last = half_edge // 3
            corner = half_edge % 3 if side == RIGHT else following(half_edge) % 3
            ends = np.stack([strip.weights[0], np.eye(3)[corner]])
            joined = np.concatenate([strip.portals, portals])
            found = True
            yield Strip(joined, np.array([strip.faces[0], last]), ends), half_edge
    if not found:
        yield strip, _FIXED


def _to_rim(links: Ints, h: int, side: int) -> tuple[Ints, int] | None:
    """Return the portals around the end of h on a side up to the boundary, and its half-edge.

    None where the faces close around it, or meet in an irregular edge.
    """
    portals: list[int] = []
    start = h // 3
    while True:
        across = previous(h) if side == LEFT else following(h)
        h = int(links[across, OPPOSITE])
        if h == NO_FACE:
            return np.array(portals, np.int32), across
        if h < 0 or h // 3 == start:
            return None
        portals.append(h)


def _reversed(mesh: TriangleMesh, strip: Strip) -> Strip:
    portals = mesh.topology.links[strip.portals[::-1], OPPOSITE]
    return Strip(portals, strip.faces[::-1].copy(), strip.weights[::-1].copy())


def _shortest(mesh: TriangleMesh, way: _Way, control: Control) -> tuple[Strip, float]:
    """Return the strip of a way with its ends where its string is shortest, and that length."""
    edges, ends = _unfolded(mesh, way)
    places = np.clip([_place(way, k) for k in (0, 1)], _INSIDE, 1.0 - _INSIDE)
    string = string_of(mesh, _moved(way, places))
    for part in islice(rounds(control), MOST_PASSES):
        part.checkpoint(0.0)
        bends = [
            ends[bend, 0:2] if side == LEFT else ends[bend, 2:4]
            for bend, side in zip(string.bends.tolist(), string.sides.tolist(), strict=True)
        ]
        steps = _nearest(edges, bends) - places
        shorter = None
        for _ in range(_HALVINGS):
            trial = np.clip(places + steps, _INSIDE, 1.0 - _INSIDE)
            found = string_of(mesh, _moved(way, trial))
            if found.length < string.length * (1.0 - SHORTER):
                shorter = trial, found
                break
            steps = 0.5 * steps
        if shorter is None:
            break
        places, string = shorter
    places[places <= _INSIDE], places[places >= 1.0 - _INSIDE] = 0.0, 1.0
    strip = _moved(way, places)
    return strip, string_of(mesh, strip).length


def _place(way: _Way, end: int) -> float:
    """Return the share of its half-edge at which an end is; any where it is fixed."""
    return float(way.strip.weights[end, following(way.half_edges[end]) % 3])


def _moved(way: _Way, places: Floats) -> Strip:
    """Return the strip with its ends at shares of their half-edges."""
    weights = way.strip.weights.copy()
    for end, half_edge in enumerate(way.half_edges):
        if half_edge != _FIXED:
            weights[end] = 0.0
            weights[end, half_edge % 3] = 1.0 - places[end]
            weights[end, following(half_edge) % 3] = places[end]
    return Strip(way.strip.portals, way.strip.faces, weights)


def string_of(mesh: TriangleMesh, strip: Strip) -> String:
    """Return the string of a strip."""
    return funnel.straightened(mesh.topology, strip, TAUT, 0.0, 0)[1]


def _unfolded(mesh: TriangleMesh, way: _Way) -> tuple[Floats, Floats]:
    """Return where ends may be, (2, 2, 2) from and to, and ends of portals, in one plane."""
    portals, faces, weights = way.strip
    if len(portals) == 0:
        length, side = (mesh.topology.geometry[3 * faces[0], k] for k in (LENGTH, LENGTH_LEFT))
        cosine, sine = (mesh.topology.geometry[3 * faces[0], k] for k in (COS_LEFT, SIN_LEFT))
        corners = np.array([[0.0, 0.0], [length, 0.0], [side * cosine, side * sine]])
        of_faces, ends = [corners, corners], np.empty((0, 4))
    else:
        centred = Strip(portals, faces, np.full((2, 3), 1.0 / 3.0))
        ends = string_of(mesh, centred).ends
        of_faces = []
        for portal, row, centre in (
            (mesh.topology.links[portals[0], OPPOSITE], [2, 3, 0, 1], np.zeros(2)),
            (portals[-1], [0, 1, 2, 3], ends[-1, :2]),
        ):
            rim = ends[0 if row[0] else len(portals) - 1][row].reshape(2, 2)
            corners = np.empty((3, 2))
            corners[portal % 3], corners[(portal + 1) % 3] = rim
            corners[(portal + 2) % 3] = 3.0 * centre - rim.sum(axis=0)
            of_faces.append(corners)
    edges = np.empty((2, 2, 2))
    for end, half_edge in enumerate(way.half_edges):
        if half_edge == _FIXED:
            edges[end] = weights[end] @ of_faces[end]
        else:
            edges[end] = of_faces[end][[half_edge % 3, following(half_edge) % 3]]
    return edges, ends


def _nearest(edges: Floats, bends: Sequence[Floats]) -> Floats:
    """Return the places on both edges that are nearest to the bends, or to each other."""
    if bends:
        return np.array([_foot(edges[0], bends[0]), _foot(edges[1], bends[-1])])
    (a, b), (c, d) = edges
    pairs = [(k, _foot(edges[1], edges[0, int(k)])) for k in (0.0, 1.0)]
    pairs += [(_foot(edges[0], edges[1, int(k)]), k) for k in (0.0, 1.0)]
    slope = np.stack([b - a, c - d], axis=1)
    if abs(np.linalg.det(slope)) > 0.0:
        s, t = np.linalg.solve(slope, c - a)
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            pairs.append((s, t))
    apart = [np.linalg.norm((1 - s) * a + s * b - (1 - t) * c - t * d) for s, t in pairs]
    return np.array(pairs[int(np.argmin(apart))], np.float64)


def _foot(edge: Floats, point: Floats) -> float:
    """Return the share of an edge that is nearest to a point."""
    along = edge[1] - edge[0]
    squared = float(along @ along)
    share = float(along @ (point - edge[0])) / squared if squared > 0.0 else 0.0
    return min(max(share, 0.0), 1.0)

"""The shortest paths on both sides of an obstacle.

A line of edges leads from the obstacle to the outside. On the cover of two sheets that are joined
crosswise along this line, a path from a point to another ends in the one sheet or the other: so the
shortest path to each is the shortest of all that cross the line an even, or an odd, number of
times.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.fields.path import EXACT, GeodesicPath
from geodesic_core.fields.sources import component_of, disconnected
from geodesic_core.fields.straighten import portals_along
from geodesic_core.kernels.mesh.half_edges import BOUNDARY, HEAD, LENGTH, NO_FACE, OPPOSITE, TAIL
from geodesic_core.loops.covers import Cover, cover_of, require_two_sided
from geodesic_core.mesh.surface_curve import SurfaceCurve, runs_as_wound
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.path_search import PathSearch


def paths_on_both_sides(
    mesh: TriangleMesh,
    source: SurfacePoint,
    target: SurfacePoint,
    obstacle: Longs,
    control: Control,
) -> tuple[GeodesicPath, GeodesicPath]:
    """Return the shortest paths left and right of an obstacle, given by its inner vertices.

    Raises
    ------
    NoPath
        The points are not connected, or on one side of the obstacle only.
    InvalidMesh
        The surface has no two sides.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    require_two_sided(mesh)
    if component_of(mesh, source) != component_of(mesh, target):
        message = f"{source} and {target} are in different connected components"
        raise disconnected(mesh, message, source, target)
    line = _line_out(mesh, obstacle, [source, target])
    cover = _crossed_over(mesh, line, control)
    search, start = PathSearch(cover.mesh), cover.lifted(source, 0)
    paths = []
    for sheet in (0, 1):
        end = cover.lifted(target, sheet)
        if component_of(cover.mesh, start) != component_of(cover.mesh, end):
            raise NoPath(f"all paths from {source} to {target} pass on one side", "disconnected")
        part = control.holding(cover.mesh.nbytes).for_part(sheet, 2)
        path = cover.lowered(search.find(start, end, part, explain=False))
        paths.append(GeodesicPath(**vars(path), error_bound=EXACT, steps=None))
    first, second = paths
    turns = _turns(first, second, line, int(obstacle[0]))
    is_left = (turns <= 0) == runs_as_wound(mesh, int(line[0]) // 3)
    return (first, second) if is_left else (second, first)


def _turns(first: GeodesicPath, second: GeodesicPath, line: Longs, obstacle: int) -> int:
    """Return how often the way along one path, and back along another, runs around the obstacle.

    Counted counter-clockwise on inner faces. Where one of the paths runs through it, the strip of
    that path passes it on the side of the other path.
    """
    links = first.on_mesh().topology.links
    strip = portals_along(first, second.reversed(), closed=True)
    back = links[strip, OPPOSITE]
    turns = int(np.isin(strip, line).sum()) - int(np.isin(back, line).sum())
    for path, sign in ((first, -1), (second, 1)):
        if turns == 0 and path.on_mesh().topology.outer_vertex[obstacle] in path.located.vertices:
            portals = portals_along(path, closed=False)
            has_it_left = (links[portals, TAIL] == obstacle).any()
            turns = sign if has_it_left else -sign
    return turns


def obstacle_of(
    mesh: TriangleMesh, wide: TriangleMesh, obstacle: SurfaceCurve | SurfacePoint | None
) -> Longs:
    """Return the inner vertices of an obstacle: a hole, a vertex, or None for what ``mesh`` lacks.

    ``wide`` is the mesh without the barriers of the call.

    Raises
    ------
    InvalidArgument
        It is nothing of these.
    """
    topology = mesh.topology
    if obstacle is None:
        walls = np.setdiff1d(mesh.barriers, wide.barriers)
        corners = np.unique(mesh.faces[walls])
        rim = (topology.flags & BOUNDARY) != 0
        inner = np.unique(topology.inner_vertex[corners])
        found: Longs = inner[rim[inner]]
        if len(found) == 0:
            raise InvalidArgument("the barrier leaves no face beside it: there is nothing to pass")
        return found
    if isinstance(obstacle, SurfacePoint):
        if obstacle.vertex_index is None:
            raise InvalidArgument(
                f"the obstacle is {obstacle}; it must be a vertex. gc.cut makes one of a point"
            )
        return np.array([topology.inner_vertex[obstacle.vertex_index]], np.int64)
    vertices = obstacle.located.vertices
    if not obstacle.closed or (vertices < 0).any():
        raise InvalidArgument("the obstacle is a curve that is none of mesh.boundaries()")
    rim = topology.inner_vertex[vertices].astype(np.int64)
    if not (topology.flags[rim] & BOUNDARY).all():
        raise InvalidArgument("the obstacle is a curve that is none of mesh.boundaries()")
    return rim


def _line_out(mesh: TriangleMesh, obstacle: Longs, ends: Sequence[SurfacePoint]) -> Longs:
    """Return half-edges of the shortest line of edges from an obstacle to the outside.

    It leads to the longest other boundary; without one, to the vertex farthest from all three. If
    it can, it stays off the faces of the ends of the paths.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components, dijkstra

    topology = mesh.topology
    links, lengths = topology.links, topology.geometry[:, LENGTH].copy()
    size = len(topology.total_angle)
    corners = topology.inner_vertex[mesh.faces[[end.face_index for end in ends]]].reshape(-1)

    def graph_of(half_edges: Longs, weights: Floats) -> Any:
        ends = links[half_edges, TAIL], links[half_edges, HEAD]
        graph = coo_array((weights[half_edges], ends), shape=(size, size)).tocsr()
        return graph.maximum(graph.T)

    everything = np.arange(len(links))
    rim = np.flatnonzero(links[:, OPPOSITE] == NO_FACE)
    _, hole = connected_components(graph_of(rim, lengths), directed=False)
    around = np.bincount(hole[links[rim, TAIL]], lengths[rim], minlength=hole.max() + 1)
    around[hole[obstacle]] = 0.0
    part = topology.component[topology.outer_vertex]
    around[hole[part != part[obstacle[0]]]] = 0.0
    if around.max() > 0.0:
        goals = np.flatnonzero(hole == around.argmax())
    else:
        away = dijkstra(
            graph_of(everything, lengths), indices=np.append(obstacle, corners), min_only=True
        )
        goals = np.array([np.where(np.isfinite(away), away, -1.0).argmax()])
    is_beside = np.isin(links[:, TAIL], corners) | np.isin(links[:, HEAD], corners)
    lengths[is_beside] += lengths.sum()
    away, before, _ = dijkstra(
        graph_of(everything, lengths), indices=obstacle, min_only=True, return_predecessors=True
    )
    line = [int(goals[away[goals].argmin()])]
    while before[line[-1]] >= 0:
        line.append(int(before[line[-1]]))
    return _half_edges_between(links, np.array(line[::-1]))


def _half_edges_between(links: Ints, vertices: Longs) -> Longs:
    """Return the half-edges from each of some vertices to the next, or back where it has none."""
    found = []
    for tail, head in zip(vertices[:-1].tolist(), vertices[1:].tolist(), strict=True):
        along = np.flatnonzero((links[:, TAIL] == tail) & (links[:, HEAD] == head))
        back = np.flatnonzero((links[:, TAIL] == head) & (links[:, HEAD] == tail))
        found.append(along[0] if len(along) else back[0])
    return np.array(found, np.int64)


def _crossed_over(mesh: TriangleMesh, line: Longs, control: Control) -> Cover:
    """Return the cover of two sheets that are joined crosswise along half-edges."""
    links = mesh.topology.links
    other = np.zeros(len(links), bool)
    other[line] = True
    opposite = links[line, OPPOSITE]
    other[opposite[opposite >= 0]] = True
    across = np.stack([other, ~other]).astype(np.int64)
    return cover_of(mesh, across, np.ones(len(links) // 3, bool), control)

"""Loops around and through the handles of a surface, pulled tight.

Holes are closed by a face each, which changes no handle. A tree and a cotree (Eppstein 2003) leave
two edges for each handle over. Each of them closes a loop through the faces of the dual tree, which
leads along shortest paths from a vertex: the shortest loops through that vertex that generate the
homology (Erickson and Whittlesey, *Greedy Optimal Homotopy and Homology Generators*, 2005, there
along edges). Pulling them tight does not change their kinds.
"""

import numpy as np

from geodesic_core.arrays import Ints, Longs
from geodesic_core.control import Control, rounds
from geodesic_core.fields.distance_field import solve
from geodesic_core.fields.question import Question
from geodesic_core.fields.straighten import loop_of
from geodesic_core.fields.sweeps import ExactSweep
from geodesic_core.kernels.mesh.half_edges import HEAD, NO_FACE, OPPOSITE, TAIL
from geodesic_core.loops.covers import require_two_sided
from geodesic_core.loops.cut_graph import half_edges_up, spanning
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import SHORTER


def handle_loops_of(mesh: TriangleMesh, control: Control) -> list[SurfaceCurve]:
    """Return two loops for each handle, shortest first.

    Raises
    ------
    InvalidMesh
        The surface has no two sides.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    require_two_sided(mesh)
    topology = mesh.topology
    on_faces = np.unique(topology.outer_vertex[topology.links[:, TAIL]])
    parts, first = np.unique(topology.component[on_faces], return_index=True)
    roots = on_faces[first].astype(np.int64)
    each_round = rounds(control)
    best = _loops_through(mesh, roots, next(each_round)) if len(roots) else []
    while best:
        # A loop that is tight has sunk to where its handle is thin: from there others are shorter
        vertices = best[-1].located.vertices
        root = vertices[vertices >= 0][0]
        roots[parts == topology.component[root]] = root
        loops = _loops_through(mesh, roots, next(each_round))
        if _total(loops) >= _total(best) * (1.0 - SHORTER):
            break
        best = loops
    return best


def _total(loops: list[SurfaceCurve]) -> float:
    return sum(loop.length for loop in loops)


def _loops_through(mesh: TriangleMesh, roots: Longs, control: Control) -> list[SurfaceCurve]:
    """Return the loops of the handles, once shortest through roots, one in each component."""
    links = mesh.topology.links
    opposite = links[:, OPPOSITE].astype(np.int64)
    inner = np.flatnonzero(opposite > np.arange(len(links)))
    rim = np.flatnonzero(opposite == NO_FACE)
    question = Question.of(mesh, roots.tolist(), [], np.inf, control)
    field = solve(ExactSweep(question), "distances", control.for_part(0, 2))
    distances = field.distances[mesh.topology.outer_vertex]
    edges = np.concatenate([inner, rim])
    far = distances[links[edges, TAIL]] + distances[links[edges, HEAD]]
    is_rim = np.arange(len(edges)) >= len(inner)
    # Faces that close holes are leaves of the dual tree: no loop leads through them
    beyond = np.concatenate([opposite[inner] // 3, len(links) // 3 + _holes(links, rim)])
    in_disc = spanning(edges // 3, beyond, np.lexsort((far, is_rim)))
    rest = np.flatnonzero(~in_disc)
    edges_left, order = edges[rest], np.lexsort((-far[rest], ~is_rim[rest]))
    in_tree = spanning(links[edges_left, TAIL], links[edges_left, HEAD], order)
    tree = inner[in_disc[: len(inner)]]
    tree = np.concatenate([tree, opposite[tree]])
    parts = mesh.topology.component[mesh.topology.outer_vertex[links[::3, TAIL]]]
    first_faces = np.unique(parts, return_index=True)[1].tolist()
    up = half_edges_up(tree, tree // 3, opposite[tree] // 3, first_faces)
    crossed = edges_left[~in_tree].tolist()
    loops = [
        loop_of(mesh, _cycle(links, up, h), control.for_part(len(crossed) + i, 2 * len(crossed)))
        for i, h in enumerate(crossed)
    ]
    return sorted(loops, key=lambda loop: loop.length)


def _holes(links: Ints, rim: Longs) -> Longs:
    """Return the hole at which each half-edge of the boundary is, by number."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    tails, heads = links[rim, TAIL], links[rim, HEAD]
    size = int(links[:, [TAIL, HEAD]].max()) + 1
    graph = coo_array((np.ones(len(rim), np.int8), (tails, heads)), shape=(size, size))
    holes: Longs = connected_components(graph, directed=False)[1][tails]
    return holes


def _cycle(links: Ints, up: Longs, h: int) -> Ints:
    """Return the portals of the loop that crosses a half-edge, and then stays in the dual tree."""

    def way_up(face: int) -> list[int]:
        way = []
        while up[face] >= 0:
            way.append(int(up[face]))
            face = int(links[way[-1], OPPOSITE]) // 3
        return way

    here, there = way_up(h // 3), way_up(int(links[h, OPPOSITE]) // 3)
    while here and there and here[-1] == there[-1]:
        here.pop()
        there.pop()
    ways = [h, *links[here, OPPOSITE].tolist(), *reversed(there)]
    return np.array(ways, np.int32)

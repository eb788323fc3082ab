"""From points to the nodes of a sweep: its vertices, and sites for what is no vertex."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.canonical import half_edges_around
from geodesic_core.errors import InvalidArgument, NoPath
from geodesic_core.kernels.topology import APEX, TAIL
from geodesic_core.kernels.wavefront import NODE, SITE, Sites
from geodesic_core.mesh import TriangleMesh
from geodesic_core.surface_point import UNPLACED, SurfacePoint


@dataclass(frozen=True)
class Nodes:
    """The nodes of the sources of a sweep, and of what it is to reach."""

    sources: Ints
    """(N,): an inner vertex, or a number beyond the vertices, for each source"""
    targets: Ints
    """(M,): the same for each target"""
    sites: Sites
    first_target: int
    """Row of the first target among those of the sites."""
    points: tuple[SurfacePoint, ...]
    """Those that became sites, in the order of their nodes."""
    positions: Floats
    """(sites, 3), mesh units"""
    components: tuple[int, ...]
    """Those of the mesh with a source in them"""


@dataclass(frozen=True)
class Ends:
    """The ends of several sweeps, each from one source to some of the targets."""

    sources: tuple[SurfacePoint, ...]
    targets: tuple[SurfacePoint, ...]
    source_components: Ints
    """(N,): the connected component of each source"""
    target_components: Ints
    corners: Ints
    """(M, 3): the inner vertices around each target, or itself"""
    reaches: Floats
    """(M, 3): how far each is, mesh units"""
    nodes: Nodes
    """Of all sources and all targets"""

    def targets_connected_to(self, source: int) -> Ints:
        """Return the targets in the component of a source."""
        connected = self.target_components == self.source_components[source]
        return np.flatnonzero(connected).astype(np.int32)

    def between(self, source: int, targets: Ints) -> Nodes:
        """Return the nodes of a sweep from one source to some targets."""
        nodes = self.nodes
        ints = nodes.sites.ints
        start, ends = nodes.sources[[source]], nodes.targets[targets]
        first = np.flatnonzero(ints[: nodes.first_target, NODE] == start)
        second = nodes.first_target + np.flatnonzero(
            np.isin(ints[nodes.first_target :, NODE], ends)
        )
        rows = np.concatenate([first, second])
        return replace(
            nodes,
            sources=start,
            targets=ends,
            sites=Sites(
                nodes.sites.nodes, ints[rows], nodes.sites.weights[rows], nodes.sites.windows
            ),
            first_target=len(first),
            components=(int(self.source_components[source]),),
        )


def ends_of(
    mesh: TriangleMesh, sources: Sequence[SurfacePoint], targets: Sequence[SurfacePoint]
) -> Ends:
    """Return the ends of sweeps from canonical points to canonical points."""
    corners, reaches = np.empty((len(targets), 3), np.int32), np.empty((len(targets), 3))
    for i, target in enumerate(targets):
        corners[i], reaches[i] = corners_of(mesh, target)
    return Ends(
        sources=tuple(sources),
        targets=tuple(targets),
        source_components=np.array([component_of(mesh, point) for point in sources], np.int32),
        target_components=np.array([component_of(mesh, point) for point in targets], np.int32),
        corners=corners,
        reaches=reaches,
        nodes=nodes_of(mesh, sources, targets),
    )


def nodes_of(
    mesh: TriangleMesh, sources: Sequence[SurfacePoint], targets: Sequence[SurfacePoint]
) -> Nodes:
    """Return the nodes of canonical points."""
    vertices = len(mesh.vertices)
    sited: list[SurfacePoint] = []
    rows: list[tuple[int, int, int]] = []
    weights: list[tuple[float, ...]] = []

    def nodes(points: Sequence[SurfacePoint]) -> Ints:
        found = np.empty(len(points), np.int32)
        for i, point in enumerate(points):
            if point.vertex_index is not None:
                found[i] = mesh.topology.inner_vertex[point.vertex_index]
                continue
            found[i] = vertices + len(sited)
            sited.append(point)
            for face, at_corners in faces_of(mesh, point):
                rows.append((int(found[i]), face, -1))
                weights.append(at_corners)
        return found

    source_nodes = nodes(sources)
    first_target = len(rows)
    target_nodes = nodes(targets)
    return Nodes(
        sources=source_nodes,
        targets=target_nodes,
        sites=Sites(
            len(sited),
            np.array(rows, np.int32).reshape(-1, SITE),
            np.array(weights).reshape(-1, 3),
            sum(_edge_faces(mesh, face) for _, face, _ in rows),
        ),
        first_target=first_target,
        points=tuple(sited),
        positions=np.array([mesh.position(point) for point in sited]).reshape(-1, 3),
        components=tuple({component_of(mesh, point) for point in sources}),
    )


def _edge_faces(mesh: TriangleMesh, face: int) -> int:
    """Return how many faces the three edges of an inner face have, each edge's counted."""
    links = mesh.topology.links
    return sum(len(list(half_edges_around(links, h))) for h in range(3 * face, 3 * face + 3))


def as_points(
    mesh: TriangleMesh, points: Iterable[int | SurfacePoint], name: str
) -> list[SurfacePoint]:
    """Return canonical points; ``name`` is how messages call one of them.

    Raises
    ------
    InvalidArgument
        There are none.
    InvalidPoint
        One is not a point of the mesh.
    """
    if isinstance(points, str | bytes) or not isinstance(points, Iterable):
        raise InvalidArgument(f"{name}s is {points!r}; it must be a sequence of points")
    places = [mesh.point(point, f"{name} {i}") for i, point in enumerate(points)]
    if not places:
        raise InvalidArgument(f"there are no {name}s: give at least one")
    return places


def component_of(mesh: TriangleMesh, point: SurfacePoint) -> int:
    """Return the connected component of a canonical point."""
    vertex = point.vertex_index
    if vertex is None:
        vertex = int(mesh.faces[point.face_index, 0])
    return int(mesh.components[vertex])


def disconnected(mesh: TriangleMesh, message: str, *points: SurfacePoint) -> NoPath:
    """Return the error of canonical points that are not connected, and why they may not be."""
    lonely = [point for point in points if point.face_index == UNPLACED]
    blocked = len(mesh.barriers)
    if lonely:
        message += f": {lonely[0]} belongs to no {'free face' if blocked else 'face'}"
    elif blocked:
        message += f", among {blocked} blocked {'face' if blocked == 1 else 'faces'}"
    return NoPath(message, "disconnected")


def corners_of(mesh: TriangleMesh, point: SurfacePoint) -> tuple[Ints, Floats]:
    """Return the inner vertices around a canonical point, or itself, and how far each is."""
    inner = mesh.topology.inner_vertex
    if point.vertex_index is not None:
        return inner[[point.vertex_index]], np.zeros(1)
    corners = mesh.faces[point.face_index]
    away = mesh.vertices[corners] - mesh.position(point)
    return inner[corners], np.linalg.norm(away, axis=1)


def faces_of(mesh: TriangleMesh, point: SurfacePoint) -> list[tuple[int, tuple[float, ...]]]:
    """Return each inner face that a point belongs to, with its weights there."""
    topology = mesh.topology
    corners = topology.inner_vertex[mesh.faces[point.face_index]].tolist()
    share = dict(zip(corners, point.barycentric, strict=True))

    def weights_in(face: int) -> tuple[float, ...]:
        inner_corners = topology.links[3 * face : 3 * face + 3, TAIL].tolist()
        return tuple(share.get(corner, 0.0) for corner in inner_corners)

    face = int(mesh.inner_face[point.face_index])
    if 0.0 not in point.barycentric:
        return [(face, weights_in(face))]
    (h,) = (h for h in range(3 * face, 3 * face + 3) if share[topology.links[h, APEX]] == 0.0)
    return [(g // 3, weights_in(g // 3)) for g in half_edges_around(topology.links, h)]

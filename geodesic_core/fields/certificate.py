"""Certificates: lower and upper bounds of the distances of a field, with what proves them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from geodesic_core import verify
from geodesic_core.arrays import Floats, Longs
from geodesic_core.control import Control, in_slices
from geodesic_core.errors import InternalError, InvalidArgument
from geodesic_core.fields.path import located_path
from geodesic_core.fields.question import Question
from geodesic_core.fields.sources import Nodes
from geodesic_core.fields.sweep_result import SweepResult, all_winners
from geodesic_core.fields.sweeps import Sweep, WholeSweep
from geodesic_core.files import as_output, written
from geodesic_core.kernels.certificates.edge_functions import (
    EdgeFunction,
    OnEdges,
    Sides,
    edge_function,
    sides_of,
)
from geodesic_core.kernels.certificates.faces import Faces, Numbers
from geodesic_core.kernels.certificates.path_lengths import (
    EX,
    FX,
    FY,
    PLANE,
    ROUNDED,
    SLACK,
    Starts,
    Surface,
    measure_paths,
)
from geodesic_core.kernels.certificates.rises import (
    Pieces,
    Turns,
    find_jumps,
    find_rises,
)
from geodesic_core.kernels.mesh.half_edges import LENGTH, Topology
from geodesic_core.kernels.paths.backtracing import Winners
from geodesic_core.kernels.retained.face_windows import FaceWindows, face_windows_of
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import CERTIFIED, STRAIGHT

_SAVED_PATHS = 100
"""Paths in a file, to the farthest vertex and others: they tell how large the gap is"""


@dataclass(frozen=True, eq=False, repr=False)
class Certificate:
    """Proved bounds of the distances of a field, and what proves them.

    The lower bounds are proved by a function on the edges, see `geodesic_core.verify`. The upper
    bounds are lengths of paths. Both are proved with all rounding counted, for the mesh as its
    numbers say, and do not rely on the solver.

    Examples
    --------
    >>> certificate = gc.exact_distance(gc.samples.sphere(80), 0).certify()
    >>> certificate.holds, certificate.relative_gap < 1e-9
    (True, True)
    """

    mesh: TriangleMesh
    """The surface, with the barriers of the call."""
    lower: Floats
    """(V,) mesh units: no vertex is nearer; infinite where no path leads from a source. Of vertices
    beyond the limit of the field, only that they are, about."""
    upper: Floats
    """(V,) mesh units: lengths of paths, start distances counted; infinite where none leads within
    the limit of the field."""
    violations: Floats
    """(F,) mesh units: by how much the function on the edges may rise faster than distances can,
    across each face; 0 or rounding, and 0 for faces beyond the limit of the field."""
    holds: bool
    """Whether the distances of the field are proved: that exact ones are, and that approximate ones
    are within their error, and no longer than exact ones; to 1e-8 of the largest distance, or of
    the limit."""
    arrays: dict[str, Floats | Longs]
    """The function on the edges, and paths to some of the vertices."""

    @property
    def relative_gap(self) -> float:
        """The largest difference of the bounds, as a share of the largest distance."""
        reached = np.isfinite(self.upper)
        upper = self.upper[reached]
        gap = float((upper - self.lower[reached]).max(initial=0.0))
        largest = float(upper.max(initial=0.0))
        return gap / largest if largest > 0.0 else 0.0

    @property
    def worst_face(self) -> int:
        """The face of the largest violation."""
        return int(self.violations.argmax())

    @property
    def worst_violation(self) -> float:
        """The largest violation, mesh units."""
        return float(self.violations[self.worst_face])

    def save(self, path: str | Path) -> None:
        """Write what proves the bounds into a file, for ``geodesic-verify``.

        Parameters
        ----------
        path
            The file, which ends in ``.npz``. It holds neither mesh nor sources.

        Raises
        ------
        InvalidArgument
            The path does not end in ``.npz``, or cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "proof.npz"
        >>> gc.exact_distance(gc.samples.plane(2), 0).certify().save(file)
        >>> np.load(file)["values"].round(3).tolist()
        [0.0, 1.0, 1.0, 1.414]
        """
        with written(as_output(path, ".npz")) as file:
            np.savez_compressed(file, allow_pickle=False, **self.arrays)

    def __repr__(self) -> str:
        state = "holds" if self.holds else "does not hold"
        return f"Certificate({state}, gap {self.relative_gap:.2g} of the largest distance)"


def certified(sweep: Sweep, result: SweepResult, control: Control) -> Certificate:
    """Return the certificate of the result of a sweep.

    Raises
    ------
    InvalidArgument
        The sweep has curves as sources.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    # Windows of a fast sweep do not cover the edges: what an exact one finds proves it as well.
    whole = sweep if isinstance(sweep, WholeSweep) else sweep.exact
    question = sweep.question
    if question.has_curves:
        raise InvalidArgument("a field with curves as sources has no certificate yet: give points")
    winners, windows = result.winners, result.windows
    mesh, limit = question.mesh, question.max_distance
    if winners is None or windows is None or math.isfinite(limit):
        # Faces at the limit must have all windows.
        limit += float(mesh.topology.geometry[:, LENGTH].max()) * (1.0 + STRAIGHT)
        whole = replace(whole, question=replace(question, max_distance=limit))
        wave = whole.run(control.for_part(0, 4), "windows")
        winners, windows = all_winners(wave), face_windows_of(wave)
    distances = winners.vertices.distance[mesh.topology.inner_vertex]
    is_beyond = np.isinf(distances) & np.isin(mesh.components, question.nodes.components)
    values = np.where(is_beyond, limit, distances)
    surface = verify.Surface(
        None if mesh.lengths is not None else mesh.vertices,
        mesh.faces,
        mesh.lengths,
        values,
        mesh.barriers,
    )
    values = values[surface.label]
    within = np.where(distances <= question.max_distance, distances, np.inf)[surface.label]
    sources = [
        _source(line[0], start)
        for line, start in zip(question.polylines, question.start_distances.tolist(), strict=True)
    ]
    numbers = _numbers(mesh.topology, surface)
    sides = sides_of(mesh.topology, _faces(surface), numbers)
    arrays = _function_on_edges(surface, sides, windows, values, sources, control.for_part(1, 4))
    bounds = partial(rises_and_jumps, control=control.for_part(2, 4))
    proof = verify.prove(surface, sources, arrays, bounds)
    upper, paths = _upper_bounds(
        question, surface, numbers, sources, winners, within, control.for_part(3, 4)
    )
    reached = np.isfinite(upper)
    largest = question.max_distance if math.isfinite(question.max_distance) else 0.0
    slack = CERTIFIED * float(upper[reached].max(initial=largest))
    most = whole.upper_bounds(within[reached])
    found, lower, high = (array[reached] for array in (within, proof.lower, upper))
    holds = bool((found - lower <= slack).all() and (high - most <= slack).all())
    counts = reached[mesh.faces].any(axis=1)
    control.finish()
    violations = np.where(counts, proof.tau, 0.0)
    return Certificate(mesh, proof.lower, upper, violations, holds, arrays | paths)


def _numbers(topology: Topology, surface: verify.Surface) -> Numbers:
    """Return what the checker calls inner faces and vertices."""
    rows = np.full(len(surface.given), -1)
    rows[surface.kept] = np.arange(len(surface.kept))
    return Numbers(rows[topology.outer_face], surface.label[topology.outer_vertex])


def _faces(surface: verify.Surface) -> Faces:
    """Return faces and edges for kernels."""
    length = surface.length.m, surface.length.r
    return Faces(surface.edges, *length, surface.is_rim, surface.faces, surface.of_face)


def rises_and_jumps(
    surface: verify.Surface, function: verify.Pieces, control: Control
) -> tuple[Floats, Floats]:
    """Return what `verify.rises_and_jumps` does, by kernels."""
    faces, every = _faces(surface), np.arange(len(surface.faces))
    turns = [surface.corner(every, c)[2:] for c in range(3)]
    columns = ((cosine.m, sine.m, np.hypot(cosine.r, sine.r) * verify.UP) for cosine, sine in turns)
    of_corners = Turns(*(np.stack(column, axis=1) for column in zip(*columns, strict=True)))
    cones = function.start, function.a, function.h, function.sigma.m, function.sigma.r
    pieces = Pieces(*cones, function.t0, function.t1)
    rises, jumps = np.zeros(len(every)), np.zeros(len(surface.edges))

    def find_rises_of(first: int, last: int) -> int:
        find_rises(faces, of_corners, pieces, first, last, rises)
        return len(rises)

    def find_jumps_of(first: int, last: int) -> int:
        find_jumps(faces, pieces, function.values, first, last, jumps)
        return len(jumps)

    in_slices(len(rises), find_rises_of, control.for_part(0, 2))
    in_slices(len(jumps), find_jumps_of, control.for_part(1, 2))
    return rises, jumps


def _function_on_edges(
    surface: verify.Surface,
    sides: Sides,
    windows: FaceWindows,
    values: Floats,
    sources: Sequence[verify.Source],
    control: Control,
) -> dict[str, Floats | Longs]:
    """Return the least of windows and of distances of the ends, on each edge of two faces or more.

    Sources on an edge count there as well.
    """
    given = _faces(surface), sides, windows, values, _sources_on_edges(surface, sources)
    parts = [edge_function(*given, 0, 0)]

    def find(first: int, last: int) -> int:
        parts.append(edge_function(*given, first, last))
        return len(surface.edges)

    in_slices(len(surface.edges), find, control)
    function = map(np.concatenate, zip(*parts, strict=True))
    return {"values": values, **dict(zip(EdgeFunction._fields, function, strict=True))}


def _sources_on_edges(surface: verify.Surface, sources: Sequence[verify.Source]) -> OnEdges:
    """Return the sources that lie on edges, none at a vertex."""
    keys, found = surface.edges[:, 0] * surface.count + surface.edges[:, 1], []
    for source in sources:
        held = np.flatnonzero(source.weights)
        if source.vertex < 0 and len(held) == 2:
            low, high = sorted(
                held, key=lambda k: int(surface.label[surface.given[source.face, k]])
            )
            ends = surface.label[surface.given[source.face, [low, high]]]
            edge = int(np.searchsorted(keys, ends[0] * surface.count + ends[1]))
            found.append((edge, source.weights[high] * surface.length.m[edge], source.start))
    edges, foot, sigma = np.array(sorted(found)).reshape(-1, 3).T
    return OnEdges(np.searchsorted(edges, np.arange(len(keys) + 1)), foot.copy(), sigma.copy())


def _source(point: SurfacePoint, start: float) -> verify.Source:
    if point.vertex_index is not None:
        return verify.Source(point.vertex_index, -1, (0.0, 0.0, 0.0), start)
    return verify.Source(-1, point.face_index, point.barycentric, start)


def _upper_bounds(
    question: Question,
    surface: verify.Surface,
    numbers: Numbers,
    sources: list[verify.Source],
    winners: Winners,
    values: Floats,
    control: Control,
) -> tuple[Floats, dict[str, Floats | Longs]]:
    """Return lengths of paths to all vertices that have values, and some of the paths."""
    upper = np.full(len(values), np.inf)
    for source in sources:
        if source.vertex >= 0:
            is_there = surface.label == surface.label[source.vertex]
            upper[is_there] = np.minimum(upper[is_there], source.start)
    ends = np.flatnonzero(np.isfinite(values) & (upper > values))
    ends = ends[surface.label[ends] == ends]
    topology = question.mesh.topology
    # In the inner order, in which neighbours follow each other: their paths cross the same faces.
    ends = ends[np.argsort(topology.inner_vertex[ends])]
    targets, bounds = topology.inner_vertex[ends], np.full(len(winners.nearest), np.nan)
    crossed = Surface(_faces(surface), numbers, _planes(surface))
    starts = _starts(question.nodes, surface, sources)

    def measure(first: int, last: int) -> int:
        measure_paths(topology, winners, crossed, starts, targets[first:last], bounds)
        return len(ends)

    in_slices(len(ends), measure, control)
    lengths = bounds[targets]
    if not np.isfinite(lengths).all():
        lost = ends[np.isinf(lengths)][0]
        raise InternalError(f"the path to vertex {lost} cannot be traced; please report this mesh")
    upper[ends] = np.minimum(upper[ends], lengths)
    upper = np.where(np.isfinite(values), upper[surface.label], np.inf)
    spread = np.linspace(0, len(ends) - 1, min(_SAVED_PATHS, len(ends))).astype(int)
    some = ends[np.argsort(values[ends])[spread]]
    paths = _paths_to(question, surface, winners, some, control)
    return upper, {f"path_{name}": array for name, array in paths._asdict().items()}


def _planes(surface: verify.Surface) -> Floats:
    """Return the planes of the faces that paths may cross."""
    out, into, cosine, sine = surface.corner(np.arange(len(surface.kept)), 0)
    reach = surface.length[into]
    edges = surface.length[out], reach * cosine, reach * sine
    planes = np.zeros((len(surface.kept), PLANE))
    for column, edge in zip((EX, FX, FY), edges, strict=True):
        planes[:, column] = edge.m
        planes[:, SLACK] += edge.r + ROUNDED * np.abs(edge.m)
    return planes


def _starts(nodes: Nodes, surface: verify.Surface, sources: Sequence[verify.Source]) -> Starts:
    """Return where paths may begin."""
    at_vertices, count = np.full(surface.count, np.inf), len(nodes.points)
    corners, rows = np.full((count, 3), -1), np.full(count, -1)
    weights, distances = np.zeros((count, 3)), np.full(count, np.inf)
    for node, index in zip(nodes.sources.tolist(), nodes.source_indices.tolist(), strict=True):
        source, k = sources[index], node - surface.count
        if source.vertex >= 0:
            v = surface.label[source.vertex]
            at_vertices[v] = min(at_vertices[v], source.start)
            continue
        corners[k], weights[k] = surface.label[surface.given[source.face]], source.weights
        if all(source.weights):
            rows[k] = np.searchsorted(surface.kept, source.face)
        distances[k] = source.start
    return Starts(at_vertices, corners, weights, rows, distances)


def _paths_to(
    question: Question, surface: verify.Surface, winners: Winners, ends: Longs, control: Control
) -> verify.Paths:
    """Return the paths to some vertices, by weights in the faces that they cross."""
    mesh = question.mesh
    first, faces, at, weights = [0], [np.empty(0, np.int32)], [], []
    for v in control.watched(mesh.topology.inner_vertex[ends].tolist()):
        located, crossed = located_path(mesh, winners, question.nodes, v)
        first.append(first[-1] + len(crossed))
        faces.append(crossed)
        at.append(np.stack([located.faces[:-1], located.faces[1:]]))
        weights.append(np.stack([located.weights[:-1], located.weights[1:]]))
    crossed = np.concatenate(faces)
    points = np.concatenate(at, axis=1) if at else np.empty((2, 0), np.int32)
    shares = np.concatenate(weights, axis=1) if at else np.empty((2, 0, 3))
    corners, given = surface.label[mesh.faces[crossed]], surface.label[mesh.faces[points]]
    sides = (_weights_in(corners, given[k], shares[k]) for k in (0, 1))
    return verify.Paths(np.array(first), crossed, *sides)


def _weights_in(corners: Longs, given: Longs, weights: Floats) -> Floats:
    """Return weights at other corners, of points that both triangles hold, (K, 3)."""
    is_same = corners[:, :, None] == given[:, None, :]
    moved: Floats = (is_same * weights[:, None, :]).sum(axis=2)
    return moved

"""Charts: each vertex in the tangent plane of its nearest source, for many sources at once."""

import math
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats, Ints, sums_by
from geodesic_core.control import Control
from geodesic_core.fields.question import Question
from geodesic_core.fields.straight_lines import lines_from
from geodesic_core.fields.sweeps import DirectedSweep
from geodesic_core.kernels.front.directions import angles_at_sources
from geodesic_core.kernels.front.relaxation import nearest_sources
from geodesic_core.kernels.front.state import ENTRY_EDGE, PREDECESSOR
from geodesic_core.kernels.mesh.frames import Frame
from geodesic_core.mesh.frames import planes_at
from geodesic_core.mesh.surface_curve import locations_of
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class Charts:
    """Log maps of several sources, each of the part of the surface that is nearest to it.

    N nodes: the vertices in the caller's order, and the targets of the question.
    """

    mesh: TriangleMesh
    sources: tuple[SurfacePoint, ...]
    distances: Floats
    """(N,) mesh units; infinite where unreachable"""
    nearest: Ints
    """(N,) index of the nearest source; -1 where unreachable"""
    coordinates: Floats
    """(N, 2) mesh units, in the tangent plane of the nearest source; NaN where unreachable"""
    straight: Floats
    """(N,) mesh units: how far the path from the source is straight, up to its first bend"""
    frames: Frame
    """Of the sources, as arrays (S,)"""

    def steps(self, masses: Floats, first: int = 0) -> Floats:
        """Return a step for each source toward the middle of what is nearest to it, (S, 2).

        That is a step of Newton's method for the sum of the squared distances of the nodes from
        ``first`` on, weighted by their ``masses``. As its source moves across the path to a node,
        the distance grows as on a circle around the first bend: so its square has the second
        derivatives 2 along the path, and 2 · distance / straight part across it.
        """
        nearest, count = self.nearest[first:], len(self.sources)
        reached = nearest >= 0
        nearest, masses = nearest[reached], masses[reached]
        places, distances = self.coordinates[first:][reached], self.distances[first:][reached]
        away = distances > 0.0
        across = np.ones(len(distances))
        np.divide(distances, self.straight[first:][reached], out=across, where=away)
        x, y = np.divide(places, distances[:, None], where=away[:, None], out=places * 0.0).T
        xx, xy, yy = (
            sums_by(nearest, masses * second, count)
            for second in (
                across + (1.0 - across) * x * x,
                (1.0 - across) * x * y,
                across + (1.0 - across) * y * y,
            )
        )
        to_x, to_y = (sums_by(nearest, masses * place, count) for place in places.T)
        determinant = xx * yy - xy * xy
        steps = np.stack([yy * to_x - xy * to_y, xx * to_y - xy * to_x], axis=1)
        has_mass = determinant > 0.0
        steps[has_mass] /= determinant[has_mass, None]
        steps[~has_mass] = 0.0
        return steps

    def moved(self, vectors: Floats, control: Control) -> list[SurfacePoint]:
        """Return each source, moved straight by a vector in its tangent plane, (S, 2).

        At a boundary a vector that leads off the surface is projected to the side of it.
        """
        turns, lengths = _ways(self.frames, vectors)
        angles = self.frames.kernel_angles(turns / self.frames.scale)
        starts = locations_of(self.mesh, self.sources)
        lines = lines_from(self.mesh, starts, self.frames, angles, lengths, False, control)
        return [line.locations[-1] for line in lines]


def _ways(frames: Frame, vectors: Floats) -> tuple[Floats, Floats]:
    """Return angles in the tangent planes, and lengths, of vectors or of what is left of them."""
    x, y = vectors.T
    turns, lengths = np.arctan2(y, x) % (2.0 * math.pi), np.hypot(x, y)
    last = frames.total_angle * frames.scale
    leaves = ~frames.is_closed & (turns > last)
    is_nearer_last = turns - last < 2.0 * math.pi - turns
    off = np.where(is_nearer_last, turns - last, 2.0 * math.pi - turns)
    sides = np.where(is_nearer_last, last, 0.0)
    shares = np.maximum(np.cos(off), 0.0)
    return np.where(leaves, sides, turns), np.where(leaves, lengths * shares, lengths)


def charts_of(question: Question, control: Control) -> Charts:
    """Return the charts of a question whose sources are points.

    Raises
    ------
    NoTangentPlane
        A source has none.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    mesh, sources = question.mesh, tuple(line[0] for line in question.polylines)
    frames = planes_at(mesh, locations_of(mesh, sources))
    vertices = DirectedSweep(question).run(control).vertices
    angles, _ = angles_at_sources(mesh.topology, vertices, question.nodes.sites)
    ints, index = vertices.winner_ints, vertices.source_index
    nearest = nearest_sources(vertices.distance, ints, index)
    nodes = np.concatenate([mesh.topology.inner_vertex, question.nodes.targets])
    distances, nearest = vertices.distance[nodes], nearest[nodes]
    turns = _planar(frames, angles[nodes], nearest)
    radii = np.where(nearest >= 0, distances, np.nan)
    turns[distances == 0.0] = 0.0
    coordinates = np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1)
    straight = _straight(vertices.distance, ints)[nodes]
    return Charts(mesh, sources, distances, nearest, coordinates, straight, frames)


def _straight(distances: Floats, winner_ints: Ints) -> Floats:
    """Return the length of the straight part that the path to each node begins with, (N,)."""
    is_source, before = winner_ints[:, ENTRY_EDGE] < 0, winner_ints[:, PREDECESSOR]
    first = np.arange(len(distances))
    while True:
        earlier = np.where(is_source[first], first, before[first])
        is_bend = ~is_source[earlier]
        if not is_bend.any():
            straight: Floats = distances[first]
            return straight
        first = np.where(is_bend, earlier, first)


def _planar(frames: Frame, angles: Floats, nearest: Ints) -> Floats:
    """Return the kernels' angles as angles in the tangent planes of the nearest sources."""
    factors = frames.sense * frames.scale
    planar: Floats = (angles - frames.start[nearest]) * factors[nearest]
    return planar

"""Landmarks: distances from a few far-apart vertices, which bound all others (section 5, outlook).

Goldberg and Harrelson, *Computing the Shortest Path: A* Search Meets Graph Theory* (2005).
"""

import math

import numpy as np

from geodesic_core.arrays import Floats, Ints, Singles, aligned_rows
from geodesic_core.control import Control
from geodesic_core.fields.sources import nodes_of
from geodesic_core.fields.sweep import sweep_nodes
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.bounds import (
    LANDMARKS,
    PruningBounds,
    merging_bounds,
    pruning_toward,
)
from geodesic_core.kernels.front.pruning import bound_landmarks
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import LANDMARK_ERROR


class Landmarks:
    """A growing set of landmarks of one mesh.

    By the triangle inequality the distance of two vertices is at least the difference of their
    distances from a landmark. Those are approximate, which costs ``LANDMARK_ERROR`` of them: an
    exact sweep would cost up to ten times as much.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.count = 0
        self.distances: Singles = np.empty((0, LANDMARKS), np.float32)
        """(V, LANDMARKS) by inner vertex, mesh units; the first ``count`` columns are set"""
        self._nearest = np.full(len(mesh.vertices), math.inf)

    def pruning_through(
        self, position: Floats, corners: Ints, reaches: Floats, limit: float
    ) -> PruningBounds:
        """Return the bounds of paths through a point, ``reaches`` away from its ``corners``."""
        least, most = np.zeros(LANDMARKS), np.zeros(LANDMARKS)
        bound_landmarks(self.distances, self.count, corners, reaches, least, most)
        return pruning_toward(self.mesh.positions_for_bounds, position, limit)._replace(
            landmarks=self.distances, landmark_count=self.count, least=least, most=most
        )

    def add(self, beside: int, control: Control) -> None:
        """Add the vertex farthest from all others, in the component of inner vertex ``beside``.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As the control says; nothing is added then.
        """
        mesh = self.mesh
        topology = mesh.topology
        component = mesh.components[topology.outer_vertex[beside]]
        candidates = topology.inner_vertex[mesh.components == component]
        if np.isinf(self._nearest[beside]):  # the first here: far from somewhere, at least
            apart = mesh.positions_for_bounds[candidates] - mesh.positions_for_bounds[beside]
            chosen = candidates[np.argmax(np.einsum("vk,vk->v", apart, apart))]
        else:
            chosen = candidates[np.argmax(self._nearest[candidates])]
        bounds = merging_bounds(math.inf, LANDMARK_ERROR, math.inf)
        wave = state.new_wavefront(topology, merges=True)
        control.check_memory(state.bytes_of(wave))
        nodes = nodes_of(mesh, [(mesh.point(int(topology.outer_vertex[chosen])),)], [], control)
        wave = sweep_nodes(mesh, wave, nodes, np.zeros(1), bounds, control, lambda _: 1.0)
        if self.count == 0:
            self.distances = aligned_rows(len(mesh.vertices), LANDMARKS, np.float32)
        self.distances[:, self.count] = _in_single_precision(wave.vertices.distance)
        self.count += 1
        self._nearest = np.minimum(self._nearest, wave.vertices.distance)


def _in_single_precision(distance: Floats) -> Singles:
    """Return distances rounded, or all infinite, which tell nothing, where one has no such number.

    Single precision ends far before the largest mesh that is taken, and far above the smallest.
    """
    known = distance[(distance > 0.0) & (distance < math.inf)]
    limits = np.finfo(np.float32)
    if ((known < limits.tiny) | (known > limits.max)).any():
        return np.full(len(distance), math.inf, np.float32)
    return distance.astype(np.float32)

"""Costs of a call: by face, by slope, or both, checked."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Longs
from geodesic_core.costs.slope_cost import NO_RULE, SlopeCost, step_costs
from geodesic_core.errors import InvalidArgument
from geodesic_core.kernels.costs.rule import Rule
from geodesic_core.kernels.mesh.half_edges import TAIL
from geodesic_core.mesh.triangle_mesh import TriangleMesh

Cost = ArrayLike | SlopeCost | tuple[ArrayLike, SlopeCost]
"""Every way to write a cost: a factor for each face, a cost by slope, or both"""


@dataclass(frozen=True, eq=False)
class SurfaceCosts:
    """What steps on a surface cost."""

    factors: Floats
    """(F,) by inner face; infinite where no path may go"""
    heights: Floats
    """(V,) by inner vertex, mesh units; of no length where slopes do not count"""
    rule: Rule
    up: Floats
    """(3,): the direction in which heights grow; in the costs of the way back, the other one"""
    least_by_length: float
    """The least that a unit of length on the surface costs, for a factor of 1"""

    @classmethod
    def of(cls, mesh: TriangleMesh, cost: Any, barriers: Longs) -> "SurfaceCosts":
        """Check the costs of a call, in which some faces are barriers.

        Raises
        ------
        InvalidArgument
            They have another shape, or one is 0, negative or NaN.
        NotEmbedded
            They are by slope, and the mesh has lengths alone.
        """
        by_face, by_slope = _parts_of(cost)
        factors = _as_factors(by_face, len(mesh.faces))
        factors[barriers] = np.inf
        inner = factors[mesh.topology.outer_face]
        if by_slope is None:
            return cls(inner, np.empty(0), NO_RULE, np.zeros(3), 1.0)
        mesh.require_embedded("a cost by slope")
        heights = mesh.positions @ by_slope.direction
        if not by_slope.zigzag:
            steepest, (low, high) = _steepest(mesh, heights), by_slope.limits
            inner[(steepest > high) | (steepest > -low)] = np.inf
        return cls(inner, heights, by_slope.rule, by_slope.direction, by_slope.least_by_length)

    @property
    def is_symmetric(self) -> bool:
        """True where the way back costs as much."""
        return self.rule.pieces == 0

    @property
    def least(self) -> float:
        """The factor of the cheapest face; infinite where all are closed."""
        return float(self.factors.min(initial=np.inf))

    def turned(self) -> "SurfaceCosts":
        """Return the costs of the same ways in the other direction."""
        return replace(self, heights=-self.heights, up=-self.up)

    def of_steps(self, inner_faces: Longs, square: Floats, rise: Floats) -> Floats:
        """Return what steps in inner faces cost, by their squared lengths and their rises."""
        costs: Floats = self.factors[inner_faces] * step_costs(self.rule, square, rise)
        return costs

    def at_least(self, distances: Floats, apart: Floats) -> Floats:
        """Return costs that no paths are below, by exact distances and by how far apart they lead.

        ``apart`` (N, 3) are vectors through space, which count where slopes do: costs by slope are
        convex, and what a path costs by its length on the map is not below 0.
        """
        bounds = self.least_by_length * distances
        if self.rule.pieces > 0:
            straight = step_costs(self.rule, (apart * apart).sum(axis=1), apart @ self.up)
            bounds = np.maximum(bounds, straight)
        lowest: Floats = self.least * bounds
        return lowest


def _parts_of(cost: Any) -> tuple[Any, SlopeCost | None]:
    if isinstance(cost, SlopeCost):
        return 1.0, cost
    if isinstance(cost, tuple) and len(cost) == 2 and isinstance(cost[1], SlopeCost):
        return cost
    return cost, None


def _as_factors(by_face: Any, count: int) -> Floats:
    try:
        given = np.asarray(by_face, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"the costs are not numbers: {error}; give one for each face, a SlopeCost, or a pair "
            "of both"
        ) from error
    if given.shape not in ((), (count,)):
        raise InvalidArgument(
            f"the costs have shape {given.shape}; it must be ({count},), one for each face"
        )
    factors = np.array(np.broadcast_to(given, (count,)))
    bad = np.flatnonzero(~(factors > 0.0))
    if len(bad):
        raise InvalidArgument(
            f"the cost of face {bad[0]} is {factors[bad[0]]}; it must be above 0, or infinite "
            "where no path may go"
        )
    return factors


def _steepest(mesh: TriangleMesh, heights: Floats) -> Floats:
    """Return the slope of each inner face straight up, (F,)."""
    corners = mesh.topology.links[:, TAIL].reshape(-1, 3)
    points, rises = mesh.positions[corners], heights[corners]
    edges = points[:, 1:] - points[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1])
    area = np.linalg.norm(normal, axis=1)
    # The part of the normal along the heights' axis is the area on the map.
    gains = rises[:, 1:] - rises[:, :1]
    across = edges[:, 1] * gains[:, :1] - edges[:, 0] * gains[:, 1:]
    steep = np.linalg.norm(across, axis=1)  # the sine of the tilt, times the area
    flat = np.sqrt(np.maximum(area * area - steep * steep, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes: Floats = np.where(area > 0.0, steep / flat, 0.0)
    return slopes

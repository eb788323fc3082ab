"""A search between two points: its ends, what bounds it, and the log of its steps."""

import math
import time
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints
from geodesic_core.control import Control
from geodesic_core.errors import InternalError, NoPath
from geodesic_core.fields.path import SearchStep, StepName
from geodesic_core.fields.sources import corners_of
from geodesic_core.kernels.front import pruning
from geodesic_core.kernels.front.counters import CREATED, TOUCHED
from geodesic_core.kernels.front.state import Wavefront
from geodesic_core.mesh.surface_point import SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import AT_LIMIT, STRAIGHT


class End:
    """An end of a search, and the vertices around it."""

    def __init__(self, mesh: TriangleMesh, point: SurfacePoint) -> None:
        self.point = point
        self.position: Floats = mesh.position_for_bounds(point)
        self.corners, self.reaches = corners_of(mesh, point)

    @property
    def nearest_corner(self) -> int:
        """The inner vertex nearest to it."""
        return int(self.corners[self.reaches.argmin()])


class SearchLog:
    """Log of the steps of a search, where they are to be explained."""

    def __init__(self, mesh: TriangleMesh, explain: bool) -> None:
        self.steps: tuple[SearchStep, ...] | None = () if explain else None
        self._mesh = mesh
        self._began = time.perf_counter()

    def add(self, name: StepName, bound: float, wave: Wavefront | None = None) -> None:
        """Note a step that has ended; the faces it visited are those of the state, if any."""
        if self.steps is None:
            return
        seconds = time.perf_counter() - self._began
        faces: Ints = np.empty(0, np.int32)
        if wave is not None:
            visited = np.zeros(len(self._mesh.faces), np.uint8)
            touched = wave.vertices.touched[: wave.counters[TOUCHED]]
            pruning.mark_visited(self._mesh.topology, wave.vertices.distance, touched, visited)
            faces = np.flatnonzero(visited).astype(np.int32)
        windows = 0 if wave is None else int(wave.counters[CREATED])
        self.steps += (SearchStep(0, name, seconds, bound, windows, faces),)
        self._began = time.perf_counter()


class Leg(NamedTuple):
    """Ends, limits and control of a search."""

    start: End
    end: End
    limit: float
    """Length of the longest path that is asked for, mesh units"""
    slack: float
    """Relative amount by which it looks beyond its bounds; infinite where it is not to have any"""
    control: Control
    log: SearchLog

    @property
    def longest(self) -> float:
        """Length above which a path is beyond the limit however it is rounded."""
        return self.limit * (1.0 + AT_LIMIT)

    @property
    def straight(self) -> float:
        """Lower bound of the distance of its ends: as the crow flies, where that is one."""
        return float(np.linalg.norm(self.start.position - self.end.position))

    def bound(self, upper: float) -> float:
        """Return how far to look where a path of length ``upper`` is known.

        Beyond the limit by more than slivers round: a path that is missed is longer than the limit.
        """
        return min(upper, self.limit * (1.0 + STRAIGHT))

    def loosened(self, length: float) -> float:
        """Return a length with the slack: where that is infinite, even if the length is 0.

        Ends in one place may have a path of length 0, and a distance that is rounded.
        """
        return length * (1.0 + self.slack) if self.slack < math.inf else math.inf

    def missed(self, how: str, upper: float) -> NoPath | InternalError:
        """Return the error of not having reached the end, though a path so long leads there."""
        return self.lost(how) if self.bound(upper) == upper else self.beyond()

    def beyond(self) -> NoPath:
        """Return the error of a path that is longer than the limit."""
        return NoPath(
            f"{self.end.point} is farther than {self.limit:g} from {self.start.point}",
            "beyond_max_distance",
        )

    def lost(self, how: str) -> InternalError:
        """Return the error of not having reached the end."""
        return InternalError(
            f"{self.end.point} was not reached {how} from {self.start.point}, though the two are "
            f"connected; please report this mesh"
        )

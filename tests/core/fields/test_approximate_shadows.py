"""Vertices that are lit from several sides: what they emit, and what they add as they see more."""

import math

import numpy as np
import pytest

from geodesic_core.kernels.front.bounds import merging_bounds
from geodesic_core.kernels.front.counters import HEAP_SIZE
from geodesic_core.kernels.front.relaxation import bound_vertex, illuminate_vertex
from geodesic_core.kernels.front.state import LIT_FROM, LIT_TO, SETTLED, new_wavefront, view_of
from geodesic_core.kernels.front.window import B0, B1, SX, SY
from geodesic_core.kernels.jit import kernel
from geodesic_core.kernels.mesh.half_edges import COS_LEFT, LENGTH_LEFT, SIN_LEFT, following
from geodesic_core.kernels.sweep.pseudosources import emit_shadows
from geodesic_core.tolerances import SECTOR_MARGIN
from tests.support import zoo
from tests.support.invariants import windows_of
from tests.support.stepping import topology_of, view_of_arrays

pytestmark = pytest.mark.plain

ANGLES = 1e-6
"""Radians: some widenings by SECTOR_MARGIN."""
SADDLE = zoo.Case("saddle", *zoo.cone(8, 0.9, zigzag=True, splits=1)[:2])
REFLEX = zoo.Case(
    "reflex", *zoo.subdivide(zoo.SMALL["open_fan"].vertices, zoo.SMALL["open_fan"].faces)
)
BOUNDS = merging_bounds(math.inf, 0.5, 9.0)


@kernel
def emit(topology, wave, bounds, v):
    """Through raw pointers: a vertex that emits asks the processor for the rows of its lists."""
    emit_shadows(view_of(topology, wave, bounds), v)


class Vertex:
    """Vertex 0 of a mesh, reached at distance 1 and done; nothing else is."""

    def __init__(self, case):
        self.topology = topology_of(case)
        self.wave = new_wavefront(self.topology, merges=True)
        self.view = view_of_arrays(self.topology, self.wave, BOUNDS)
        self.v = int(self.topology.inner_vertex[0])
        self.total = float(self.topology.total_angle[self.v])
        self.wave.vertices.distance[self.v] = self.wave.vertices.upper[self.v] = 1.0
        self.wave.vertices.status[self.v] = SETTLED

    def see(self, angle, distance=1.0):
        """A pseudosource in this direction of the unfolded fan."""
        geometry, first = self.topology.geometry, self.topology.first_corner
        here = slice(first[self.v], first[self.v + 1])
        starts = self.topology.corner_angles[here]
        place = int(np.searchsorted(starts, angle, side="right")) - 1
        via = int(following(self.topology.corners[here][place]))
        apex = geometry[via, LENGTH_LEFT] * geometry[via, [COS_LEFT, SIN_LEFT]]
        turn = angle - starts[place]
        toward_tail = complex(*-apex)
        s = complex(*apex) + 9 * toward_tail * complex(math.cos(turn), math.sin(turn))
        illuminate_vertex(self.view, self.v, distance, via, s.real, s.imag, 1.0)

    def lit(self) -> tuple[float, float]:
        lo, hi = self.wave.vertices.light[self.v, [LIT_FROM, LIT_TO]]
        return float(lo), float(hi)

    def emitted(self) -> float:
        """The angle that all windows of the vertex take up, once it has emitted."""
        emit(self.topology, self.wave, BOUNDS, self.v)
        b0, b1, sx, sy = windows_of(self.wave).rows[:, [B0, B1, SX, SY]].T
        return float((np.arctan2(b1 - sx, -sy) - np.arctan2(b0 - sx, -sy)).sum())

    def shadow(self) -> float:
        """What lies behind the directions that are lit."""
        lo, hi = self.lit()
        return min(self.total - 2 * math.pi + hi - lo, self.total)

    def shadow_at_boundary(self) -> float:
        lo, hi = self.lit()
        return max(self.total - lo - math.pi, 0.0) + max(hi - math.pi, 0.0)


@pytest.mark.parametrize("angles", [(2.0,), (2.0, 2.5), (2.5, 2.0), (2.0, 1.7, 2.2), (0.1, 15.0)])
def test_what_is_lit_is_a_range_and_the_rest_is_behind_it(angles):
    vertex = Vertex(SADDLE)
    for angle in angles:
        vertex.see(angle)
    lo, hi = vertex.lit()
    if angles == (0.1, 15.0):  # the shorter way round, over the seam of the fan
        assert (lo, hi) == pytest.approx((15.0 - vertex.total, 0.1))
    else:
        assert (lo, hi) == pytest.approx((min(angles), max(angles)))
    assert vertex.emitted() == pytest.approx(vertex.shadow(), abs=ANGLES)


@pytest.mark.parametrize("more", [1.6, 2.7, 7.0])
@pytest.mark.parametrize(
    ("case", "shadow"), [(SADDLE, Vertex.shadow), (REFLEX, Vertex.shadow_at_boundary)]
)
def test_what_is_seen_later_is_added_and_no_more(case, shadow, more):
    vertex = Vertex(case)
    more = min(more, vertex.total - 0.05)
    vertex.see(2.0)
    vertex.see(2.2)
    before = vertex.emitted()
    assert before == pytest.approx(shadow(vertex), abs=ANGLES)
    assert vertex.emitted() == pytest.approx(before, abs=10 * SECTOR_MARGIN)
    vertex.wave.counters[HEAP_SIZE] = 0
    vertex.wave.queues.heap_place[:] = -1
    vertex.see(more)
    assert vertex.wave.queues.heap[: vertex.wave.counters[HEAP_SIZE]].tolist() == [vertex.v]
    assert vertex.emitted() == pytest.approx(shadow(vertex), abs=ANGLES)


def test_what_is_seen_again_changes_nothing():
    vertex = Vertex(SADDLE)
    for angle in (2.0, 2.4):
        vertex.see(angle)
    vertex.wave.counters[HEAP_SIZE] = 0
    seen = vertex.lit()
    for angle in (2.0, 2.1, 2.4 - 1e-12):
        vertex.see(angle)
    assert vertex.lit() == seen
    assert vertex.wave.counters[HEAP_SIZE] == 0


def test_what_comes_too_late_for_a_shortest_path_lights_nothing():
    vertex = Vertex(SADDLE)
    vertex.see(2.0)
    vertex.see(3.0, distance=1.0 + 1e-6)
    assert vertex.lit() == pytest.approx((2.0, 2.0))
    bound_vertex(vertex.view, vertex.v, 0.9)  # a path so short is none of those that were seen
    lo, hi = vertex.lit()
    assert lo > hi
    vertex.see(2.5, distance=0.9)
    assert vertex.lit() == pytest.approx((2.5, 2.5))


def test_a_vertex_that_comes_nearer_emits_anew():
    vertex = Vertex(SADDLE)
    vertex.see(2.0)
    before = vertex.emitted()
    vertex.wave.vertices.distance[vertex.v] = 0.5
    assert vertex.emitted() == pytest.approx(2 * before, abs=ANGLES)

"""Pseudosources and pieces of curves: what they send over the edges before them."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.fields.sources import nodes_of
from geodesic_core.kernels.front.bounds import exact_bounds, with_parallel_windows
from geodesic_core.kernels.front.counters import FRESH
from geodesic_core.kernels.front.state import new_wavefront
from geodesic_core.kernels.front.window import B0, B1, ROOT, SX, SY
from geodesic_core.kernels.sweep import continuous_dijkstra
from geodesic_core.tolerances import FLAT, SECTOR_MARGIN, SLANT
from tests.support import zoo
from tests.support.invariants import windows_of
from tests.support.stepping import started, steps, topology_of


def test_sector_margin_is_all_that_a_shadow_is_widened_by():
    vertices, faces, _, total = zoo.cone(12, 0.8, zigzag=True, splits=1)
    shadow = total - 2 * math.pi
    topology = topology_of(zoo.Case("saddle", vertices, faces))
    assert lit_by(topology, 1, 0) == pytest.approx(
        shadow + 2 * SECTOR_MARGIN, abs=0.01 * SECTOR_MARGIN
    )


def lit_by(topology, source, vertex) -> float:
    """The angle into which a vertex emits windows."""
    lit, v = 0.0, topology.inner_vertex[vertex]
    for _, wave in steps(topology, started(topology, source)):
        windows = windows_of(wave)
        lit = max(lit, angles(windows.rows[windows.root == v]).sum())
    return lit


def angles(rows) -> np.ndarray:
    """The angle that each window takes up as seen from its pseudosource."""
    b0, b1, sx, sy = rows[:, [B0, B1, SX, SY]].T
    return np.arctan2(b1 - sx, -sy) - np.arctan2(b0 - sx, -sy)


@zoo.each_scale
def test_flat_faces_send_light_from_their_middle(scale):
    """Round the middle vertex of a face of no area, and on over its longest edge."""
    vertices = [(-1, 1, 0), (-1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 3, 0), (1, 2, 0)]
    faces = [(3, 0, 1), (3, 1, 2), (4, 3, 2), (4, 2, 5), (2, 6, 5)]
    field = gc.exact_distance(gc.TriangleMesh(scale * np.array(vertices, float), faces), 0)
    assert field.distances[6] == pytest.approx(scale * (1 + math.sqrt(2)), rel=10 * FLAT)


@zoo.each_scale
@pytest.mark.parametrize(("slope", "strips"), [(0.5, 2), (2.0, 3)])
def test_slant_is_the_flattest_ray_that_a_piece_sends_over_an_edge(scale, slope, strips):
    """A piece that stands on the edge between two cells; those above are always lit by it."""
    points, faces = zoo.grid(2, 2)
    mesh = gc.TriangleMesh(points * scale, faces)
    foot, head = (
        scale * np.array(place) for place in ((0.5, 1, 0), (0.5 + slope * SLANT * 0.2, 1.2, 0))
    )
    line = tuple(mesh.locate(place) for place in (foot, head))
    nodes = nodes_of(mesh, [line], [], gc.Control())
    wave = new_wavefront(mesh.topology, nodes.sites)
    bounds = with_parallel_windows(exact_bounds(math.inf), int(nodes.sources[-1]))
    continuous_dijkstra.start_sweep(
        mesh.topology, wave, nodes.sources, nodes.source_indices, np.zeros(1), bounds
    )
    roots = wave.pool.windows[: wave.counters[FRESH]].view(np.int32)[:, ROOT]
    assert (roots == nodes.sources[-1]).sum() == strips
    found = gc.exact_distance(mesh, gc.Curve(line)).distances
    share = np.clip((mesh.vertices - foot) @ (head - foot) / ((head - foot) @ (head - foot)), 0, 1)
    expected = np.linalg.norm(foot + share[:, None] * (head - foot) - mesh.vertices, axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0)

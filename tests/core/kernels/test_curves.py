"""Conics cut to half-planes, by points along them; and lines joined from crossings alone."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import geodesic_core as gc
from geodesic_core.kernels.curves.chains import (
    Chains,
    link_crossing_chains,
    room_for_chains,
    with_chain,
)
from geodesic_core.kernels.curves.clipping import (
    ALL,
    INTERVALS,
    clip_to_half_plane,
    hide,
    left_over,
)
from geodesic_core.kernels.curves.conics import (
    CURVE,
    TURN,
    K,
    chord_of,
    point_on,
    whole_range,
)
from geodesic_core.kernels.curves.crossings import (
    crossings_around,
    number_crossings,
    put_crossing,
)
from geodesic_core.kernels.curves.joining import join, put_crossings, room_for_ends
from geodesic_core.kernels.curves.line_points import locate_lines
from geodesic_core.kernels.curves.regions import SIDES_END, put_band, put_disc
from geodesic_core.kernels.isolines.arcs import is_apart
from geodesic_core.kernels.mesh.half_edges import HEAD, LENGTH, OPPOSITE, TAIL
from tests.conftest import WITHOUT_JIT

pytestmark = pytest.mark.skipif(not WITHOUT_JIT, reason="many small kernels to compile")

NUMBERS = st.floats(-2.0, 2.0)
ANGLES = st.floats(-math.pi, math.pi)


def circle(x: float, y: float, radius: float) -> np.ndarray:
    curve = np.zeros(CURVE)
    put_disc(curve, x, y, radius)
    return curve


@given(NUMBERS, NUMBERS, st.floats(0.1, 2.0), ANGLES)
def test_a_circle_is_a_conic(x, y, radius, angle):
    found = point_on(circle(x, y, radius), angle)
    expected = x + radius * math.cos(angle), y + radius * math.sin(angle)
    assert found == pytest.approx(expected, abs=1e-15)


@given(st.floats(0.1, 2.0), NUMBERS, NUMBERS, NUMBERS, ANGLES)
def test_a_conic_is_cut_to_where_its_points_are(k, gx, gy, depth, angle):
    curve = np.array([0.3, -0.2, 0.7, k, gx, gy])
    nx, ny = math.cos(angle), math.sin(angle)
    intervals = np.zeros((INTERVALS, 2))
    first, last = whole_range(curve, gc.samples.plane(2).topology.geometry, 0)
    intervals[0] = first, last
    count = clip_to_half_plane(intervals, 1, curve, depth, nx, ny)
    for parameter in np.linspace(first, last, 41)[1:-1]:
        x, y = point_on(curve, parameter)
        inside = depth + nx * (x - curve[0]) + ny * (y - curve[1])
        kept = any(lo <= parameter <= hi for lo, hi in intervals[:count])
        assert kept == (inside > 0.0) or abs(inside) < 1e-9 * (1.0 + abs(x) + abs(y))


@pytest.mark.parametrize(("gx", "width"), [(0.0, 1.0), (0.0, 5.0), (0.5, 0.4), (-0.5, 0.4)])
def test_no_point_of_an_arc_strays_farther_than_its_sagitta(gx, width):
    curve = circle(0.0, 0.0, 1.0)
    curve[K:] = 1.0, gx, 0.0
    x0, y0, x1, y1, sagitta = chord_of(curve, 0.2, 0.2 + width)
    ex, ey = np.array([x1 - x0, y1 - y0]) / math.hypot(x1 - x0, y1 - y0)
    points = [point_on(curve, 0.2 + t * width) for t in np.linspace(0.0, 1.0, 51)]
    strayed = max(abs(ex * (y - y0) - ey * (x - x0)) for x, y in points)
    assert strayed <= sagitta * (1 + 1e-12)
    if gx == 0.0 and width < math.pi:
        assert strayed == pytest.approx(sagitta, rel=1e-12)


@given(NUMBERS, NUMBERS, ANGLES, st.floats(0.1, 2.0), ANGLES, st.floats(0.1, 3.0), st.booleans())
@example(0.0, -3.0, 0.0, 1.0, 0.0, 1.0, True)
@example(0.0, 0.0, -math.pi / 4, 2.0, -math.pi / 4 - 0.3, 0.6, True)  # into the band
@example(1.4, -1.4, -math.pi / 4, 2.0, 3 * math.pi / 4 - 0.3, 0.6, True)  # out of it
def test_an_arc_that_is_surely_apart_has_no_point_in_the_region(
    x, y, turn, size, start, width, is_band
):
    """An arc of a circle around (x, y), of radius 1; a band from (0, 0) along a ray, or a disc."""
    arc, region = circle(x, y, 1.0), np.zeros(SIDES_END)
    ex, ey = math.cos(turn), math.sin(turn)
    if is_band:
        put_band(region, 0.0, 0.0, ex, ey, size)
    else:
        put_disc(region, 0.0, 0.0, size)
    px, py = np.array([point_on(arc, start + t * width) for t in np.linspace(0.0, 1.0, 51)]).T
    along, depth = ex * px + ey * py, ex * py - ey * px
    if is_band:
        is_within = (depth > 1e-9) & (along > 1e-9) & (along < size - 1e-9)
    else:
        is_within = np.hypot(px, py) < size - 1e-9
    is_surely_apart = is_apart(chord_of(arc, start, start + width), 0.5 * width, region, 0.0)
    assert not (is_surely_apart and is_within.any())
    if is_band and depth.max() < -1.0 - width:
        assert is_surely_apart


def test_what_is_hidden_leaves_the_rest():
    hidden, count = np.zeros((1, 2)), 0
    for lo, hi in ((4.0, 5.0), (1.0, 2.0), (1.5, 3.0)):
        hidden, count = hide(hidden, count, np.array([[lo, hi]]), 1, 0.0, TURN)
    hidden, count = left_over(hidden, count, 0.0, TURN)
    assert hidden[:count].tolist() == [[0.0, 1.0], [3.0, 4.0], [5.0, TURN]]
    hidden, count = hide(hidden, 0, np.array([[0.0, TURN]]), 1, 0.0, TURN)
    assert count == ALL
    assert left_over(hidden, count, 0.0, TURN)[1] == 0


def lines_of_values(mesh: gc.TriangleMesh, values: np.ndarray, level: float):
    """The level set of values at inner vertices, straight in each face, by crossings alone."""
    topology, links = mesh.topology, mesh.topology.links
    faces = len(links) // 3
    row_of, nodes = np.arange(faces, dtype=np.int32), []
    for h in range(3 * faces):
        low, high = values[links[h, TAIL]], values[links[h, HEAD]]
        is_first = h < links[h, OPPOSITE] or links[h, OPPOSITE] < 0
        if is_first and (low <= level) != (high <= level):
            nodes.append((h, (level - low) / (high - low) * topology.geometry[h, LENGTH]))
    half_edges, positions = (np.array(column) for column in zip(*nodes, strict=True))
    crossings = number_crossings(links, row_of, faces, positions, half_edges.astype(np.int32))
    weights, chains, size = [], room_for_chains(1), 0
    for face in range(faces):
        around = crossings_around(topology.geometry, crossings, face, face)
        ends, starts = room_for_ends(2), room_for_ends(2)
        is_nearer = bool(values[links[3 * face, TAIL]] <= level)
        paired = put_crossings(around, is_nearer, ends, starts, 0)
        for i, j in enumerate(join(ends.places[:paired], starts.places[:paired])):
            for node in (ends.ids[i], starts.ids[j]):
                weights.append(np.empty((1, 3)))
                put_crossing(topology.geometry, crossings, node, face, weights[-1], 0)
            chains = with_chain(chains, size, 2, face, ends.ids[i], starts.ids[j])
            size += 1
    first = np.arange(0, len(weights) + 1, 2)
    found = Chains(np.concatenate(weights), first, chains.nodes[:size], chains.faces[:size])
    lines = link_crossing_chains(topology, crossings.half_edges, found, 0.0)
    return lines, locate_lines(mesh.embedding, mesh.faces, lines)[0].points + mesh.origin


def test_crossings_alone_are_joined_to_the_level_set_of_any_values():
    """On a square: a straight line across, and a closed one around its middle."""
    mesh = gc.samples.plane(200)
    positions = mesh.positions + mesh.origin
    lines, points = lines_of_values(mesh, positions[:, 0] + 0.3 * positions[:, 1], 0.42)
    assert lines.closed.tolist() == [0]
    assert (lines.faces >= 0).all()
    x, y, _ = points.T
    np.testing.assert_allclose(x + 0.3 * y, 0.42, atol=1e-15)
    assert np.ptp(y) == pytest.approx(1.0)
    around, points = lines_of_values(mesh, np.hypot(*(positions[:, :2].T - 0.52)), 0.3)
    assert around.closed.tolist() == [1]
    assert around.first.tolist() == [0, len(points)]
    assert np.hypot(*(points[:, :2].T - 0.52)) == pytest.approx(0.3, abs=0.02)

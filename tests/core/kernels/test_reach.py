"""Vertices reached by a window over the edge opposite to them."""

import math

import numpy as np
import pytest

from geodesic_core.kernels.front.window import B0, B1, ROOT, SIGMA, SX, SY
from geodesic_core.kernels.mesh.half_edges import (
    APEX,
    COS_LEFT,
    LENGTH,
    LENGTH_LEFT,
    ROW,
    SIN_LEFT,
    TAIL,
)
from geodesic_core.kernels.sweep.reach import reach_apex
from geodesic_core.tolerances import BEND, GAP, MISS
from tests.support import zoo
from tests.support.stepping import flat_view


@pytest.mark.plain
@zoo.each_scale
def test_bend_is_all_that_a_bent_path_is_surcharged(scale):
    view, wave, h = flat_view(scale)
    row = view.mesh.geometry[ROW * h : ROW * (h + 1)]
    ax, ay = row[LENGTH_LEFT] * row[COS_LEFT], row[LENGTH_LEFT] * row[SIN_LEFT]
    apex = view.mesh.links[ROW * h + APEX]
    wave.vertices.distance[apex] = math.inf
    length = row[LENGTH]
    lies_right = ax < 0.5 * length
    b0, b1 = (0.6 * length, 0.8 * length) if lies_right else (0.2 * length, 0.4 * length)
    sx, sy = 0.5 * (b0 + b1), -0.2 * scale
    end = b0 if lies_right else b1
    wave.pool.scratch[0, [B0, B1, SX, SY, SIGMA]] = b0, b1, sx, sy, 0.0
    wave.pool.scratch.view(np.int32)[0, ROOT] = view.mesh.links[ROW * h + TAIL]
    nearest, crossing, _ = reach_apex(view, h, 1, ax, ay)
    bent = math.hypot(sx - end, sy) + math.hypot(ax - end, ay)
    assert (nearest, crossing) == (0, end)
    assert bent < wave.vertices.distance[apex] <= bent * (1 + 2 * BEND)
    assert wave.vertices.distance[apex] == pytest.approx(bent * (1 + BEND), rel=2e-16)


@pytest.mark.plain
@zoo.each_scale
@pytest.mark.parametrize("share", [2 * GAP, 0.5 * MISS, 2 * MISS])
@pytest.mark.parametrize("nearer", [0, 1])
def test_miss_is_how_far_beside_a_vertex_a_nearer_window_may_end(scale, share, nearer):
    """Beside it there is the rest of a farther window, which covers the vertex."""
    view, wave, h = flat_view(scale)
    row = view.mesh.geometry[ROW * h : ROW * (h + 1)]
    ax, ay = row[LENGTH_LEFT] * row[COS_LEFT], row[LENGTH_LEFT] * row[SIN_LEFT]
    apex, length = view.mesh.links[ROW * h + APEX], row[LENGTH]
    wave.vertices.distance[apex] = math.inf
    sx, sy, farther = 0.5 * length, -0.2 * scale, 0.1 * scale
    to_apex = sx + (ax - sx) * sy / (sy - ay)
    ends = [0.1 * length, to_apex + (2 * nearer - 1) * share * length, 0.9 * length]
    for i in range(2):
        sigma = 0.0 if i == nearer else farther
        wave.pool.scratch[i, [B0, B1, SX, SY, SIGMA]] = ends[i], ends[i + 1], sx, sy, sigma
        wave.pool.scratch.view(np.int32)[i, ROOT] = view.mesh.links[ROW * h + TAIL]
    nearest, crossing, least = reach_apex(view, h, 2, ax, ay)
    straight = math.hypot(ax - sx, ay - sy)
    assert (nearest, crossing) == (1 - nearer, pytest.approx(to_apex, rel=1e-12))
    assert least == pytest.approx(straight + farther, rel=1e-15)
    expected = straight if share <= MISS else straight + farther
    assert wave.vertices.distance[apex] == pytest.approx(expected, rel=1e-12)

"""Outcomes of backtracing; paths themselves are checked in `tests/core/fields/test_paths.py`."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.fields.sweep import winners_of
from geodesic_core.kernels.front.relaxation import nearest_sources
from geodesic_core.kernels.front.state import ENTRY_EDGE, PREDECESSOR
from geodesic_core.kernels.mesh.half_edges import APEX, OPPOSITE
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import trace_path
from tests.support import zoo
from tests.support.stepping import finished, started, topology_of


def trace(topology, wave, target, room):
    nodes, faces = np.empty(room, np.int32), np.empty(room, np.int32)
    nearest = nearest_sources(
        wave.vertices.distance, wave.vertices.winner_ints, wave.vertices.source_index
    )
    winners = winners_of(wave, nearest)
    outcome, count = trace_path(
        topology,
        winners,
        target,
        nodes,
        np.empty(room),
        faces,
    )
    return outcome, nodes[:count], faces[: max(count - 1, 0)]


def solved(name, source):
    topology = topology_of(zoo.SMALL[name])
    return topology, finished(topology, started(topology, source))


@pytest.mark.parametrize("name", ["jittered_grid", "comb", "crumpled_torus"])
def test_too_little_room_is_an_outcome_and_enough_is_enough(name):
    topology, wave = solved(name, 0)
    target = int(
        np.argmax(np.where(np.isfinite(wave.vertices.distance), wave.vertices.distance, -1))
    )
    outcome, nodes, faces = trace(topology, wave, target, 1000)
    assert outcome == Outcome.FINISHED
    assert len(nodes) > 4
    for room in range(1, len(nodes)):
        assert trace(topology, wave, target, room)[0] == Outcome.PATH_FULL
    again, same, crossed = trace(topology, wave, target, len(nodes))
    assert again == Outcome.FINISHED
    np.testing.assert_array_equal(same, nodes)
    np.testing.assert_array_equal(crossed, faces)


def broken(name):
    """A field in which one vertex claims to have been reached from outside, over the boundary."""
    topology, wave = solved(name, 0)
    h = int(np.flatnonzero(topology.links[:, OPPOSITE] < 0)[-1])
    v = int(topology.links[h, APEX])
    others = np.setdiff1d(np.arange(len(wave.vertices.distance)), topology.links[h])
    wave.vertices.winner_ints[v, ENTRY_EDGE], wave.vertices.winner_ints[v, PREDECESSOR] = (
        h,
        others[0],
    )
    wave.vertices.winner[v] = (0.1, -5.0)
    wave.vertices.distance[v] = 0.0  # nothing else lies on the way
    return topology, wave, v


def test_a_line_that_leaves_the_surface_is_lost():
    topology, wave, v = broken("jittered_grid")
    outcome, nodes, _ = trace(topology, wave, v, 100)
    assert outcome == Outcome.LOST
    assert nodes.tolist() == [-1 - v]


def test_a_lost_line_is_an_internal_error():
    case = zoo.SMALL["jittered_grid"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    field = gc.exact_distance(mesh, 0)
    _, wave, v = broken("jittered_grid")
    vertices = field._points.winners.get(Control()).vertices
    for name in ("winner", "winner_ints", "distance"):
        getattr(vertices, name)[:] = getattr(wave.vertices, name)
    with pytest.raises(gc.errors.InternalError, match="left the surface"):
        field.path_to(int(mesh.topology.outer_vertex[v]))


@pytest.mark.jit
@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_long_paths_get_more_room(scale):
    """More points than a path gets room for at first."""
    points, faces = zoo.grid(700, 1)
    mesh = gc.TriangleMesh(points * scale, faces)
    path = gc.exact_distance(mesh, 0).path_to(len(points) - 2)
    assert len(path.points) > 256
    end = np.linalg.norm(points[-2] - points[0])
    assert path.length == pytest.approx(scale * end, rel=1e-12)

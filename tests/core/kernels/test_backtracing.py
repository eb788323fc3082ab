"""Outcomes of backtracing; paths themselves are checked in `tests/core/fields/test_paths.py`."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.fields.sweep import winners_of
from geodesic_core.kernels.front.relaxation import nearest_sources
from geodesic_core.kernels.front.state import (
    ENTRY_EDGE,
    NO_MERGES,
    NO_SITES,
    PREDECESSOR,
    found,
    new_vertices,
)
from geodesic_core.kernels.mesh.half_edges import APEX, OPPOSITE
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.paths.backtracing import NO_END, Line, Winners, is_on_path, trace_path
from geodesic_core.tolerances import FORKS, ON_PATH, PATH_LENGTH, SAME_PLACE, TRIES
from tests.support import zoo
from tests.support.path_checks import check_path
from tests.support.searches import spread
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


def winners(distance, nearest=(0, 0)) -> Winners:
    """Two vertices at these distances from these sources."""
    vertices = new_vertices(len(distance))._replace(distance=distance)
    found_there = found(vertices._asdict())
    return Winners(np.array(nearest, np.int32), found_there, NO_MERGES, NO_SITES, NO_END)


@zoo.each_scale
def test_on_path_is_the_longest_detour_through_a_vertex(scale):
    target, beside = 0, 1
    here, reach = 2.0 * scale, 0.5 * scale
    for share, taken in ((-1.0, True), (0.0, True), (0.5, True), (2.0, False)):
        distance = scale * np.array([3.0, 0.0])
        distance[beside] = here - reach + share * ON_PATH * distance[target]
        line = Line(0, distance[target], 1.0, 0.0)
        assert is_on_path(winners(distance), beside, reach, here, line) == taken
        assert not is_on_path(winners(distance, [0, 1]), beside, reach, here, line)


def test_on_path_never_leads_away_from_the_source():
    line = Line(0, 1.0, 1.0, 0.0)
    assert not is_on_path(winners(np.array([1.0, 1.0])), 1, 0.0, 1.0, line)


@zoo.each_scale
@pytest.mark.parametrize("sign", [1, -1])
def test_path_length_is_the_most_that_a_path_may_differ_from_its_field(scale, sign):
    points, faces = zoo.grid(5, 4)
    field = gc.exact_distance(gc.TriangleMesh(points * scale, faces), gc.Source(0, scale))
    last = field.mesh.topology.inner_vertex[-1]
    honest = float(field.distances[-1])
    field._result.distance[last] = honest * (1 + 0.5 * sign * PATH_LENGTH)
    assert field.path_to(len(points) - 1).length == pytest.approx(honest - scale, rel=1e-14)
    field._result.distance[last] = honest * (1 + 2.0 * sign * PATH_LENGTH)
    with pytest.raises(gc.errors.InternalError, match="the field says"):
        field.path_to(len(points) - 1)


@zoo.each_scale
@pytest.mark.parametrize("name", ["book_of_5", "complex_1", "complex_4", "moebius"])
@pytest.mark.jit
def test_same_place_tells_the_face_that_a_path_came_from(name, scale):
    """Rounding stays below it, and what lies elsewhere above: every path has its distance."""
    case = zoo.IRREGULAR[name].moved(scale * zoo.rotation(5), scale * np.array((1.0, -2.0, 3.0)))
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    for source in spread(case, 7):
        field = gc.exact_distance(mesh, source)
        for target in np.flatnonzero(np.isfinite(field.distances)).tolist():
            path = field.path_to(target)
            check_path(mesh, path, source, target, field.distances[target])
            assert path.length == pytest.approx(field.distances[target], rel=SAME_PLACE, abs=0)


def strip_with_fins(count) -> gc.TriangleMesh:
    """A strip of squares, with a third face on each edge between two of them."""
    points, faces = zoo.grid(count, 1)
    x = np.arange(1.0, count)
    tips = np.stack([x, np.full_like(x, 0.5), np.ones_like(x)], axis=1)
    fins = [(i, len(points) + i - 1, count + 1 + i) for i in range(1, count)]
    return gc.TriangleMesh(np.vstack([points, tips]), [*np.asarray(faces).tolist(), *fins])


@pytest.mark.jit
def test_forks_are_enough_for_a_line_over_that_many_seams():
    mesh = strip_with_fins(FORKS)
    for source in (0, FORKS + 1):
        field = gc.exact_distance(mesh, source)
        target = 2 * FORKS + 1 if source == 0 else FORKS
        assert field.distances[target] == pytest.approx(math.hypot(FORKS, 1), rel=1e-12)
        check_path(mesh, field.path_to(target), source, target, field.distances[target])


def test_tries_end_a_line_that_leads_nowhere():
    """Its distance is claimed to be 0, so that each face is too far: all are tried in vain."""
    count = TRIES // 4
    mesh, target = strip_with_fins(count), 2 * count + 1
    field = gc.exact_distance(mesh, 0)
    winners, v = field._points.winners.get(Control()), int(mesh.topology.inner_vertex[target])
    winners.vertices.distance[v] = 0.0
    with pytest.raises(gc.errors.InternalError, match="left the surface"):
        field.path_to(target)

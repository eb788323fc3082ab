"""Lists that come up again and again: how often they may, and what happens then."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.control import Control
from geodesic_core.fields import fast_sweep
from geodesic_core.kernels.front import state
from geodesic_core.kernels.front.state import new_wavefront
from geodesic_core.search.landmarks import Landmarks
from geodesic_core.tolerances import MOST_RUNS, RUNS, SHARP
from tests.support import zoo
from tests.support.stepping import topology_of


@pytest.fixture
def worn_out(monkeypatch):
    """Every list of a merging sweep has used up its runs."""

    def new_worn_out_wavefront(*args, **kwargs):
        wave = new_wavefront(*args, **kwargs)
        wave.pool.runs[:] = RUNS
        return wave

    monkeypatch.setattr(state, "new_wavefront", new_worn_out_wavefront)


def test_runs_are_more_than_winding_about_a_tip_takes():
    """The sharpest tip without a crossing history: half as often again, and it can be counted."""
    topology = topology_of(zoo.Case("flat", *zoo.grid(2, 2)))
    counted = np.iinfo(new_wavefront(topology, merges=True).pool.runs.dtype).max
    assert 1.5 * 2 * math.pi / SHARP < RUNS < counted


@pytest.mark.parametrize("left", [0, 100])
def test_most_runs_are_what_a_list_may_come_up(monkeypatch, left):
    """Far more than about the sharpest tip; else the sweep ends, and names a face."""
    mesh = gc.samples.knot(500)
    assert 10 * 2 * math.pi / SHARP < MOST_RUNS < np.iinfo(np.uint16).max
    expected = gc.exact_distance(mesh, 3).distances

    def new_used_wavefront(*args, **kwargs):
        wave = new_wavefront(*args, **kwargs)
        wave.pool.runs[:] = MOST_RUNS - left
        return wave

    monkeypatch.setattr(state, "new_wavefront", new_used_wavefront)
    if left:
        assert gc.exact_distance(mesh, 3).distances.tobytes() == expected.tobytes()
    else:
        with pytest.raises(gc.errors.InternalError, match=r"circles through face \d+; .*fast_dist"):
            gc.exact_distance(mesh, 3)


@pytest.mark.usefixtures("worn_out")
def test_rows_whose_runs_are_used_up_begin_anew_exactly():
    """The first of them: it leaves memory as new to the next."""
    mesh = gc.samples.knot(500)
    points = [3, gc.SurfacePoint.face(50, (0.2, 0.3, 0.5)), 200]
    shares = []
    for limit in (None, 0.3 * mesh.diagonal):
        ask = {"max_distance": limit, "threads": 1}
        shares.clear()
        table = gc.distance_matrix(
            mesh, points, points[:2], method="approximate", progress=shares.append, **ask
        )
        exact = gc.distance_matrix(mesh, points, points[:2], **ask)
        assert table[:, 0].tobytes() == exact[:, 0].tobytes()
        near = np.isfinite(exact[:, 1])
        np.testing.assert_allclose(table[near, 1], exact[near, 1], rtol=1e-3)
        assert shares == sorted(shares)


@pytest.mark.jit
def test_rows_of_a_sweep_that_does_not_end_are_an_error(monkeypatch):
    mesh = gc.samples.knot(500)

    def new_used_wavefront(*args, **kwargs):
        wave = new_wavefront(*args, **kwargs)
        wave.pool.runs[:] = MOST_RUNS
        return wave

    with monkeypatch.context() as patch:
        patch.setattr(state, "new_wavefront", new_used_wavefront)
        with pytest.raises(gc.errors.InternalError, match=r"circles through face \d+"):
            gc.distance_matrix(mesh, [3], [5, 200])
    monkeypatch.setattr(fast_sweep, "MOST_CROSSINGS", 0)
    with pytest.raises(gc.errors.InternalError, match="its windows go in circles"):
        gc.distance_matrix(gc.samples.sphere(20_000), [3], [5, 200], method="fast")


@pytest.mark.usefixtures("worn_out")
def test_a_sweep_whose_runs_are_used_up_begins_anew_exactly():
    """With all that was asked for: paths, windows, targets, curves; progress does not go back."""
    mesh = gc.samples.knot(500)
    sources = [3, gc.SurfacePoint.face(50, (0.2, 0.3, 0.5)), gc.Curve(mesh.faces[100, :2].tolist())]
    target = gc.SurfacePoint.face(200, (0.5, 0.25, 0.25))
    shares = []
    found = gc.approximate_distance(
        mesh, sources, 1e-3, targets=[target], retain="windows", progress=shares.append
    )
    exact = gc.exact_distance(mesh, sources, targets=[target], retain="windows")
    assert shares == sorted(shares)
    assert found.distances.tobytes() == exact.distances.tobytes()
    assert found.nearest_source.tobytes() == exact.nearest_source.tobytes()
    assert found.distance_at(target) == exact.distance_at(target)
    for end in (target, 17, 200):
        path, expected = found.path_to(end), exact.path_to(end)
        np.testing.assert_array_equal(path.points, expected.points)
        assert path.error_bound.value < 1e-12
    levels = exact.levels(3)
    for lines, others in zip(found.isolines(levels), exact.isolines(levels), strict=True):
        for line, other in zip(lines, others, strict=True):
            np.testing.assert_array_equal(line.points, other.points)


@pytest.mark.jit
@pytest.mark.usefixtures("worn_out")
def test_searches_whose_runs_are_used_up_find_the_shortest_path():
    mesh = gc.samples.knot(500)
    exact = gc.exact_distance(mesh, 3)
    solver = gc.Solver(mesh)
    for target in [*range(10, 250, 24), 10]:
        assert solver.shortest_path(3, target).length == pytest.approx(
            exact.distances[target], rel=1e-12
        )
    landmarks = Landmarks(mesh)
    landmarks.add(0, Control())
    stored = landmarks.distances[:, 0]
    place = int(mesh.topology.outer_vertex[stored.argmin()])
    expected = gc.exact_distance(mesh, place).distances[mesh.topology.outer_vertex]
    np.testing.assert_allclose(stored, expected, rtol=1e-7)

"""Two loops for each handle: how many, how long, and that they take the handle out."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import glued, zoo
from tests.support.straightness import worst_bend


def test_a_flat_torus_has_its_two_shortest_lattice_vectors():
    mesh = glued.flat_torus(9, 7, (3.0, 0.0), (0.7, 2.0))
    lengths = [loop.length for loop in gc.handle_loops(mesh)]
    assert lengths == pytest.approx([np.hypot(0.7, 2.0), 3.0], rel=1e-12)


@pytest.mark.jit
def test_a_torus_has_a_belt_and_the_rim_of_its_hole():
    mesh = gc.TriangleMesh(*zoo.torus(60, 40))
    belt, rim = gc.handle_loops(mesh)
    assert belt.length == pytest.approx(2 * np.pi, rel=5e-3)
    assert rim.length == pytest.approx(2 * np.pi, rel=5e-3)
    assert worst_bend(belt) < 1e-6
    assert worst_bend(rim) < 1e-6


@pytest.mark.jit
@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "handles"),
    [
        (lambda: glued.double_torus()[0], 2),
        (lambda: gc.samples.knot(2000), 1),
        (
            lambda: gc.TriangleMesh(
                zoo.SMALL["double_frame"].vertices, zoo.SMALL["double_frame"].faces
            ),
            2,
        ),
        (lambda: gc.TriangleMesh(*zoo.joined(zoo.torus(12, 8), zoo.torus(9, 7))), 2),
    ],
    ids=["two tori joined", "knot", "frame", "two tori apart"],
)
def test_cut_along_them_no_handle_is_left(make, handles):
    mesh = make()
    loops = gc.handle_loops(mesh)
    assert len(loops) == 2 * handles
    assert [loop.length for loop in loops] == sorted(loop.length for loop in loops)
    cut = gc.cut(mesh, loops).mesh
    assert gc.handle_loops(cut) == []


@pytest.mark.jit
@pytest.mark.parametrize("name", ["sphere", "plane", "obstacles", "terrain"])
def test_holes_are_no_handles(name):
    assert gc.handle_loops(getattr(gc.samples, name)(2000)) == []


@pytest.mark.jit
def test_holes_in_a_torus_change_no_handle():
    mesh = gc.TriangleMesh(*zoo.torus(30, 20))
    x, y, _ = mesh.vertices[mesh.faces].mean(axis=1).T
    holed = mesh.with_barriers(np.flatnonzero((x > 2.9) & (np.abs(y) < 0.5) | (x < -2.9)))
    for loop, other in zip(gc.handle_loops(mesh), gc.handle_loops(holed), strict=True):
        assert other.length == pytest.approx(loop.length, rel=0.05)

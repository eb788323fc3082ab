"""Several positions at once, and places above the plane."""

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.tolerances import SAME_HEIGHT


def hills(size: int = 200) -> gc.TriangleMesh:
    plane = gc.samples.plane(size)
    x, y, _ = plane.vertices.T
    return gc.TriangleMesh(np.stack([x, y, 0.3 * np.sin(9 * x) * y], axis=1), plane.faces)


def test_several_positions_are_located_as_one_after_the_other() -> None:
    mesh = gc.samples.knot(500)
    positions = np.random.default_rng(1).normal(size=(20, 3))
    assert mesh.locate(positions) == [mesh.locate(position) for position in positions]
    assert mesh.locate(np.empty((0, 3))) == []
    with pytest.raises(InvalidPoint, match="away from the position 3"):
        mesh.locate(positions + np.eye(20)[3][:, None] * 100.0, max_distance=50.0)
    with pytest.raises(InvalidPoint, match=r"position 1 is .*three finite numbers"):
        mesh.locate([[0, 0, 0], [0, np.nan, 0]])


def test_places_in_the_plane_are_below_their_points() -> None:
    mesh = hills()
    places = np.random.default_rng(2).uniform(0.0, 1.0, (50, 2))
    found = mesh.locate_xy(places)
    for place, point in zip(places, found, strict=True):
        np.testing.assert_allclose(mesh.position(point)[:2], place, atol=1e-12)
    assert mesh.locate_xy(places[0]) == found[0]
    assert mesh.locate_xy(mesh.vertices[:, :2]) == [
        mesh.point(v) for v in range(len(mesh.vertices))
    ]


def test_far_from_the_origin_as_well() -> None:
    mesh = hills()
    far = gc.TriangleMesh(mesh.vertices * 1000.0 + [4.5e5, 5.2e6, 0.0], mesh.faces)
    place = np.array([4.5e5 + 312.5, 5.2e6 + 41.25])
    np.testing.assert_allclose(far.position(far.locate_xy(place))[:2], place, atol=1e-8)


def test_the_surface_may_not_be_there() -> None:
    with pytest.raises(InvalidPoint, match=r"not above or below the place 1, \[1.5, 0.5\]"):
        hills().locate_xy([[0.5, 0.5], [1.5, 0.5]])


def test_upright_and_turned_faces_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="not a height over the plane: face"):
        gc.samples.sphere(80).locate_xy([0.0, 0.0])
    wall = gc.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0]], [[0, 1, 3], [0, 1, 2]])
    with pytest.raises(InvalidArgument, match="face 1 is upright"):
        wall.locate_xy([0.1, 0.1])


def sheets(apart: float) -> gc.TriangleMesh:
    plane = gc.samples.plane(8)
    above = plane.vertices + np.array([0.3, 0.0, apart])
    faces = np.vstack([plane.faces, plane.faces + len(above)])
    return gc.TriangleMesh(np.vstack([plane.vertices, above]), faces)


def test_same_height() -> None:
    """Sheets one above the other are refused where both are, however near they are."""
    size = 1.3
    mesh = sheets(4.0 * SAME_HEIGHT * size)
    with pytest.raises(InvalidArgument, match="has the heights"):
        mesh.locate_xy([0.5, 0.4])
    assert mesh.position(mesh.locate_xy([0.1, 0.4]))[2] == 0.0
    mesh = sheets(0.25 * SAME_HEIGHT * size)
    assert abs(mesh.position(mesh.locate_xy([0.5, 0.4]))[2]) <= SAME_HEIGHT * size


@pytest.mark.parametrize("places", [[0.0], [0, 0, 0], "xy", [[0, np.inf]], [[[0, 0]]], None])
def test_other_places_are_refused(places: object) -> None:
    with pytest.raises(InvalidPoint, match="two finite numbers"):
        hills(8).locate_xy(places)  # type: ignore[call-overload]

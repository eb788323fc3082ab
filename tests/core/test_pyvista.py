"""Meshes, fields and paths for trimesh and PyVista: the same numbers, and pictures of them."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pyvista import PolyData, registered_accessors

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidMesh, InvalidPoint

pytestmark = pytest.mark.file_slice(4)

MESH = gc.samples.sphere(320)
FIELD = gc.exact_distance(MESH, [0, 3], max_distance=1.5)
PATH = gc.shortest_path(MESH, 0, 9)
VALUES = gc.ScalarField(MESH, MESH.vertices[:, 2])


def test_meshes_go_there_and_back() -> None:
    for other in (MESH.to_trimesh(), MESH.to_pyvista()):
        again = gc.as_mesh(other)
        assert again.vertices.tolist() == MESH.vertices.tolist()
        assert again.faces.tolist() == MESH.faces.tolist()


def test_what_others_do_with_their_mesh_leaves_this_one_alone() -> None:
    MESH.to_trimesh().apply_scale(2.0)
    MESH.to_pyvista().points[:] = 0.0
    assert np.linalg.norm(MESH.vertices, axis=1) == pytest.approx(1.0)


def test_a_field_has_its_distances_at_the_points() -> None:
    surface = FIELD.to_pyvista()
    assert surface.active_scalars_name == "distance"
    assert surface.point_data["distance"].tolist() == FIELD.distances.tolist()
    assert surface.point_data["nearest_source"].tolist() == FIELD.nearest_source.tolist()
    assert surface.regular_faces.tolist() == MESH.faces.tolist()


def test_a_path_is_one_line() -> None:
    line = PATH.to_pyvista()
    assert line.points.tolist() == PATH.points.tolist()
    assert (line.n_lines, line.length) == (1, pytest.approx(line.length))
    assert line.field_data["length"].tolist() == [PATH.length]
    assert line.compute_cell_sizes()["Length"][0] == pytest.approx(PATH.length)
    point = gc.shortest_path(MESH, 5, 5).to_pyvista()
    assert (point.n_points, point.n_lines) == (1, 0)


def colours(file: Path) -> int:
    return len(np.unique(np.asarray(Image.open(file).convert("RGB")).reshape(-1, 3), axis=0))


@pytest.mark.parametrize(
    "thing", [FIELD, PATH, FIELD.mesh, VALUES], ids=["field", "path", "mesh", "values"]
)
@pytest.mark.jit
@pytest.mark.slow
def test_pictures_are_drawn_without_a_window(thing: Any, tmp_path: Path) -> None:
    file = tmp_path / "picture.png"
    assert thing.plot(save=file) is None
    assert colours(file) > 100
    thing.plot(save=str(tmp_path / "picture.JPG"), title="Here", camera="+z")
    assert colours(tmp_path / "picture.JPG") > 100


@pytest.mark.slow
@pytest.mark.jit
def test_a_path_that_lost_its_surface_is_drawn_alone(tmp_path: Path) -> None:
    copy.copy(PATH).plot(save=tmp_path / "path.png")
    assert colours(tmp_path / "path.png") > 1


def test_without_a_file_a_plotter_shows_what_was_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    show = lambda self: shown.append(list(self.actors.values()))  # noqa: E731
    monkeypatch.setattr("pyvista.Plotter.show", show)
    FIELD.plot()
    PATH.plot()
    field, path = shown
    assert (len(field), len(path)) == (3, 3)  # the colour bar of the field among them


@pytest.mark.parametrize(
    ("save", "message"),
    [
        ("picture.gif", "must end in .png, .jpg, .jpeg, .tif, .tiff or .bmp"),
        ("no/picture.png", "its folder does not exist"),
        (7, "it must be a string or a Path"),
    ],
)
def test_a_place_where_no_picture_can_be_written_is_refused(save: Any, message: str) -> None:
    for thing in (FIELD, PATH):
        with pytest.raises(InvalidArgument, match=message):
            thing.plot(save=save)


def test_meshes_of_pyvista_have_an_accessor() -> None:
    ball = MESH.to_pyvista()
    ball.point_data["mine"] = np.arange(ball.n_points)

    found = ball.geodesics.distance([0, 3], max_distance=1.5)

    assert found is not ball
    assert found.point_data["distance"].tolist() == FIELD.distances.tolist()
    assert found.point_data["nearest_source"].tolist() == FIELD.nearest_source.tolist()
    assert found.active_scalars_name == "distance"
    assert found.point_data["mine"].tolist() == list(range(ball.n_points))
    assert ball.point_data.keys() == ["mine"]
    line = ball.geodesics.path(0, 9)
    assert line.points.tolist() == PATH.points.tolist()
    by_way = ball.geodesics.path(0, 9, waypoints=30)
    assert by_way.field_data["length"][0] > PATH.length


def test_the_accessor_refuses_as_the_library_does() -> None:
    with pytest.raises(InvalidPoint, match="vertex 999"):
        MESH.to_pyvista().geodesics.distance(999)
    with pytest.raises(InvalidMesh, match="is not a surface"):
        PolyData(MESH.vertices.copy()).geodesics.path(0, 1)


def test_the_accessor_is_found_by_its_entry_point() -> None:
    found = {each.name: each for each in registered_accessors()}
    assert found["geodesics"].target is PolyData
    assert found["geodesics"].source.startswith("geodesic_core.")

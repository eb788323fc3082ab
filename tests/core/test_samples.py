"""The samples: sizes, orientation, and that they are what they say."""

import numpy as np
import pytest

from geodesic_core import samples
from geodesic_core.errors import InvalidArgument
from geodesic_core.mesh import TriangleMesh

EULER = {"knot": 0, "sphere": 2, "plane": 1}
BOUNDARIES = {"knot": 0, "sphere": 0, "plane": 1}


def test_the_registry_names_all_samples() -> None:
    for name, sample in samples.SAMPLES.items():
        assert sample is getattr(samples, name)


@pytest.mark.parametrize("faces", [500, 3_000, 20_000])
@pytest.mark.parametrize("name", samples.SAMPLES)
def test_a_sample_is_one_sound_mesh_of_about_the_asked_size(name: str, faces: int) -> None:
    vertices, triangles = samples.SAMPLES[name](faces)
    assert (vertices.dtype, triangles.dtype) == (np.float64, np.int32)
    assert len(triangles) == pytest.approx(faces, rel=0.08)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    report = TriangleMesh(vertices, triangles).report
    assert report.components == 1
    assert report.euler_characteristic == EULER[name]
    assert report.boundary_loops == BOUNDARIES[name]
    assert report.isolated_vertices.count == report.degenerate_faces.count == 0
    assert report.bow_tie_vertices.count == 0


def _volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(np.linalg.det(vertices[faces]).sum() / 6.0)


def test_the_sphere_is_the_unit_sphere_seen_from_outside() -> None:
    vertices, faces = samples.sphere(20_000)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0, atol=1e-15)
    assert _volume(vertices, faces) == pytest.approx(4.0 / 3.0 * np.pi, rel=1e-3)
    assert len(faces) == 20 * round(np.sqrt(1_000)) ** 2


def test_the_smallest_sphere_is_an_icosahedron() -> None:
    vertices, faces = samples.sphere(20)
    lengths = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=1e-14)
    assert (np.linalg.det(vertices[faces]) > 0).all()


def test_the_knot_is_a_tube_seen_from_outside() -> None:
    vertices, faces = samples.knot(20_000)
    length, radius = 31.9, 0.45
    assert _volume(vertices, faces) == pytest.approx(length * np.pi * radius**2, rel=0.02)
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    assert edges.max() < 4.0 * edges.min()


def test_the_plane_is_the_unit_square_seen_from_above() -> None:
    vertices, faces = samples.plane(2_000)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert 0.5 * normals[:, 2].sum() == pytest.approx(1.0)
    assert (vertices.min(axis=0) == [0, 0, 0]).all()
    assert (vertices.max(axis=0) == [1, 1, 0]).all()


@pytest.mark.parametrize(
    ("name", "faces"),
    [("knot", 499), ("sphere", 19), ("plane", 1), ("knot", -5), ("sphere", 0), ("plane", 10**9)],
)
def test_a_size_out_of_the_domain_is_refused(name: str, faces: int) -> None:
    with pytest.raises(InvalidArgument, match=f"faces is {faces}"):
        samples.SAMPLES[name](faces)

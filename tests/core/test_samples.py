"""The samples: sizes, orientation, and that they are what they say."""

from hashlib import blake2b
from itertools import combinations

import numpy as np
import pytest

from geodesic_core import samples, shortest_path
from geodesic_core.errors import InvalidArgument
from tests.conftest import WITHOUT_JIT

EULER = {"knot": 0, "sphere": 2, "terrain": 1, "cortex": 2, "obstacles": -15, "plane": 1}
BOUNDARIES = {"knot": 0, "sphere": 0, "terrain": 1, "cortex": 0, "obstacles": 17, "plane": 1}
FEWEST = {"knot": 500, "sphere": 20, "terrain": 200, "cortex": 500, "obstacles": 500, "plane": 2}


def test_the_registry_names_all_samples() -> None:
    for name, sample in samples.SAMPLES.items():
        assert sample is getattr(samples, name)


@pytest.mark.parametrize("faces", [500] if WITHOUT_JIT else [500, 3_000, 20_000])
@pytest.mark.parametrize("name", samples.SAMPLES)
def test_a_sample_is_one_sound_mesh_of_about_the_asked_size(name: str, faces: int) -> None:
    sample = samples.SAMPLES[name](faces)
    vertices, triangles = sample.vertices, sample.faces
    assert (vertices.dtype, triangles.dtype) == (np.float64, np.int32)
    assert len(triangles) == pytest.approx(faces, rel=0.08)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    report = sample.report
    assert report.components == 1
    assert report.euler_characteristic == EULER[name]
    assert report.boundary_loops == BOUNDARIES[name]
    assert report.isolated_vertices.count == report.degenerate_faces.count == 0
    assert report.bow_tie_vertices.count == 0


def _volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(np.linalg.det(vertices[faces]).sum() / 6.0)


@pytest.mark.jit
def test_the_sphere_is_the_unit_sphere_seen_from_outside() -> None:
    sample = samples.sphere(20_000)
    vertices, faces = sample.vertices, sample.faces
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0, atol=1e-15)
    assert _volume(vertices, faces) == pytest.approx(4.0 / 3.0 * np.pi, rel=1e-3)
    assert len(faces) == 20 * round(np.sqrt(1_000)) ** 2


def test_the_smallest_sphere_is_an_icosahedron() -> None:
    sample = samples.sphere(20)
    vertices, faces = sample.vertices, sample.faces
    lengths = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=1e-14)
    assert (np.linalg.det(vertices[faces]) > 0).all()


@pytest.mark.jit
def test_the_knot_is_a_tube_seen_from_outside() -> None:
    sample = samples.knot(20_000)
    vertices, faces = sample.vertices, sample.faces
    length, radius = 31.9, 0.45
    assert _volume(vertices, faces) == pytest.approx(length * np.pi * radius**2, rel=0.02)
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    assert edges.max() < 4.0 * edges.min()


@pytest.mark.jit
def test_the_plane_is_the_unit_square_seen_from_above() -> None:
    sample = samples.plane(2_000)
    vertices, faces = sample.vertices, sample.faces
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert 0.5 * normals[:, 2].sum() == pytest.approx(1.0)
    assert (vertices.min(axis=0) == [0, 0, 0]).all()
    assert (vertices.max(axis=0) == [1, 1, 0]).all()


@pytest.mark.parametrize(
    ("name", "faces"),
    [
        *((name, fewest - 1) for name, fewest in FEWEST.items()),
        *((name, 10**9) for name in FEWEST),
        ("knot", -5),
        ("sphere", 0),
    ],
)
def test_a_size_out_of_the_domain_is_refused(name: str, faces: int) -> None:
    words = f"faces is {faces}; this sample can have {FEWEST[name]} to 50000000 of them"
    with pytest.raises(InvalidArgument, match=words):
        samples.SAMPLES[name](faces)


@pytest.mark.slow
@pytest.mark.jit
@pytest.mark.parametrize("name", ["terrain", "obstacles"])
def test_any_size_from_the_fewest_on_is_a_sound_mesh(name: str) -> None:
    fewest = FEWEST[name]
    for faces in [*range(fewest, fewest + 40), *range(fewest + 40, 5_000, 171)]:
        sample = samples.SAMPLES[name](faces)
        assert len(sample.faces) == pytest.approx(faces, rel=0.12 if faces < 3_000 else 0.06)
        report = sample.report
        assert (report.components, report.euler_characteristic) == (1, EULER[name])
        assert report.degenerate_faces.count == report.misoriented_edges.count == 0


@pytest.mark.parametrize(
    ("name", "digest"),
    [("terrain", "9010b1031e37c932"), ("obstacles", "6a601e3abdb94262")],
)
def test_a_sample_made_by_arithmetic_is_the_same_to_the_bit_anywhere(
    name: str, digest: str
) -> None:
    sample = samples.SAMPLES[name](2_000)
    vertices, triangles = sample.vertices, sample.faces
    assert blake2b(vertices.tobytes() + triangles.tobytes(), digest_size=8).hexdigest() == digest


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.mark.parametrize("faces", [200, 3_000, 50_000])
def test_the_terrain_is_a_height_field_with_hills_and_valleys(faces: int) -> None:
    sample = samples.terrain(faces)
    vertices, triangles = sample.vertices, sample.faces
    normals = _normals(vertices, triangles)
    assert (normals[:, 2] > 0).all()
    assert 0.5 * normals[:, 2].sum() == pytest.approx(100.0)
    heights = vertices[:, 2]
    assert heights.min() == 0.0
    assert 1.0 < heights.max() < 4.0
    assert 0.2 < heights.std() < 1.0


@pytest.mark.jit
def test_the_terrain_s_faces_have_the_shorter_diagonals_of_their_cells() -> None:
    sample = samples.terrain(3_000)
    vertices, faces = sample.vertices, sample.faces
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    flat = np.linalg.norm(vertices[edges[:, 0], :2] - vertices[edges[:, 1], :2], axis=1)
    diagonals = np.unique(edges[flat > 1.2 * np.median(flat)], axis=0)
    width = int((vertices[:, 1] == 0).sum())
    assert len(diagonals) == len(faces) // 2
    for a, b in diagonals.tolist():
        other = {width + 1: (a + 1, b - 1), width - 1: (a - 1, b + 1)}[b - a]
        here, there = (abs(vertices[i, 2] - vertices[j, 2]) for i, j in ((a, b), other))
        assert here <= there


@pytest.mark.jit
def test_the_cortex_is_folded_and_flat_on_one_side_and_seen_from_outside() -> None:
    sample = samples.cortex(20_000)
    vertices, faces = sample.vertices, sample.faces
    assert _volume(vertices, faces) > 0
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert -low[0] < 0.7 * high[0]
    assert high[1] - low[1] == pytest.approx(2.5, abs=0.1)
    edges = vertices[faces] - np.roll(vertices[faces], 1, axis=1)
    area = float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2.0)
    half_axes = 0.5 * (high - low)
    ellipsoid = 4 * np.pi * np.mean([a * b for a, b in combinations(half_axes, 2)])
    assert area > 1.2 * ellipsoid, "a surface around the same room, without folds, has less"


def test_the_obstacles_are_seen_from_above() -> None:
    sample = samples.obstacles(1000)
    vertices, faces = sample.vertices, sample.faces
    assert (_normals(vertices, faces)[:, 2] > 0).all()
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    assert edges.max() < 40.0 * edges.min()


@pytest.mark.jit
def test_the_obstacles_have_holes_to_walk_around() -> None:
    sample = samples.obstacles(20_000)
    path = shortest_path(sample, *_ends(sample.vertices))
    straight = np.linalg.norm(path.points[0] - path.points[-1])
    assert path.length > 1.005 * straight


def _ends(vertices: np.ndarray) -> tuple[int, int]:
    corner = vertices[:, 0] + vertices[:, 1]
    return int(corner.argmin()), int(corner.argmax())

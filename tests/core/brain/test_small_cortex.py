"""A ball for each hemisphere, so small that all of it runs where kernels are plain Python."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc


@pytest.fixture(scope="module")
def cortex() -> gc.brain.Cortex:
    ball = gc.samples.sphere(20)
    other = gc.TriangleMesh(ball.vertices + np.array([3.0, 0.0, 0.0]), ball.faces)
    return gc.brain.load_cortex({"left": ball, "right": other})


@pytest.fixture(scope="module")
def table(cortex) -> np.ndarray:
    count = len(cortex.mesh.vertices)
    return np.array([gc.exact_distance(cortex.mesh, v).distances for v in range(count)])


def test_parcels(cortex, table, tmp_path):
    half = len(cortex.mesh.vertices) // 2
    keys = 1 + (np.arange(2 * half) % half >= 5) + 2 * (np.arange(2 * half) >= half)
    parcels = gc.brain.load_parcels(keys, cortex)
    found = gc.brain.parcel_distances(parcels, tmp_path / "out")
    blocks = [[table[np.ix_(keys == a, keys == b)] for b in range(1, 5)] for a in range(1, 5)]
    assert_allclose(found.mean, [[block.mean() for block in row] for row in blocks], rtol=1e-12)
    assert_array_equal(found.least, [[block.min() for block in row] for row in blocks])
    means = np.stack([table[:, keys == k].mean(axis=1) for k in range(1, 5)], axis=1)
    assert_allclose(found.vertex_mean, means, rtol=1e-6)
    own = means[np.arange(2 * half), keys - 1]
    nearest = [own[keys == k].min() for k in range(1, 5)]
    assert_allclose(own[found.centroids], nearest, rtol=1e-12)
    assert_array_equal(found.centroid, table[np.ix_(found.centroids, found.centroids)])
    read = gc.brain.load_matrix(tmp_path / "out" / "mean.pconn.nii")
    assert_array_equal(read.values, found.mean.astype(np.float32))
    assert read.rows == list(parcels.names)
    again = gc.brain.load_parcels(tmp_path / "out" / "parcels.dlabel.nii", cortex)
    assert_array_equal(again.parcel_of, parcels.parcel_of)


def test_matrices_with_their_ids(cortex, table, tmp_path):
    written = gc.brain.write_distances(cortex, tmp_path / "all.dconn.nii")
    read = gc.brain.load_matrix(written.path)
    assert_array_equal(read.values, table.astype(np.float32))
    half = len(table) // 2
    assert [name for name, _ in read.rows] == ["CortexLeft", "CortexRight"]
    assert_array_equal(read.rows[1][1], np.arange(half))
    assert read.facts["region"]["CortexRight"] == list(range(half))


def test_smoothing_is_a_gaussian_of_the_distance(cortex, table):
    """Sums of values by area stay, and no value passes to the other hemisphere."""
    values = np.zeros(len(table))
    values[3] = 1.0
    smoothed = gc.brain.smooth(cortex, values, fwhm=1.0)
    assert cortex.areas @ smoothed == pytest.approx(cortex.areas @ values, rel=1e-9)
    assert (smoothed[len(table) // 2 :] == 0.0).all()
    order = np.argsort(table[3][: len(table) // 2])
    assert smoothed[order[0]] == smoothed.max()


def stretched(mesh: gc.TriangleMesh, factor: float, *, is_placed: bool = True) -> gc.TriangleMesh:
    corners = mesh.vertices[mesh.faces]
    lengths = factor * np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    vertices = mesh.vertices if is_placed else None
    return gc.TriangleMesh.from_lengths(mesh.faces, lengths, vertices)


@pytest.mark.parametrize("is_placed", [True, False])
def test_both_hemispheres_keep_their_lengths_and_barriers(is_placed):
    ball = gc.samples.sphere(20)
    left = stretched(ball, 2.0, is_placed=is_placed).with_barriers([0, 1, 5])
    right = stretched(ball, 3.0, is_placed=is_placed).with_barriers([7])
    both = gc.brain.load_cortex({"left": left, "right": right})
    assert both.mesh.barriers.tolist() == [0, 1, 5, 27]
    for structure, mesh in zip(both.structures, (left, right), strict=True):
        found = gc.exact_distance(both.mesh, structure.first + 3).distances[structure.part]
        assert_array_equal(found, gc.exact_distance(mesh, 3).distances)
    with pytest.raises(gc.errors.InvalidMesh, match="give all in the same way"):
        gc.brain.load_cortex({"left": left, "right": ball})


def test_corrected_areas_stretch_the_lengths_that_a_surface_was_given():
    wide = stretched(gc.samples.sphere(20), 2.0, is_placed=False)
    areas = gc.brain.load_cortex({"left": wide}).areas
    cortex = gc.brain.load_cortex({"left": wide}, corrected_areas=4.0 * areas)
    assert_allclose(cortex.mesh.lengths, 2.0 * wide.lengths, rtol=1e-15)

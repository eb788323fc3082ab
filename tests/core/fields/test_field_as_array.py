"""A field in the place of an array is its distances."""

from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc

MESH = gc.samples.sphere(80)


@pytest.fixture(params=["solved", "loaded", "fast"])
def field(request: pytest.FixtureRequest, tmp_path: Path) -> gc.DistanceField:
    if request.param == "fast":
        return gc.fast_distance(MESH, 0)
    solved = gc.exact_distance(MESH, [0, 9], max_distance=1.0)
    if request.param == "solved":
        return solved
    solved.save(tmp_path / "field.npz")
    return gc.load_field(tmp_path / "field.npz", MESH)


@pytest.mark.jit
def test_numpy_takes_a_field_for_its_distances(field: gc.DistanceField) -> None:
    assert np.asarray(field) is field.distances
    assert np.asarray(field, copy=False) is field.distances
    copied = np.array(field)
    assert copied is not field.distances
    assert not np.shares_memory(copied, field.distances)
    np.testing.assert_array_equal(copied, field.distances)
    small = np.asarray(field, dtype=np.float32)
    assert small.dtype == np.float32
    np.testing.assert_array_equal(small, field.distances.astype(np.float32))
    with pytest.raises(ValueError, match="copy"):
        np.asarray(field, dtype=np.float32, copy=False)
    np.testing.assert_array_equal(np.minimum(field, 0.5), np.minimum(field.distances, 0.5))
    np.testing.assert_array_equal(np.stack([field, field])[1], field.distances)


@pytest.mark.jit
def test_a_field_is_indexed_as_its_distances(field: gc.DistanceField) -> None:
    distances = field.distances
    assert len(field) == len(MESH.vertices) == len(list(field))
    assert field[5] == distances[5] == field.distance_at(5)
    assert field[-1] == distances[-1]
    for part in (slice(2, 9, 3), [7, 3, 3], np.array([1, 0]), distances > 0.5, ...):
        np.testing.assert_array_equal(field[part], distances[part])
    with pytest.raises(IndexError):
        field[len(field)]
    assert field

"""Distances between parcels, against a dense matrix that numpy groups."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc
from geodesic_core.matrices import driver, group_rows, plan
from geodesic_core.matrices.formats import sha256_of
from tests.support.folded import parcel_keys

FILES = (
    "mean.pconn.nii",
    "least.pconn.nii",
    "centroid.pconn.nii",
    "vertex_mean.dpconn.nii",
    "vertex_mean.pdconn.nii",
    "areas.pscalar.nii",
    "parcels.dlabel.nii",
    "parcels.npz",
)


@pytest.fixture(scope="module")
def keys(surfaces) -> dict[str, np.ndarray]:
    return {side: parcel_keys(mesh) for side, mesh in surfaces.items()}


@pytest.fixture(scope="module")
def parcels(surfaces, masks, keys) -> gc.brain.Parcellation:
    cortex = gc.brain.load_cortex(surfaces, masks, "blocks")
    return gc.brain.load_parcels(keys, cortex)


@pytest.fixture(scope="module")
def table(parcels) -> np.ndarray:
    """Return all distances of the cortex, by a field for each vertex."""
    mesh = parcels.cortex.mesh
    rows = np.full((len(mesh.vertices), len(mesh.vertices)), math.inf)
    for vertex in parcels.cortex.region:
        rows[vertex] = gc.exact_distance(mesh, vertex).distances
    return rows


@pytest.fixture(scope="module")
def found(parcels, tmp_path_factory) -> tuple[gc.brain.ParcelDistances, Path]:
    out = tmp_path_factory.mktemp("parcels") / "here"
    return gc.brain.parcel_distances(parcels, out), out


@pytest.mark.jit
def test_means_least_and_centroids_are_those_of_a_dense_matrix(parcels, keys, table, found):
    result, _ = found
    left = len(keys["left"])
    groups = [np.flatnonzero(keys["left"] == key) for key in range(1, 6)]
    groups += [left + np.flatnonzero(keys["right"] == key) for key in range(1, 6)]
    assert parcels.names == ("L_1", "L_2", "L_3", "L_4", "L_5", "R_1", "R_2", "R_3", "R_4", "R_5")
    centroids = [group[table[np.ix_(group, group)].mean(axis=1).argmin()] for group in groups]
    assert result.centroids.tolist() == centroids
    for i, a in enumerate(groups):
        for j, b in enumerate(groups):
            block = table[np.ix_(a, b)]
            is_apart = (i < 5) != (j < 5)
            assert is_apart == math.isinf(result.mean[i, j])
            assert_allclose(result.mean[i, j], block.mean(), rtol=1e-12)
            assert_allclose(result.least[i, j], block.min(), rtol=1e-12, atol=1e-12)
            assert_allclose(result.centroid[i, j], table[centroids[i], centroids[j]], rtol=1e-12)
    labelled = np.sort(np.concatenate(groups))
    assert_array_equal(result.vertices, labelled)
    by_hand = np.array([table[np.ix_(labelled, group)].mean(axis=1) for group in groups]).T
    assert_allclose(result.vertex_mean, by_hand, rtol=1e-6)
    assert_array_equal(result.mean, result.mean.T)


@pytest.mark.jit
def test_files_hold_the_same_with_names_and_vertices(parcels, found):
    result, out = found
    names, vertices = list(parcels.names), result.vertices
    left = parcels.cortex.structures[0].count
    runs = [("CortexLeft", vertices[vertices < left]), ("CortexRight", vertices[vertices >= left])]
    for name in ("mean", "least", "centroid"):
        file = gc.brain.load_matrix(out / f"{name}.pconn.nii")
        assert_array_equal(file.values, getattr(result, name).astype(np.float32))
        assert (file.rows, file.columns) == (names, names)
    dense = gc.brain.load_matrix(out / "vertex_mean.pdconn.nii")
    assert_array_equal(dense.values, result.vertex_mean)
    assert dense.columns == names
    turned = gc.brain.load_matrix(out / "vertex_mean.dpconn.nii")
    assert_array_equal(turned.values, result.vertex_mean.T)
    assert turned.rows == names
    for axis in (dense.rows, turned.columns):
        for (structure, ids), (expected, run) in zip(axis, runs, strict=True):
            assert structure == expected
            assert_array_equal(ids, run - (left if structure == "CortexRight" else 0))
    arrays = np.load(out / "parcels.npz")
    for name in ("mean", "least", "centroid", "centroids", "vertices", "vertex_mean"):
        assert_array_equal(arrays[name], getattr(result, name))
    facts = json.loads(arrays["facts"].item())
    assert facts["wall"] == "blocks"
    assert facts["parcels"] == names
    for name in FILES:
        if name != "parcels.dlabel.nii":
            beside = json.loads((out / f"{name}.json").read_text())
            assert beside.pop("sha256") == sha256_of(out / name)
            assert beside == facts
    again = gc.brain.load_parcels(out / "parcels.dlabel.nii", parcels.cortex)
    assert_array_equal(again.parcel_of, parcels.parcel_of)
    assert again.names == parcels.names
    areas = gc.brain.load_maps(out / "areas.pscalar.nii", parcels.cortex)[0]
    assert_array_equal(
        areas[vertices], parcels.areas.astype(np.float32)[parcels.parcel_of[vertices]]
    )
    assert np.isnan(np.delete(areas, vertices)).all()


def test_areas_are_shares_of_faces(parcels):
    mesh = parcels.cortex.mesh
    corners = mesh.vertices[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    share = np.linalg.norm(cross, axis=1) / 6.0
    for k, area in enumerate(parcels.areas):
        inside = (parcels.parcel_of[mesh.faces] == k).sum(axis=1)
        assert area == pytest.approx(share @ inside)


@pytest.mark.jit
def test_a_call_that_is_stopped_goes_on_and_ends_with_the_same_bits(parcels, tmp_path, monkeypatch):
    monkeypatch.setattr(plan, "_BLOCK_ROWS", 64)
    monkeypatch.setattr(driver, "_PART_ROWS", 8)
    whole, out = tmp_path / "whole", tmp_path / "stopped"
    total = gc.brain.parcel_distances(parcels, whole).swept
    row, left = group_rows._row, 100

    def row_until_the_end(*arguments: Any) -> np.ndarray:
        nonlocal left
        left -= 1
        if left < 0:
            raise gc.errors.Cancelled("cancelled by the test")
        return row(*arguments)

    monkeypatch.setattr(group_rows, "_row", row_until_the_end)
    with pytest.raises(gc.errors.Cancelled):
        gc.brain.parcel_distances(parcels, out, threads=1)
    monkeypatch.setattr(group_rows, "_row", row)
    assert not (out / "parcels.npz").exists()
    swept = gc.brain.parcel_distances(parcels, out, threads=2).swept
    assert total - 100 <= swept < total
    for name in FILES:
        assert (out / name).read_bytes() == (whole / name).read_bytes()
    assert not list(out.glob(".*"))


def test_borders_run_between_parcels(parcels):
    mesh = parcels.cortex.mesh
    for k, lines in enumerate(parcels.borders()):
        assert lines
        for line in lines:
            for location in line.locations:
                edge = [
                    v
                    for v, w in zip(
                        mesh.faces[location.face_index], location.barycentric, strict=True
                    )
                    if w > 0
                ]
                assert {bool(parcels.parcel_of[v] == k) for v in edge} == {True, False}


def test_a_parcel_that_the_region_leaves_out_is_told(surfaces, masks, keys):
    side = {"left": surfaces["left"]}
    whole = np.where(masks["left"], keys["left"], 9)
    cortex = gc.brain.load_cortex(side, masks["left"], "passes")
    with pytest.warns(gc.errors.EmptyParcel, match="1 parcels have no vertex in the region: 9"):
        parcels = gc.brain.load_parcels(whole, cortex)
    assert parcels.keys == (1, 2, 3, 4, 5)
    with pytest.raises(gc.errors.NoSuchLabel, match="no vertex of the region has a label"):
        gc.brain.load_parcels(np.zeros(len(whole)), cortex)

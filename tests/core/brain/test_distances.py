"""Distances within a region, against those of surfaces from which the wall was cut out."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import zarr
from scipy.sparse import load_npz

import geodesic_core as gc


def by_hand(surfaces, masks, wall: str) -> np.ndarray:
    """Return all distances of the region, by a field for each vertex of each surface by itself."""
    size = sum(np.count_nonzero(mask) for mask in masks.values())
    table, first = np.full((size, size), math.inf), 0
    for side, mesh in surfaces.items():
        inside = np.flatnonzero(masks[side])
        vertices, faces = mesh.vertices, mesh.faces
        kept = np.arange(len(vertices))
        if wall == "blocks":
            faces = faces[masks[side][faces].all(axis=1)]
            kept = inside
        renumbered = np.full(len(vertices), -1)
        renumbered[kept] = np.arange(len(kept))
        part = gc.TriangleMesh(vertices[kept], renumbered[faces])
        own = np.array(
            [gc.exact_distance(part, v).distances[renumbered[inside]] for v in renumbered[inside]]
        )
        table[first : first + len(inside), first : first + len(inside)] = own
        first += len(inside)
    return table


def read(path: Path, size: int) -> np.ndarray:
    """Return a matrix by the format's own reader, infinite where it has nothing."""
    table = np.full((size, size), math.inf, np.float32)
    if path.suffix == ".npz":
        entries = load_npz(path).tocoo()
        table[entries.row, entries.col] = entries.data
    elif path.suffix == ".parquet":
        columns = pyarrow.parquet.read_table(path).to_pydict()
        table[columns["source"], columns["target"]] = columns["distance"]
    elif path.suffix == ".zarr":
        table = zarr.open_array(path, mode="r")[:]
    else:
        table = gc.brain.load_matrix(path).values
    return table


def facts_in(path: Path) -> dict:
    match path.suffix:
        case ".npz":
            return json.loads(np.load(path)["facts"].item())
        case ".parquet":
            return json.loads(pyarrow.parquet.read_schema(path).metadata[b"geodesic"])
        case ".zarr":
            return dict(zarr.open_array(path, mode="r").attrs)
    return gc.brain.load_matrix(path).facts


@pytest.mark.parametrize("wall", ["blocks", "passes"])
@pytest.mark.jit
def test_files_hold_the_distances_of_both_hemispheres_and_their_ids(
    surfaces, masks, wall, tmp_path
):
    cortex = gc.brain.load_cortex(surfaces, masks, wall)
    expected = by_hand(surfaces, masks, wall)
    assert np.isinf(expected).any()
    assert np.isfinite(expected).sum() > len(expected)
    ids = {f"Cortex{side.title()}": np.flatnonzero(mask) for side, mask in masks.items()}
    for suffix in (".dconn.nii", ".npz", ".zarr", ".parquet"):
        path = tmp_path / f"all{suffix}"
        assert gc.brain.write_distances(cortex, path).shape == expected.shape
        np.testing.assert_allclose(read(path, len(expected)), expected, rtol=1e-6)
        beside = json.loads(path.with_name(f"{path.name}.json").read_text())
        for facts in (facts_in(path), beside):
            assert {name: list(found) for name, found in ids.items()} == facts["region"]
            assert (facts["wall"], facts["units"], facts["method"]) == (wall, "mm", "exact")
            assert facts["barriers"] == cortex.mesh.barriers.tolist()
            assert len(facts["mesh"]) == 64
            assert facts["error_bound"]["value"] == 0.0
    matrix = gc.brain.load_matrix(tmp_path / "all.dconn.nii")
    for axis in (matrix.rows, matrix.columns):
        assert [name for name, _ in axis] == list(ids)
        for name, vertices in axis:
            np.testing.assert_array_equal(vertices, ids[name])


@pytest.mark.jit
def test_a_wall_that_blocks_makes_ways_longer_and_one_that_passes_none(surfaces, masks, tmp_path):
    tables = {}
    for wall in ("blocks", "passes"):
        cortex = gc.brain.load_cortex(surfaces, masks, wall)
        gc.brain.write_distances(cortex, tmp_path / f"{wall}.dconn.nii")
        tables[wall] = gc.brain.load_matrix(tmp_path / f"{wall}.dconn.nii").values
    assert (tables["blocks"] >= tables["passes"]).all()
    assert (tables["blocks"] > tables["passes"] * 1.01).any()


@pytest.mark.jit
def test_a_limit_leaves_out_what_is_beyond_it(surfaces, masks, tmp_path):
    cortex = gc.brain.load_cortex(surfaces, masks, "passes")
    expected = by_hand(surfaces, masks, "passes")
    limit = 20.0
    gc.brain.write_distances(cortex, tmp_path / "near.npz", max_distance=limit)
    found = load_npz(tmp_path / "near.npz")
    assert found.nnz == np.count_nonzero(expected <= limit)
    assert found.data.max() <= limit


@pytest.mark.parametrize(
    ("name", "options"), [("x.nii", {}), ("x.dconn.nii", {"dtype": "float64"}), ("x.npy.gz", {})]
)
def test_files_of_no_format_are_refused_before_any_work(surfaces, name, options, tmp_path):
    cortex = gc.brain.load_cortex(surfaces)
    with pytest.raises(gc.errors.InvalidArgument, match="x"):
        gc.brain.write_distances(cortex, tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.jit
def test_corrected_areas_stretch_edges_as_workbench_does(surfaces):
    """By the ratio of the sums of the roots of areas: uniform factors scale all distances."""
    plain = gc.brain.load_cortex(surfaces)
    scaled = gc.brain.load_cortex(surfaces, corrected_areas=plain.areas * 2.25)
    np.testing.assert_allclose(
        gc.exact_distance(scaled.mesh, 3).distances,
        1.5 * gc.exact_distance(plain.mesh, 3).distances,
        rtol=1e-9,
    )
    factors = np.linspace(1.0, 1.3, len(plain.areas))
    bent = gc.brain.load_cortex(surfaces, corrected_areas=plain.areas * factors)
    own, corrected = np.sqrt(plain.areas), np.sqrt(plain.areas * factors)
    for face, lengths in zip(plain.mesh.faces, bent.mesh.lengths, strict=True):
        for k, (a, b) in enumerate(itertools.pairwise([*face, face[0]])):
            length = math.dist(plain.mesh.vertices[a], plain.mesh.vertices[b])
            ratio = (corrected[a] + corrected[b]) / (own[a] + own[b])
            assert lengths[k] == pytest.approx(length * ratio, rel=1e-12)
    with pytest.raises(gc.errors.InvalidArgument, match="corrected areas must be finite"):
        gc.brain.load_cortex(surfaces, corrected_areas=plain.areas * 0.0)
    np.testing.assert_array_equal(bent.areas, plain.areas * factors)

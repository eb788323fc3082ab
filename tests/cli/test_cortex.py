"""Commands for cortices: what the library computes, and what the wall meant."""

import csv
import json
from pathlib import Path

import nibabel
import numpy as np
import pytest
from nibabel.freesurfer import read_morph_data
from nibabel.gifti import GiftiDataArray, GiftiImage
from numpy.testing import assert_array_equal
from scipy.sparse import load_npz

import geodesic_core as gc
from tests.support.commands import Run, error_line
from tests.support.folded import folded, is_cortex, parcel_keys, write_surface

MESHES = {side: folded(side) for side in ("left", "right")}
SURFACES = ["lh.surf.gii", "rh.surf.gii"]


def save(name: str | Path, values: np.ndarray) -> None:
    array = GiftiDataArray(values.astype(np.float32), "NIFTI_INTENT_SHAPE")
    GiftiImage(darrays=[array]).to_filename(name)


@pytest.fixture
def region(tmp_path: Path) -> list[str]:
    """Write surfaces, masks and parcels into the folder of the command; return options."""
    for (side, mesh), surface in zip(MESHES.items(), SURFACES, strict=True):
        write_surface(tmp_path / surface, mesh, side)
        save(tmp_path / f"{side}.shape.gii", is_cortex(mesh))
    np.savetxt(
        tmp_path / "parcels.csv", np.concatenate([parcel_keys(m) for m in MESHES.values()]), "%d"
    )
    return ["--roi", "left.shape.gii", "--roi", "right.shape.gii", "--wall"]


def cortex_of(wall: str) -> gc.brain.Cortex:
    masks = {side: is_cortex(mesh) for side, mesh in MESHES.items()}
    return gc.brain.load_cortex(MESHES, masks, wall)


@pytest.mark.parametrize("wall", ["blocks", "passes"])
def test_files_are_those_of_the_library_and_tell_the_wall(run: Run, region: list[str], wall: str):
    ran = run(
        "cortex", "distances", *SURFACES, *region, wall, "--limit", 25, "--out", "a.dconn.nii"
    )
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("wall").startswith(f"{wall}: paths ")
    assert ran.figure("left") == f"{is_cortex(MESHES['left']).sum()} of 162 vertices count"
    gc.brain.write_distances(cortex_of(wall), "b.dconn.nii", max_distance=25.0)
    assert Path("a.dconn.nii").read_bytes() == Path("b.dconn.nii").read_bytes()
    assert json.loads(Path("a.dconn.nii.json").read_text())["wall"] == wall
    near = ["neighbours", *SURFACES, *region, wall, "--radius", 25, "--out", "near.npz", "--json"]
    ran = run("cortex", *near)
    assert json.loads(ran.out)["wall"] == wall
    finite = np.isfinite(gc.brain.load_matrix("a.dconn.nii").values)
    assert load_npz("near.npz").nnz == finite.sum()


def test_parcels_go_to_a_folder_with_a_table_and_borders(run: Run, region: list[str]):
    told = [*SURFACES, "--labels", "parcels.csv", *region, "blocks", "--out", "found"]
    ran = run("cortex", "parcels", *told)
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("parcels").startswith("10, of ")
    parcels = gc.brain.load_parcels(np.loadtxt("parcels.csv"), cortex_of("blocks"))
    expected = gc.brain.parcel_distances(parcels, "here")
    assert_array_equal(
        gc.brain.load_matrix("found/mean.pconn.nii").values, expected.mean.astype(np.float32)
    )
    with Path("found/parcels.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["parcel"] for row in rows] == list(parcels.names)
    assert [float(row["area_mm2"]) for row in rows] == parcels.areas.tolist()
    firsts = {"left": 0, "right": 162}
    vertices = [firsts[row["hemisphere"]] + int(row["centroid_vertex"]) for row in rows]
    assert vertices == expected.centroids.tolist()
    borders = json.loads(Path("found/borders.json").read_text())
    for name, lines in zip(parcels.names, parcels.borders(), strict=True):
        assert [each["points"] for each in borders[name]] == [
            line.points.tolist() for line in lines
        ]


@pytest.mark.usefixtures("region")
def test_values_are_smoothed_as_by_the_library(run: Run):
    told = ["--values", "left.shape.gii", "--fwhm", 20, "--out", "smooth.func.gii"]
    ran = run("cortex", "smooth", f"left={SURFACES[0]}", *told)
    assert (ran.code, ran.err) == (0, "")
    assert ran.figure("wall") == "none: all vertices count"
    cortex = gc.brain.load_cortex({"left": MESHES["left"]})
    expected = gc.brain.smooth(cortex, is_cortex(MESHES["left"]), 20.0)
    found = gc.brain.load_maps("smooth.func.gii", cortex)[0]
    assert_array_equal(found, expected.astype(np.float32))
    told[-1] = "lh.smooth.thickness"
    assert run("cortex", "smooth", f"left={SURFACES[0]}", *told).code == 0
    assert_array_equal(read_morph_data("lh.smooth.thickness"), found)


@pytest.mark.usefixtures("region")
def test_distances_of_one_hemisphere_go_to_gifti(run: Run):
    ran = run("distance", SURFACES[1], "--source", 5, "--json", "--out", "near.func.gii")
    assert ran.code == 0
    expected = gc.exact_distance(gc.load_mesh(SURFACES[1]), 5).distances
    assert_array_equal(json.loads(ran.out)["distances"], expected)
    image = nibabel.load("near.func.gii")
    assert image.meta["AnatomicalStructurePrimary"] == "CortexRight"
    assert_array_equal(image.darrays[0].data, expected.astype(np.float32))


def test_distances_go_to_gifti_where_the_surface_tells_its_side(run: Run):
    MESHES["right"].to_trimesh().export("surface.off")
    ran = run("distance", "surface.off", "--source", 5, "--out", "near.func.gii")
    assert "which hemisphere is surface.off?" in error_line(ran)
    piped = run("distance", "-", "--format", "off", "--source", 5, "--out", "near.func.gii")
    assert "standard input does not tell the hemisphere for near.func.gii" in error_line(piped)
    assert "near.gii must end in" in run("distance", "-", "--source", 5, "--out", "near.gii").err
    assert (ran.code, list(Path().glob("near*"))) == (1, [])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--roi", "left.shape.gii"], "--roi needs --wall"),
        (["--wall", "blocks"], "--wall needs --roi"),
        (
            ["--roi", "left.shape.gii", "--wall", "blocks"],
            "left.shape.gii: it holds one hemisphere: give a file for each surface",
        ),
        (["--out", "x.pconn.nii"], "must end in .dconn.nii"),
        (["--roi", "parcels.csv", "--wall", "open"], "'open' is not one of"),
    ],
)
@pytest.mark.usefixtures("region")
def test_what_does_not_go_together_is_refused(run: Run, options: list[str], words: str):
    ran = run("cortex", "distances", *SURFACES, "--out", "x.npz", *options)
    assert ran.code != 0
    assert words in error_line(ran)
    assert not Path("x.npz").exists()
    ran = run("cortex", "distances", "left=lh.surf.gii", "rh.surf.gii", "--out", "x.npz")
    assert "before each surface, or before none" in error_line(ran)


def test_warnings_of_the_library_are_printed(run: Run, region: list[str]):
    mask = is_cortex(MESHES["left"])
    faces = MESHES["left"].faces
    deep = next(v for v in np.flatnonzero(~mask) if not mask[faces[(faces == v).any(axis=1)]].any())
    mask[deep] = True
    save("left.shape.gii", mask)
    ran = run("cortex", "neighbours", *SURFACES, *region, "blocks", "--radius", 5, "--out", "n.npz")
    assert ran.code == 0
    assert (
        f"warning: 1 vertices of the roi have no face inside of it, such as vertex {deep}"
        in ran.err
    )

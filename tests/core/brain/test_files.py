"""Files of hemispheres: each kind is read and written, and what belongs elsewhere is refused."""

import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nibabel
import numpy as np
import pytest
from nibabel.freesurfer import write_annot, write_morph_data
from nibabel.gifti import GiftiDataArray, GiftiImage
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc
from tests.support.folded import parcel_keys, write_surface

WORKBENCH = shutil.which("wb_command")
needs_workbench = pytest.mark.skipif(
    WORKBENCH is None, reason="wb_command is missing: Debian's connectome-workbench has it"
)


def workbench(*arguments: object) -> str:
    command = [WORKBENCH, *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout  # noqa: S603 - the peer


@pytest.fixture
def files(surfaces, tmp_path) -> list[Path]:
    """Surfaces whose metadata tell their sides, which their names do not."""
    return [
        write_surface(tmp_path / f"surface{i}.surf.gii", mesh, side)
        for i, (side, mesh) in enumerate(surfaces.items())
    ]


def keys_of(surfaces: dict[str, gc.TriangleMesh]) -> np.ndarray:
    """Return the number of each parcel of both hemispheres, 0 in the wall."""
    left, right = map(parcel_keys, surfaces.values())
    return np.concatenate([left, np.where(right > 0, right + 10, 0)])


def masks_as(kind: str, masks: dict[str, np.ndarray], folder: Path, cortex: Any) -> Any:
    """Return masks in a kind of file, one for each surface or one for both."""
    values = list(masks.values())
    paths = [folder / f"{i}.{kind}" for i in range(len(values))]
    whole = np.concatenate(values)
    match kind:
        case "shape.gii":
            for path, mask, side in zip(paths, values, masks, strict=True):
                array = GiftiDataArray(mask.astype(np.float32), "NIFTI_INTENT_SHAPE")
                image = GiftiImage(darrays=[array])
                image.meta["AnatomicalStructurePrimary"] = f"Cortex{side.title()}"
                image.to_filename(path)
        case "label":
            for path, mask in zip(paths, values, strict=True):
                rows = [f"{vertex} 0 0 0 0" for vertex in np.flatnonzero(mask)]
                path.write_text("\n".join(["#!ascii label", str(len(rows)), *rows]))
        case "annot":
            colours = np.array([[25, 5, 25, 0, 0], [220, 20, 20, 0, 0]])
            for path, mask in zip(paths, values, strict=True):
                write_annot(path, mask.astype(int), colours, ["Medial_wall", "cortex"])
        case "thickness":
            for path, mask in zip(paths, values, strict=True):
                write_morph_data(path, np.where(mask, 2.5, 0.0))
        case "dscalar.nii":
            gc.brain.write_maps(folder / "both.dscalar.nii", cortex, whole, ["mask"])
            return folder / "both.dscalar.nii"
        case "dlabel.nii":
            gc.brain.write_labels(
                folder / "both.dlabel.nii", gc.brain.load_parcels(whole.astype(int), cortex)
            )
            return folder / "both.dlabel.nii"
        case "csv":
            np.savetxt(folder / "both.csv", whole, "%d")
            return folder / "both.csv"
        case "npy":
            np.save(folder / "both.npy", whole)
            return folder / "both.npy"
        case "arrays":
            return masks
        case "images":
            return SimpleNamespace(mesh=0, data=SimpleNamespace(parts=masks))
    return paths


@pytest.mark.parametrize(
    "kind",
    [
        "shape.gii",
        "label",
        "annot",
        "thickness",
        "dscalar.nii",
        "dlabel.nii",
        "csv",
        "npy",
        "arrays",
        "images",
    ],
)
def test_each_kind_of_mask_is_the_same_region(kind, surfaces, files, masks, tmp_path):
    whole = gc.brain.load_cortex(files)
    assert [each.side for each in whole.structures] == ["left", "right"]
    cortex = gc.brain.load_cortex(files, masks_as(kind, masks, tmp_path, whole), "passes")
    assert_array_equal(cortex.region, np.flatnonzero(np.concatenate(list(masks.values()))))
    for structure, mask in zip(cortex.structures, masks.values(), strict=True):
        assert_array_equal(cortex.region_of(structure), np.flatnonzero(mask))
    assert_array_equal(
        cortex.mesh.vertices, np.concatenate([m.vertices for m in surfaces.values()])
    )


def test_each_kind_of_object_is_the_same_cortex(surfaces, files):
    poly = SimpleNamespace(parts=surfaces, n_vertices=0)
    kinds = [surfaces, files, poly, SimpleNamespace(mesh=poly, data=0)]
    kinds += [[nibabel.load(path) for path in files]]
    for kind in kinds:
        cortex = gc.brain.load_cortex(kind)
        assert [each.name for each in cortex.structures] == ["CortexLeft", "CortexRight"]
        assert_array_equal(
            cortex.mesh.faces[-1], surfaces["right"].faces[-1] + len(surfaces["left"].vertices)
        )


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("lh.pial", "left"),
        ("sub-1_hemi-R_white", "right"),
        ("S.L.midthickness.32k_fs_LR", "left"),
        ("conte69_32k_rh", "right"),
    ],
)
def test_names_tell_the_side(name, side, surfaces, tmp_path):
    mesh = surfaces["left"]
    nibabel.freesurfer.write_geometry(tmp_path / name, mesh.vertices, mesh.faces)
    assert gc.brain.load_cortex(tmp_path / name).structures[0].side == side


def test_values_and_labels_come_back_to_the_bit(surfaces, masks, tmp_path):
    cortex = gc.brain.load_cortex(surfaces, masks, "passes")
    one = gc.brain.load_cortex({"left": surfaces["left"]}, masks["left"], "passes")
    rng = np.random.default_rng(3)
    two, single = ["func.gii", "shape.gii"], ["curv", "thickness"]
    for each, suffixes in ((cortex, ["dscalar.nii"]), (one, [*two, *single])):
        for suffix in suffixes:
            names = ["a"] if suffix in single else ["a", "b"]
            values = rng.normal(size=(len(names), len(each.areas))).astype(np.float32)
            path = tmp_path / f"lh.{suffix}"
            gc.brain.write_maps(path, each, values, names)
            found = gc.brain.load_maps(path, each)
            assert_array_equal(found[:, each.region], values[:, each.region])
    keys = keys_of(surfaces)
    for each, path in ((cortex, "p.dlabel.nii"), (one, "p.label.gii")):
        parcels = gc.brain.load_parcels(keys[: len(each.areas)], each)
        gc.brain.write_labels(tmp_path / path, parcels)
        again = gc.brain.load_parcels(tmp_path / path, each)
        assert (again.names, again.keys) == (parcels.names, parcels.keys)
        assert_array_equal(again.parcel_of, parcels.parcel_of)


def test_parcels_as_freesurfer_has_them(surfaces, masks, tmp_path):
    """As many as of Schaefer's largest: no two have one colour, by which they are told apart."""
    ball = gc.samples.sphere(3000)
    cortex = gc.brain.load_cortex({"left": ball})
    keys = np.arange(len(ball.vertices)) % 1001  # of 0 there is no parcel
    parcels = gc.brain.load_parcels(keys, cortex)
    gc.brain.write_labels(tmp_path / "lh.many.annot", parcels)
    labels, table, names = nibabel.freesurfer.read_annot(tmp_path / "lh.many.annot")
    assert_array_equal(labels, np.where(keys > 0, keys, -1))  # black stands for none
    assert [name.decode() for name in names[1:]] == list(parcels.names)
    assert len(np.unique(table[:, :3], axis=0)) == 1001
    again = gc.brain.load_parcels(tmp_path / "lh.many.annot", cortex)
    assert (again.names, again.keys) == (parcels.names, tuple(range(1, 1001)))
    assert_array_equal(again.parcel_of, parcels.parcel_of)

    both = gc.brain.load_cortex(surfaces, masks, "passes")
    with pytest.raises(gc.errors.InvalidArgument, match="holds one hemisphere"):
        gc.brain.write_labels(tmp_path / "x.annot", gc.brain.load_parcels(keys_of(surfaces), both))
    with pytest.raises(gc.errors.InvalidArgument, match="holds one map"):
        gc.brain.write_maps(tmp_path / "x.curv", cortex, [cortex.areas] * 2, ["a", "b"])


def test_a_parcel_and_the_region_as_labels_of_freesurfer(surfaces, masks, tmp_path):
    mesh, path = surfaces["left"], tmp_path / "lh.one.label"
    cortex = gc.brain.load_cortex({"left": mesh}, masks["left"], "passes")
    keys = keys_of(surfaces)[: len(cortex.areas)]
    parcels = gc.brain.load_parcels(keys, cortex)
    for values, vertices in (
        (parcels.parcel_of == 2, np.flatnonzero(keys == 3)),
        (np.ones(len(keys)), np.flatnonzero(masks["left"])),
    ):
        gc.brain.write_labels(path, gc.brain.load_parcels(values, cortex))
        found, scalars = nibabel.freesurfer.read_label(path, read_scalars=True)
        assert_array_equal(found, vertices)
        assert not scalars.any()
        places = np.loadtxt(path, np.float32, skiprows=2, usecols=(1, 2, 3))
        assert_array_equal(places, mesh.vertices[vertices])  # float32 from the start
        assert_array_equal(gc.load_label_vertices(path, mesh), vertices)
        again = gc.brain.load_cortex({"left": mesh}, path, "passes")
        assert_array_equal(again.region, vertices)

    with pytest.raises(gc.errors.InvalidArgument, match=r"holds one parcel: write \.annot"):
        gc.brain.write_labels(path, parcels)
    both = gc.brain.load_parcels(np.ones(324), gc.brain.load_cortex(surfaces, masks, "passes"))
    with pytest.raises(gc.errors.InvalidArgument, match=r"one\.label holds one hemisphere"):
        gc.brain.write_labels(path, both)
    with pytest.raises(gc.errors.NoSuchLabel, match="no vertex of the region has a label"):
        gc.brain.load_parcels(np.zeros(162), cortex)
    flat = gc.TriangleMesh.from_lengths(mesh.faces, np.ones(mesh.faces.shape))
    unplaced = gc.brain.load_cortex({"left": flat})
    with pytest.raises(gc.errors.NotEmbedded, match=r"a \.label file needs positions"):
        gc.brain.write_labels(path, gc.brain.load_parcels(np.ones(162), unplaced))


@needs_workbench
@pytest.mark.jit
def test_workbench_reads_what_is_written(surfaces, masks, tmp_path):
    """Structures, numbers of vertices and values, to the bit of float32."""
    cortex = gc.brain.load_cortex(surfaces, masks, "blocks")
    keys = keys_of(surfaces)
    parcels = gc.brain.load_parcels(keys, cortex)
    found = gc.brain.parcel_distances(parcels, tmp_path)
    gc.brain.write_distances(cortex, tmp_path / "all.dconn.nii")
    gc.brain.write_maps(tmp_path / "areas.dscalar.nii", cortex, cortex.areas, ["area"])
    count, size, number = (len(cortex.areas) // 2, len(cortex.region), len(parcels.names))
    inside = [len(cortex.region_of(each)) for each in cortex.structures]
    kinds = {
        "all.dconn.nii": ("Dense", size, size),
        "mean.pconn.nii": ("Parcel", number, number),
        "vertex_mean.dpconn.nii": ("Dense Parcel", size, number),
        "vertex_mean.pdconn.nii": ("Parcel Dense", number, size),
        "areas.dscalar.nii": ("Dense Scalar", size, 1),
        "areas.pscalar.nii": ("Parcel Scalar", number, 1),
        "parcels.dlabel.nii": ("Dense Label", size, 1),
    }
    for name, (kind, rows, columns) in kinds.items():
        told = workbench("-file-information", tmp_path / name)
        lines = [line.split(":", 1) for line in told.splitlines() if ":" in line]
        facts = {(key.strip(), value.strip()) for key, value in lines}
        dims = {value for key, value in facts if key.startswith("CIFTI Dim")}
        assert dims == {str(rows), str(columns)}
        expected = {("Type", f"CIFTI - {kind}"), ("Structure", "CortexLeft CortexRight")}
        if "Dense" in kind:
            expected |= {
                (structure.name, f"{some} out of {count} vertices")
                for structure, some in zip(cortex.structures, inside, strict=True)
            }
        assert expected <= facts
    # Its text has six digits, a line for what CIFTI calls a row: the vertices here.
    text = tmp_path / "text.txt"
    workbench("-cifti-convert", "-to-text", tmp_path / "vertex_mean.dpconn.nii", text)
    assert_allclose(np.loadtxt(text), found.vertex_mean, rtol=1e-5)
    separate = ["-cifti-separate", tmp_path / "areas.dscalar.nii", "COLUMN", "-metric"]
    workbench(*separate, "CORTEX_RIGHT", tmp_path / "right.func.gii")
    right = gc.brain.load_cortex({"right": surfaces["right"]})
    values = gc.brain.load_maps(tmp_path / "right.func.gii", right)[0]
    expected = np.where(masks["right"], cortex.areas[count:], 0.0).astype(np.float32)
    assert_array_equal(values, expected)


def test_what_belongs_to_another_surface_is_refused(surfaces, files, masks, tmp_path):
    other = gc.samples.sphere(80)
    with pytest.raises(gc.errors.OtherSurface, match="42 values for the 162 vertices of the left"):
        gc.brain.load_cortex({"left": surfaces["left"]}, np.ones(len(other.vertices)), "passes")
    with pytest.raises(gc.errors.OtherSurface, match="one for each face, and must be by vertex"):
        gc.brain.load_cortex({"left": surfaces["left"]}, np.ones(320), "passes")
    with pytest.raises(gc.errors.OtherSurface, match="perhaps of both hemispheres"):
        gc.brain.load_cortex({"left": surfaces["left"]}, np.ones(324), "passes")
    with pytest.raises(gc.errors.OtherSurface, match="99 values, but the surfaces have 324"):
        gc.brain.load_cortex(surfaces, np.ones(99), "passes")
    with pytest.raises(gc.errors.InvalidArgument, match=r"values have shape \(1, 2, 324\)"):
        gc.brain.load_maps(np.ones((1, 2, 324)), gc.brain.load_cortex(surfaces))
    with pytest.raises(gc.errors.OtherSurface, match="the roi lists vertex 324"):
        gc.brain.load_cortex(surfaces, [324], "passes")
    rows = "#!ascii label\n1\n162 0 0 0 0\n"
    (tmp_path / "x.label").write_text(rows)
    with pytest.raises(gc.errors.OtherSurface, match=r"x\.label: it lists vertex 162"):
        gc.brain.load_cortex(files[:1], tmp_path / "x.label", "passes")
    paths = masks_as("shape.gii", masks, tmp_path, None)
    with pytest.raises(gc.errors.InvalidArgument, match="of the right hemisphere, and the surface"):
        gc.brain.load_cortex(files, paths[::-1], "passes")
    for name in ("rh.cortex.label", "rh.aparc.annot", "rh.thickness"):  # FreeSurfer's only tell so
        (tmp_path / name).write_text(rows)
        with pytest.raises(gc.errors.InvalidArgument, match="it is of the right hemisphere"):
            gc.brain.load_cortex(files[:1], tmp_path / name, "passes")
    cortex = gc.brain.load_cortex({"left": surfaces["left"]})
    gc.brain.write_maps(tmp_path / "left.dscalar.nii", cortex, cortex.areas, ["area"])
    with pytest.raises(gc.errors.InvalidArgument, match="nothing of the right cortex"):
        gc.brain.load_cortex(surfaces, tmp_path / "left.dscalar.nii", "passes")


def test_what_a_call_does_not_say_is_asked_for(surfaces, files, masks, tmp_path):
    with pytest.raises(gc.errors.InvalidArgument, match="say what a wall means"):
        gc.brain.load_cortex(surfaces, masks)
    with pytest.raises(gc.errors.InvalidArgument, match="a wall needs a roi"):
        gc.brain.load_cortex(surfaces, wall="blocks")
    plain = tmp_path / "surface.off"
    plain.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    with pytest.raises(gc.errors.InvalidArgument, match="which hemisphere is"):
        gc.brain.load_cortex(plain)
    with pytest.raises(gc.errors.InvalidArgument, match="which hemisphere is"):
        gc.brain.load_cortex([files[0], files[0]])
    with pytest.raises(gc.errors.InvalidArgument, match="3 files for 2 surfaces"):
        gc.brain.load_cortex(files, [files[0]] * 3, "passes")


def test_regions_without_vertices_or_faces_are_told(surfaces, masks):
    nothing = {"left": masks["left"], "right": np.zeros(162)}
    with pytest.raises(gc.errors.NoSuchLabel, match="no vertex of the right surface"):
        gc.brain.load_cortex(surfaces, nothing, "passes")
    lone = {"left": masks["left"].copy(), "right": masks["right"]}
    wall = np.flatnonzero(~masks["left"])
    faces = surfaces["left"].faces
    deep = next(v for v in wall if not masks["left"][faces[(faces == v).any(axis=1)]].any())
    lone["left"][deep] = True
    with pytest.warns(gc.errors.BlockedSource, match=f"vertex {deep} of the left surface"):
        cortex = gc.brain.load_cortex(surfaces, lone, "blocks")
    assert deep in cortex.region
    with pytest.raises(gc.errors.NoSuchLabel, match="no face has all of its corners"):
        gc.brain.load_cortex({"left": surfaces["left"]}, [int(deep)], "blocks")


def test_damaged_files_are_refused_with_their_name(files, tmp_path):
    for name, content in {
        "x.dscalar.nii": b"no image",
        "x.shape.gii": b"<GIFTI",
        "x.annot": b"\0" * 7,
        "x.csv": b"one,two",
        "lh.curv": b"x",
    }.items():
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(gc.errors.InvalidArgument, match=name):
            gc.brain.load_cortex(files[:1], path, "passes")
        with pytest.raises(gc.errors.InvalidArgument, match=r"must end in|is no CIFTI-2 file"):
            gc.brain.load_matrix(path)
    with pytest.raises(gc.errors.InvalidArgument, match=r"cannot read .*none\.curv"):
        gc.brain.load_cortex(files[:1], tmp_path / "none.curv", "passes")

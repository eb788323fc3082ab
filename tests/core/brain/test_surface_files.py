"""Surfaces that are written: nibabel, Workbench and the library read what they are."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from nibabel.freesurfer import read_geometry
from numpy.testing import assert_allclose, assert_array_equal

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, NotEmbedded
from tests.core.brain.test_files import needs_workbench, workbench

SIDES = ("left", "right")


def paths_in(folder: Path, kind: str) -> dict[str, Path]:
    return {side: folder / f"{side[0]}h{kind}" for side in SIDES}


def test_gifti_holds_what_nibabel_and_the_standard_call_a_surface(surfaces, masks, tmp_path):
    cortex = gc.brain.load_cortex(surfaces, masks, "blocks")
    paths = paths_in(tmp_path, ".surf.gii")
    gc.brain.write_surfaces(paths, cortex)
    for side, mesh in surfaces.items():
        points, triangles = nibabel.load(paths[side]).darrays
        kinds = nibabel.nifti1.intent_codes.niistring
        assert kinds[points.intent] == "NIFTI_INTENT_POINTSET"
        assert kinds[triangles.intent] == "NIFTI_INTENT_TRIANGLE"
        assert (points.data.dtype, triangles.data.dtype) == (np.float32, np.int32)
        assert points.meta["AnatomicalStructurePrimary"] == f"Cortex{side.title()}"
        assert_array_equal(points.data, mesh.vertices)  # float32 from the start
        assert_array_equal(triangles.data, mesh.faces)


@pytest.mark.parametrize(
    "name", [".white", ".pial", ".midthickness", ".orig", ".smoothwm", ".inflated", ".sphere"]
)
def test_freesurfer_holds_the_same(name, surfaces, tmp_path):
    paths = paths_in(tmp_path, name)
    gc.brain.write_surfaces(paths, gc.brain.load_cortex(surfaces))
    for side, mesh in surfaces.items():
        points, triangles = read_geometry(paths[side])
        assert_array_equal(points, mesh.vertices)
        assert_array_equal(triangles, mesh.faces)


@pytest.mark.parametrize("kind", [".surf.gii", ".white"])
def test_what_is_written_is_the_same_cortex_again(kind, surfaces, tmp_path):
    cortex = gc.brain.load_cortex(surfaces)
    paths = paths_in(tmp_path, kind)
    gc.brain.write_surfaces(paths, cortex)
    again = gc.brain.load_cortex(list(paths.values()))
    assert (again.structures, again.mesh.digest) == (cortex.structures, cortex.mesh.digest)
    gc.brain.write_surfaces({"right": tmp_path / f"rh.2{kind}"}, cortex)
    one = gc.brain.load_cortex(tmp_path / f"rh.2{kind}")
    gc.brain.write_surfaces(tmp_path / f"rh.3{kind}", one)
    written = [(tmp_path / f"rh.{number}{kind}").read_bytes() for number in (2, 3)]
    assert written == [paths["right"].read_bytes()] * 2


@needs_workbench
def test_workbench_reads_the_same_positions_and_faces(surfaces, tmp_path):
    cortex = gc.brain.load_cortex(surfaces)
    paths = paths_in(tmp_path, ".surf.gii")
    gc.brain.write_surfaces(paths, cortex)
    for structure in cortex.structures:
        path, mesh = paths[structure.side], surfaces[structure.side]
        told = workbench("-file-information", path).splitlines()
        facts = {tuple(map(str.strip, line.split(":", 1))) for line in told if ":" in line}
        assert facts >= {
            ("Type", "Surface"),
            ("Structure", structure.name),
            ("Number of Vertices", str(len(mesh.vertices))),
            ("Number of Triangles", str(len(mesh.faces))),
            ("Normal Vectors Correct", "true"),
        }
        workbench("-surface-coordinates-to-metric", path, tmp_path / "xyz.func.gii")
        columns = [array.data for array in nibabel.load(tmp_path / "xyz.func.gii").darrays]
        assert_array_equal(np.transpose(columns), mesh.vertices)
        workbench("-surface-flip-normals", path, tmp_path / "once.surf.gii")
        workbench("-surface-flip-normals", tmp_path / "once.surf.gii", tmp_path / "twice.surf.gii")
        points, triangles = nibabel.load(tmp_path / "twice.surf.gii").darrays
        assert points.meta["AnatomicalStructurePrimary"] == structure.name
        assert_array_equal(points.data, mesh.vertices)
        assert_array_equal(triangles.data, mesh.faces)
        workbench("-surface-vertex-areas", path, tmp_path / "areas.func.gii")
        areas = nibabel.load(tmp_path / "areas.func.gii").darrays[0].data
        assert_allclose(areas, cortex.areas[structure.part], rtol=1e-5)


def test_a_processed_surface_keeps_its_numbers(surfaces, tmp_path):
    mesh = surfaces["left"]
    cut = gc.cut(mesh, [gc.shortest_path(mesh, 3, 90)]).mesh
    gc.brain.write_surfaces(tmp_path / "lh.cut.surf.gii", gc.brain.load_cortex({"left": cut}))
    again = gc.load_mesh(tmp_path / "lh.cut.surf.gii")
    assert_array_equal(again.vertices, cut.vertices.astype(np.float32))
    assert_array_equal(again.faces, cut.faces)


def test_corrected_areas_go_to_a_file_of_their_own(surfaces, tmp_path):
    mesh = {"left": surfaces["left"]}
    areas = gc.brain.load_cortex(mesh).areas * np.linspace(1.5, 1.6, len(mesh["left"].vertices))
    wide = gc.brain.load_cortex(mesh, corrected_areas=areas)
    surface, shape = tmp_path / "lh.surf.gii", tmp_path / "lh.shape.gii"
    gc.brain.write_surfaces(surface, wide)
    gc.brain.write_maps(shape, wide, wide.areas, ["area"])
    again = gc.brain.load_cortex(surface, corrected_areas=shape)
    assert_array_equal(again.mesh.vertices, wide.mesh.vertices)
    assert_allclose(again.mesh.lengths, wide.mesh.lengths, rtol=1e-6)  # areas are float32


def test_surfaces_that_a_file_cannot_hold_are_refused(surfaces, tmp_path):
    both = gc.brain.load_cortex(surfaces)
    left = gc.brain.load_cortex({"left": surfaces["left"]})
    flat = gc.TriangleMesh.from_lengths(left.mesh.faces, np.ones(left.mesh.faces.shape))
    unplaced = gc.brain.load_cortex({"left": flat})
    for paths, cortex, error, message in (
        ("x.surf.gii", both, InvalidArgument, r"x\.surf\.gii holds one hemisphere: give"),
        ({"right": "x.surf.gii"}, left, InvalidArgument, "there is no right surface, only left"),
        ({"up": "x.surf.gii"}, both, InvalidArgument, "no up surface, only left and right"),
        ("x.gii", left, InvalidArgument, r"x\.gii must end in \.surf\.gii, \.white"),
        ({"left": tmp_path / "lh.white", "right": "rh.obj"}, both, InvalidArgument, r"rh\.obj"),
        ("x.pial", unplaced, NotEmbedded, "lengths alone"),
    ):
        with pytest.raises(error, match=message):
            gc.brain.write_surfaces(paths, cortex)
    assert not list(tmp_path.iterdir())

"""Files that other libraries write: GIFTI, FreeSurfer and VTK, good and bad."""

from pathlib import Path

import meshio
import nibabel
import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage

import geodesic_core as gc

BALL = gc.samples.sphere(320)
VERTICES, FACES = BALL.vertices, BALL.faces
SINGLE = VERTICES.astype(np.float32).astype(np.float64)


def gifti(folder: Path, *, vertices: np.ndarray = VERTICES, faces: np.ndarray = FACES) -> Path:
    arrays = [
        GiftiDataArray(vertices.astype(np.float32), "NIFTI_INTENT_POINTSET"),
        GiftiDataArray(faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE"),
    ]
    path = folder / "lh.midthickness.surf.gii"
    path.write_bytes(GiftiImage(darrays=arrays).to_bytes())
    return path


def freesurfer(folder: Path) -> Path:
    path = folder / "lh.pial"
    nibabel.freesurfer.write_geometry(path, VERTICES, FACES)
    return path


def vtk(folder: Path, suffix: str, *, binary: bool) -> Path:
    path = folder / f"mesh.{suffix}"
    cells = [("triangle", FACES), ("line", np.array([[0, 1]]))]
    getattr(meshio, suffix).write(path, meshio.Mesh(VERTICES, cells), binary=binary)
    return path


FILES = {
    "gifti": (gifti, SINGLE),
    "freesurfer": (freesurfer, SINGLE),
    "vtk": (lambda folder: vtk(folder, "vtk", binary=True), VERTICES),
    "vtk text": (lambda folder: vtk(folder, "vtk", binary=False), VERTICES),
    "vtu": (lambda folder: vtk(folder, "vtu", binary=True), VERTICES),
    "vtu text": (lambda folder: vtk(folder, "vtu", binary=False), VERTICES),
}


@pytest.mark.parametrize("name", FILES)
def test_a_mesh_comes_back_as_it_was_written(name: str, tmp_path: Path) -> None:
    make, vertices = FILES[name]
    mesh = gc.load_mesh(make(tmp_path))
    np.testing.assert_allclose(mesh.vertices, vertices, rtol=1e-9)
    np.testing.assert_array_equal(mesh.faces, FACES)
    lines = [note for note in mesh.warnings if "1 line cells" in note]
    assert len(lines) == name.startswith("vt")


@pytest.mark.parametrize("name", FILES)
def test_too_many_faces_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(gc.errors.TooManyFaces):
        gc.load_mesh(FILES[name][0](tmp_path), max_faces=319)


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_was_cut_is_damaged(name: str, tmp_path: Path) -> None:
    path = FILES[name][0](tmp_path)
    content = path.read_bytes()
    for share in (0.001, 0.05, 0.3, 0.7, 0.99):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(gc.errors.InvalidMesh):
            gc.load_mesh(path)


@pytest.mark.slice(10)
@pytest.mark.parametrize("seed", range(120))
@pytest.mark.parametrize("name", FILES)
def test_a_mutated_file_is_read_or_refused(name: str, seed: int, tmp_path: Path) -> None:
    path, rng = FILES[name][0](tmp_path), np.random.default_rng(seed)
    content = np.frombuffer(path.read_bytes(), np.uint8).copy()
    for place in rng.integers(0, min(len(content), 4000), rng.integers(1, 9)):
        content[place] = rng.integers(0, 256)
    path.write_bytes(content.tobytes())
    try:
        mesh = gc.load_mesh(path)
    except gc.errors.InvalidMesh:
        return
    assert np.isfinite(mesh.vertices).all()


def test_counts_beyond_the_content_are_named(tmp_path: Path) -> None:
    path = freesurfer(tmp_path)
    content = bytearray(path.read_bytes())
    begin = content.index(b"\n\n") + 2
    content[begin : begin + 4] = (2**31 - 1).to_bytes(4, "big")
    path.write_bytes(content)
    with pytest.raises(gc.errors.InvalidMesh, match=r"declares 2147483647 vertices .* holds 5784"):
        gc.load_mesh(path)


def test_a_gifti_file_of_numbers_is_no_surface(tmp_path: Path) -> None:
    path = tmp_path / "thickness.shape.gii"
    array = GiftiDataArray(np.zeros(9, np.float32), "NIFTI_INTENT_SHAPE")
    path.write_bytes(GiftiImage(darrays=[array]).to_bytes())
    with pytest.raises(gc.errors.InvalidMesh, match="holds no NIFTI_INTENT_POINTSET array"):
        gc.load_mesh(path)
    with pytest.raises(gc.errors.InvalidMesh, match=r"points have shape \(162, 2\)"):
        gc.load_mesh(gifti(tmp_path, vertices=VERTICES[:, :2]))


def test_an_unknown_file_is_not_taken_for_freesurfer_s(tmp_path: Path) -> None:
    path = tmp_path / "lh.pial"
    path.write_bytes(b"no surface")
    with pytest.raises(gc.errors.InvalidMesh, match="unknown mesh file type 'pial'"):
        gc.load_mesh(path)
    with pytest.raises(gc.errors.InvalidMesh, match="not a FreeSurfer surface"):
        gc.load_mesh(path, "freesurfer")

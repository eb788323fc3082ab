"""Labels of brain surfaces: the faces in them, and files that are no labels of the surface."""

import sys
from pathlib import Path

import nibabel
import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage, GiftiLabel, GiftiLabelTable

import geodesic_core as gc

BALL = gc.samples.sphere(320)
WALL = np.flatnonzero(BALL.vertices[:, 0] > 0.6)
FACES = np.flatnonzero((BALL.vertices[:, 0] > 0.6)[BALL.faces].all(axis=1))


def freesurfer(folder: Path, vertices: np.ndarray = WALL) -> Path:
    rows = "".join(f"{vertex}  0.0  0.0  0.0 0.0\n" for vertex in vertices)
    path = folder / "lh.Medial_wall.label"
    path.write_text(f"#!ascii label  , from subject ball vox2ras=TkReg\n{len(vertices)}\n{rows}")
    return path


def gifti(
    folder: Path, values: np.ndarray, intent: str, names: dict[int, str] | None = None
) -> Path:
    table = GiftiLabelTable()
    for key, name in (names or {}).items():
        table.labels.append(GiftiLabel(key, 1, 1, 1, 1))
        table.labels[-1].label = name
    path = folder / "lh.gii"
    arrays = [GiftiDataArray(values, intent)]
    path.write_bytes(GiftiImage(darrays=arrays, labeltable=table).to_bytes())
    return path


def parcels() -> np.ndarray:
    values = np.full(len(BALL.vertices), 2, np.int32)
    values[WALL] = 7
    values[BALL.vertices[:, 0] < -0.6] = 0
    return values


def test_a_label_of_freesurfer_has_the_faces_between_its_vertices(tmp_path: Path) -> None:
    path = freesurfer(tmp_path)
    np.testing.assert_array_equal(nibabel.freesurfer.read_label(path), WALL)
    found = gc.load_label(path, BALL)
    np.testing.assert_array_equal(found, FACES)
    assert len(BALL.with_barriers(found).barriers) == len(FACES) > 10


def test_a_label_of_gifti_is_named_or_numbered(tmp_path: Path) -> None:
    path = gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL", {0: "???", 2: "cortex", 7: "wall"})
    for label in ("wall", 7, "7"):
        np.testing.assert_array_equal(gc.load_label(path, BALL, label), FACES)
    every = {name: len(gc.load_label(path, BALL, name)) for name in ("???", "cortex")}
    assert min(every.values()) > 10
    np.testing.assert_array_equal(
        gc.load_label(path, BALL), np.flatnonzero(parcels()[BALL.faces].all(axis=1))
    )


def test_a_shape_of_gifti_may_be_that_of_the_cortex(tmp_path: Path) -> None:
    cortex = np.ones(len(BALL.vertices), np.float32)
    cortex[WALL] = 0
    path = gifti(tmp_path, cortex, "NIFTI_INTENT_SHAPE")
    np.testing.assert_array_equal(gc.load_label(path, BALL, 0), FACES)
    kept = np.flatnonzero(cortex[BALL.faces].all(axis=1))
    np.testing.assert_array_equal(gc.load_label(path, BALL), kept)


def test_merged_vertices_are_in_the_label_by_the_numbers_of_the_file(tmp_path: Path) -> None:
    corners = BALL.vertices[BALL.faces].reshape(-1, 3)
    soup = gc.TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3), merge="exact")
    vertices = np.flatnonzero(np.isin(BALL.faces.reshape(-1), WALL))
    np.testing.assert_array_equal(gc.load_label(freesurfer(tmp_path, vertices), soup), FACES)


def test_what_is_no_label_of_the_surface_is_refused(tmp_path: Path) -> None:
    surface = GiftiDataArray(BALL.vertices.astype(np.float32), "NIFTI_INTENT_POINTSET")
    bad: list[tuple[str, bytes | None, str | None, str]] = [
        ("missing.label", None, None, "cannot read"),
        ("a.txt", b"", None, "must end in .label, .annot or .gii"),
        ("a.label", b"#\n2\n1 0 0 0 0\n", None, "declares 2 vertices and lists 1"),
        ("b.label", b"#\n1\n400 0 0 0 0\n", None, "lists vertex 400, but the mesh has 1"),
        ("c.label", b"#\n1\n-1 0 0 0 0\n", None, "lists vertex -1"),
        ("d.label", b"#\n1\nx 0 0 0 0\n", None, "damaged"),
        ("e.label", b"", None, "damaged"),
        ("f.label", freesurfer(tmp_path).read_bytes(), "wall", "has one label"),
        ("a.gii", b"<GIFTI", None, "damaged"),
        ("b.gii", GiftiImage().to_bytes(), None, "holds no array"),
        ("c.gii", GiftiImage(darrays=[surface]).to_bytes(), None, "values have shape"),
    ]
    for name, content, label, message in bad:
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(gc.errors.InvalidArgument, match=message):
            gc.load_label(path, BALL, label)
    path = gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL", {7: "wall"})
    with pytest.raises(gc.errors.InvalidArgument, match="no label 'Wall'; its labels are 'wall'"):
        gc.load_label(path, BALL, "Wall")


def test_gifti_needs_an_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL")
    monkeypatch.setitem(sys.modules, "nibabel.gifti.gifti", None)
    with pytest.raises(gc.errors.MissingExtra, match="brain"):
        gc.load_label(path, BALL)


def test_the_surface_may_be_given_in_any_form(tmp_path: Path) -> None:
    label = freesurfer(tmp_path)
    assert gc.load_label(label, (BALL.vertices, BALL.faces)).tolist() == FACES.tolist()
    with pytest.raises(gc.errors.InvalidMesh, match="cannot be made from this NoneType"):
        gc.load_label(label, None)  # type: ignore[arg-type]

"""Labels of brain surfaces: the faces in them, and files that are no labels of the surface."""

import gzip
import struct
import sys
from pathlib import Path
from random import Random

import nibabel
import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage, GiftiLabel, GiftiLabelTable

import geodesic_core as gc
from tests.support.mutations import BYTES, mutated

BALL = gc.samples.sphere(320)
WALL = np.flatnonzero(BALL.vertices[:, 0] > 0.6)
FACES = np.flatnonzero((BALL.vertices[:, 0] > 0.6)[BALL.faces].all(axis=1))


def freesurfer(folder: Path, vertices: np.ndarray = WALL) -> Path:
    rows = "".join(f"{vertex}  0.0  0.0  0.0 0.0\n" for vertex in vertices)
    path = folder / "lh.Medial_wall.label"
    path.write_text(f"#!ascii label  , from subject ball vox2ras=TkReg\n{len(vertices)}\n{rows}")
    return path


def gifti(
    folder: Path,
    values: np.ndarray,
    intent: str,
    names: dict[int, str] | None = None,
    encoding: str = "GIFTI_ENCODING_B64GZ",
) -> Path:
    table = GiftiLabelTable()
    for key, name in (names or {}).items():
        table.labels.append(GiftiLabel(key, 1, 1, 1, 1))
        table.labels[-1].label = name
    path = folder / "lh.gii"
    arrays = [GiftiDataArray(values, intent, encoding=encoding)]
    path.write_bytes(GiftiImage(darrays=arrays, labeltable=table).to_bytes())
    return path


def parcels() -> np.ndarray:
    values = np.full(len(BALL.vertices), 2, np.int32)
    values[WALL] = 7
    values[BALL.vertices[:, 0] < -0.6] = 0
    return values


def annotation(folder: Path, version: int = 2) -> Path:
    """Write the wall, the cortex, and the rest, which has no label; vertices in no order."""
    names, colours = ["unknown", "wall", "cortex"], [(25, 5, 25), (255, 0, 0), (0, 128, 7)]
    codes = np.array([red + (green << 8) + (blue << 16) for red, green, blue in colours])
    labels = np.choose(np.searchsorted([0, 2, 7], parcels()), [-1, 2, 1])
    rows = np.stack([np.arange(len(labels)), np.where(labels < 0, 0, codes[labels])], axis=1)
    data = struct.pack(">i", len(rows)) + np.flip(rows, axis=0).astype(">i4").tobytes()

    def text(name: str) -> bytes:
        return struct.pack(">i", len(name) + 1) + name.encode() + b"\0"

    entries = [
        text(name) + struct.pack(">4i", *colour, 0)
        for name, colour in zip(names, colours, strict=True)
    ]
    if version == 1:
        data += struct.pack(">2i", 1, len(names)) + text("a.ctab") + b"".join(entries)
    else:
        numbered = (struct.pack(">i", i) + entry for i, entry in enumerate(entries))
        data += struct.pack(">3i", 1, -2, len(names)) + text("a.ctab")
        data += struct.pack(">i", len(names)) + b"".join(numbered)
    path = folder / "lh.aparc.annot"
    path.write_bytes(data)
    return path


def compressed(path: Path) -> Path:
    packed = path.with_name(path.name + ".gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    return packed


CORTEX_FACES = np.flatnonzero((np.abs(BALL.vertices[:, 0]) <= 0.6)[BALL.faces].all(axis=1))
OUTSIDE = np.flatnonzero((BALL.vertices[:, 0] <= 0.6)[BALL.faces].all(axis=1))


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


@pytest.mark.parametrize("version", [1, 2])
def test_an_annotation_has_labels_by_name_and_number(tmp_path: Path, version: int) -> None:
    path = annotation(tmp_path, version)
    _, colours, names = nibabel.freesurfer.read_annot(path)  # takes the vertices to be in order
    assert (len(colours), names) == (3, [b"unknown", b"wall", b"cortex"])
    for label in ("wall", 1, "1", 1.0):
        np.testing.assert_array_equal(gc.load_label(path, BALL, label), FACES)
    np.testing.assert_array_equal(gc.load_label(path, BALL, "cortex"), CORTEX_FACES)
    np.testing.assert_array_equal(gc.load_label_vertices(path, BALL, "wall"), WALL)
    for label, message in (
        (None, "name one: its labels are 'unknown', 'wall', 'cortex'"),
        ("Wall", "no label 'Wall'; its labels are 'unknown', 'wall', 'cortex'"),
        (3, "no label 3"),
        ("unknown", "no vertex has the label 'unknown'"),
    ):
        with pytest.raises(gc.errors.InvalidArgument, match=message):
            gc.load_label(path, BALL, label)


def test_annotations_of_nibabel_are_read(tmp_path: Path) -> None:
    labels = np.where(BALL.vertices[:, 0] > 0.6, 1, 0)
    path = tmp_path / "rh.annot"
    colours = np.array([[25, 5, 25, 0, 0], [255, 0, 0, 0, 0]])
    nibabel.freesurfer.write_annot(path, labels, colours, ["cortex", "wall"], fill_ctab=True)
    np.testing.assert_array_equal(gc.load_label(path, BALL, "wall"), FACES)
    np.testing.assert_array_equal(gc.load_label(path, BALL, "cortex"), OUTSIDE)


def test_mutated_annotations_are_read_or_refused(tmp_path: Path) -> None:
    data, path = annotation(tmp_path).read_bytes(), tmp_path / "mutated.annot"
    refusals = []
    for number in range(200):
        path.write_bytes(mutated(Random(number), data, BYTES))
        try:
            assert gc.load_label_vertices(path, BALL, "wall").max() < len(BALL.vertices)
        except gc.errors.InvalidArgument as error:
            refusals.append(str(error))
    assert 20 < len(refusals) < 200
    assert all(refusal.startswith(f"{path} is not a label of this") for refusal in refusals)


def test_all_but_a_label_may_be_blocked(tmp_path: Path) -> None:
    for path, label in (
        (freesurfer(tmp_path), None),
        (gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL"), 7),
        (annotation(tmp_path), "wall"),
    ):
        np.testing.assert_array_equal(gc.load_label(path, BALL, label, outside=True), OUTSIDE)
        found = gc.load_label_vertices(path, BALL, label, outside=True)
        np.testing.assert_array_equal(found, np.setdiff1d(np.arange(len(BALL.vertices)), WALL))
    everywhere = freesurfer(tmp_path, np.arange(len(BALL.vertices)))
    with pytest.raises(gc.errors.InvalidArgument, match="no vertex is outside"):
        gc.load_label(everywhere, BALL, outside=True)


@pytest.mark.jit
def test_distances_from_a_label_begin_at_all_of_its_vertices(tmp_path: Path) -> None:
    found = gc.exact_distance(BALL, gc.load_label_vertices(freesurfer(tmp_path), BALL)).distances
    each = [gc.exact_distance(BALL, int(vertex)).distances for vertex in WALL]
    np.testing.assert_allclose(found, np.min(each, axis=0), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("encoding", ["ASCII", "B64BIN", "B64GZ"])
def test_each_encoding_of_gifti_compressed_or_not(tmp_path: Path, encoding: str) -> None:
    names = {0: "???", 2: "cortex", 7: "wall"}
    path = gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL", names, f"GIFTI_ENCODING_{encoding}")
    for file in (path, compressed(path)):
        np.testing.assert_array_equal(gc.load_label(file, BALL, "wall"), FACES)


def test_labels_in_capitals_and_compressed(tmp_path: Path) -> None:
    for path, label in (
        (freesurfer(tmp_path), None),
        (annotation(tmp_path), "wall"),
        (gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL"), 7),
    ):
        packed = compressed(path)
        upper = path.rename(path.with_name(path.name.upper()))
        for file in (packed, upper, compressed(upper).rename(tmp_path / f"{upper.name}.GZ")):
            np.testing.assert_array_equal(gc.load_label(file, BALL, label), FACES)
    (tmp_path / "cut.label.gz").write_bytes(packed.read_bytes()[:40])
    with pytest.raises(gc.errors.InvalidArgument, match="gzip cannot unpack"):
        gc.load_label(tmp_path / "cut.label.gz", BALL)


@pytest.mark.parametrize("intent", ["NIFTI_INTENT_SHAPE", "NIFTI_INTENT_NONE"])
def test_nan_is_no_value_but_can_be_named(tmp_path: Path, intent: str) -> None:
    values = np.where(BALL.vertices[:, 0] > 0.6, 1.5, np.nan).astype(np.float32)
    np.testing.assert_array_equal(gc.load_label(gifti(tmp_path, values, intent), BALL), FACES)
    path = gifti(tmp_path, np.where(np.isnan(values), 1.5, np.nan).astype(np.float32), intent)
    for label in ("nan", "NaN", np.nan):
        np.testing.assert_array_equal(gc.load_label(path, BALL, label), FACES)
        np.testing.assert_array_equal(gc.load_label(path, BALL, label, outside=True), OUTSIDE)
    every = gifti(tmp_path, np.full(len(BALL.vertices), np.nan, np.float32), intent)
    with pytest.raises(gc.errors.InvalidArgument, match="no vertex is in it"):
        gc.load_label(every, BALL)


def test_a_name_that_the_table_has_twice_stands_for_both(tmp_path: Path) -> None:
    values = np.where(BALL.vertices[:, 0] > 0.8, 8, parcels()).astype(np.int32)
    path = gifti(tmp_path, values, "NIFTI_INTENT_LABEL", {2: "cortex", 7: "wall", 8: "wall"})
    np.testing.assert_array_equal(gc.load_label(path, BALL, "wall"), FACES)


def test_a_label_at_no_vertex_is_refused(tmp_path: Path) -> None:
    names = {2: "cortex", 7: "wall", 9: "nowhere"}
    path = gifti(tmp_path, parcels(), "NIFTI_INTENT_LABEL", names)
    for label in ("nowhere", 9, 77, "77", "nan", -1):
        with pytest.raises(gc.errors.InvalidArgument, match=f"no vertex has the label {label!r}"):
            gc.load_label(path, BALL, label)
    zeros = gifti(tmp_path, np.zeros(len(BALL.vertices), np.float32), "NIFTI_INTENT_SHAPE")
    for empty in (freesurfer(tmp_path, WALL[:0]), zeros):
        for load in (gc.load_label, gc.load_label_vertices):
            with pytest.raises(gc.errors.InvalidArgument, match="no vertex is in it"):
                load(empty, BALL)


def test_a_label_without_a_whole_face_is_told(tmp_path: Path) -> None:
    lonely = freesurfer(tmp_path, WALL[:1])
    with pytest.warns(gc.errors.EmptyBarrier, match="1 vertices are in the label, but no face"):
        assert gc.load_label(lonely, BALL).tolist() == []
    assert gc.load_label_vertices(lonely, BALL).tolist() == WALL[:1].tolist()
    all_but_one = freesurfer(tmp_path, np.arange(1, len(BALL.vertices)))
    with pytest.warns(gc.errors.EmptyBarrier, match="outside of the label, but no face"):
        gc.load_label(all_but_one, BALL, outside=True)
    mask = np.zeros(len(BALL.vertices), np.float32)
    mask[BALL.faces[0, :2]] = 1
    with pytest.warns(gc.errors.EmptyBarrier, match="2 vertices"):
        gc.load_label(gifti(tmp_path, mask, "NIFTI_INTENT_SHAPE"), BALL)

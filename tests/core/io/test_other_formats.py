"""Files that other libraries write: GIFTI, FreeSurfer and VTK, good and bad."""

import base64
import gzip
import lzma
import re
import struct
import tracemalloc
import zlib
from collections.abc import Callable
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


@pytest.mark.jit
@pytest.mark.parametrize("name", FILES)
def test_a_file_that_was_cut_is_damaged(name: str, tmp_path: Path) -> None:
    path = FILES[name][0](tmp_path)
    content = path.read_bytes()
    for share in (0.001, 0.05, 0.3, 0.7, 0.99):
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(gc.errors.InvalidMesh):
            gc.load_mesh(path)


@pytest.mark.jit
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
    message = r"declares 2147483647 vertex elements .* 5784 bytes follow"
    with pytest.raises(gc.errors.InvalidMesh, match=message):
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


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
FLAT = [x for point in SQUARE for x in point]
ROWS = "4 2\n" + "".join(f"{x} {y} {z} 0\n" for x, y, z in SQUARE) + "0 1 2 0\n0 2 3 0\n"
TEXT = f"#!ascii version of lh.white\n{ROWS}".encode()


def three(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(3, "big") for number in numbers)


def quads(magic: bytes, form: str, unit: int, quad: tuple[int, ...]) -> bytes:
    positions = struct.pack(f">12{form}", *(unit * x for x in FLAT))
    return magic + three(4, 1) + positions + three(*quad)


SURFACES = {
    "text": TEXT,
    "text of Windows": TEXT.replace(b"\n", b"\r\n"),
    "text with comments": TEXT.replace(b"4 2", b"# more\n\n4 2"),
    "old quadrangles": quads(b"\xff\xff\xff", "h", 100, (0, 1, 2, 3)),
    "old quadrangles, odd": quads(b"\xff\xff\xff", "h", 100, (1, 2, 3, 0)),
    "new quadrangles": quads(b"\xff\xff\xfd", "f", 1, (0, 1, 2, 3)),
    "new quadrangles, odd": quads(b"\xff\xff\xfd", "f", 1, (3, 0, 1, 2)),
    "triangles": b"\xff\xff\xfeby hand\n\n"
    + struct.pack(">2i12f6i", 4, 2, *FLAT, 0, 1, 2, 0, 2, 3),
}


@pytest.mark.jit
@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("pack", [bytes, gzip.compress, lzma.compress])
def test_freesurfer_s_surfaces_of_every_kind(
    name: str, pack: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    path = tmp_path / "lh.white"
    path.write_bytes(pack(SURFACES[name]))
    mesh = gc.load_mesh(path)
    assert mesh.vertices.ravel().tolist() == FLAT
    np.testing.assert_allclose(gc.exact_distance(mesh, 0).distances, [0, 1, np.sqrt(2), 1])
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] == 1).all()
    with pytest.raises(gc.errors.TooManyFaces):
        gc.load_mesh(path, max_faces=1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (SURFACES["old quadrangles"][:-3], "take at least 36 bytes, but 33 bytes follow"),
        (SURFACES["new quadrangles"][:7], "ends before its counts"),
        (SURFACES["triangles"][:16], "ends before its counts"),
        (TEXT[:-9], "declares 4 vertex elements and 2 face elements, but 5 rows"),
        (TEXT.replace(b"4 2\n", b"four 2\n"), "no row with its counts"),
        (TEXT.replace(b"0 1 2 0\n", b"0 1\n"), "face 0 reads '0 1'; it must have three"),
        (TEXT.replace(b"1 1 0 0\n", b"1 1 x 0\n"), "vertex 2 reads '1 1 x 0'"),
        (TEXT.replace(b"0 2 3 0\n", b"0 2 9 0\n"), r"face 1 is \[0, 2, 9\]"),
        (b"#!ascii version of nothing\n", "no row with its counts"),
    ],
    ids=range(9),
)
def test_damaged_surfaces_of_freesurfer_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(gc.errors.InvalidMesh, match=message):
        gc.load_mesh(data, "freesurfer")


@pytest.mark.parametrize("encoding", ["ASCII", "B64BIN", "B64GZ"])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_gifti_in_every_encoding(encoding: str, pack: Callable[[bytes], bytes]) -> None:
    arrays = [
        GiftiDataArray(VERTICES.astype(np.float32), "NIFTI_INTENT_POINTSET", encoding=encoding),
        GiftiDataArray(FACES.astype(np.int32), "NIFTI_INTENT_TRIANGLE", encoding=encoding),
    ]
    mesh = gc.load_mesh(pack(GiftiImage(darrays=arrays).to_bytes()), "gii")
    np.testing.assert_allclose(mesh.vertices, SINGLE, atol=1e-6)
    assert mesh.faces.tolist() == FACES.tolist()


def test_gifti_with_its_arrays_in_another_file_says_so(tmp_path: Path) -> None:
    data = gifti(tmp_path).read_bytes().replace(b"GZipBase64Binary", b"ExternalFileBinary")
    with pytest.raises(gc.errors.InvalidMesh, match="are in another file: save it with them insi"):
        gc.load_mesh(data, "gii")


@pytest.mark.parametrize(
    "number", ["-1.#IND", "1.#QNAN0", "1.#INF", "-1.#INF00", "1.#SNAN", "nan", "-inf"]
)
@pytest.mark.parametrize("axis", range(3))
def test_obj_numbers_that_are_none_are_refused(number: str, axis: int) -> None:
    row = ["0", "1", "2"]
    row[axis] = number
    text = f"v 0 0 0\nv 1 0 0\nv 1 1 0\nv {' '.join(row)}\nf 1 2 3 4\n"
    with pytest.raises(gc.errors.InvalidMesh, match="vertex 3 "):
        gc.load_mesh(text.encode(), "obj")


@pytest.mark.parametrize("comment", ["# IND", "#IND", "#1.#IND"])
def test_obj_comments_stay_comments(comment: str) -> None:
    text = f"v 0 0 0 {comment}\nv 1 0 0{comment}\n{comment}\nv 1 1 0\nf 1 2 3 {comment}\n"
    assert gc.load_mesh(text.encode(), "obj").faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        # nibabel would count up to it, hours long
        (
            b'Dimensionality="2"',
            b'Dimensionality="9223372036854775807"',
            "'9223372036854775807' dim",
        ),
        (b'Dim0="162"', b'Dim0="-162"', "has '-162' rows"),
        (b'Dim0="162"', b'Dim0="1000000"', "1000000 vertices, but 1000 faces have at most 3000"),
        (b'Dim0="320"', b'Dim0="1001"', "1001 faces; at most 1000"),
        (b"</GIFTI>", b"", "is no whole XML document: no element found"),
        (b"GIFTI", b"NIFTI", "begins with the element 'NIFTI'"),
    ],
)
def test_gifti_that_lies_is_refused_at_once(
    old: bytes, new: bytes, message: str, tmp_path: Path
) -> None:
    data = gifti(tmp_path).read_bytes()
    assert old in data
    with pytest.raises(gc.errors.InvalidMesh, match=message):
        gc.load_mesh(data.replace(old, new), "gii", max_faces=1000)


def test_gifti_is_not_unpacked_beyond_its_values(tmp_path: Path) -> None:
    data = gifti(tmp_path).read_bytes()
    begin = data.index(b"<Data>") + len(b"<Data>")
    bomb = base64.b64encode(zlib.compress(bytes(50_000_000)))
    data = data[:begin] + bomb + data[data.index(b"</Data>") :]
    tracemalloc.start()
    with pytest.raises(gc.errors.InvalidMesh, match="holds more than its 486 values"):
        gc.load_mesh(data, "gii")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000


def test_gifti_of_another_number_of_arrays_is_read_without_a_warning(tmp_path: Path) -> None:
    data = gifti(tmp_path).read_bytes()
    lie = re.sub(rb'NumberOfDataArrays="\d+"', b'NumberOfDataArrays="7"', data)
    assert lie != data
    assert len(gc.load_mesh(lie, "gii").faces) == 320

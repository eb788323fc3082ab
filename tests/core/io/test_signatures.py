"""Files that are not what their name says: the error says what they are."""

from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidMesh
from tests.support.mesh_files import glb, off, ply, ply_big_endian, stl, stl_binary

pytestmark = pytest.mark.slice(8)

TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
FACE = [[0, 1, 2]]
GRID = b"ncols 2\nnrows 2\ncellsize 1\n0 0\n0 0\n"
FREESURFER = b"#!ascii version of lh.white\n3 1\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 1 2 0\n"
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n"
PAGE = b"<!DOCTYPE html>\n<html><body>404</body></html>\n"
FOUND = {
    "a PLY file": ("ply", ply(TRIANGLE, FACE)),
    "a PLY file ": ("ply", ply_big_endian(TRIANGLE, FACE)),
    "an OFF file": ("off", off(TRIANGLE, FACE)),
    "a text STL file": ("stl", stl(TRIANGLE, FACE)),
    "a binary STL file": ("stl", stl_binary(TRIANGLE, FACE)),
    "a GLB file": ("glb", glb(TRIANGLE, FACE)),
    "a VTK file": ("vtk", b"# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\n"),
    "a VTK file ": ("vtk", b'<?xml version="1.0"?>\n<VTKFile type="PolyData"/>'),
    "a GIFTI file": ("gii", b'<?xml version="1.0"?>\n<!DOCTYPE GIFTI>\n<GIFTI Version="1.0"/>'),
    "an Esri ASCII grid": ("asc", GRID),
    "a FreeSurfer surface": ("freesurfer", FREESURFER),
    "a FreeSurfer surface ": ("freesurfer", b"\xff\xff\xfe" + bytes(99)),
    "a Git LFS pointer": ("", POINTER),
    "an HTML page": ("", PAGE),
    "an HTML page ": ("", b"\n <HTML lang=en><body>"),
    "a COLLADA file": ("", b'<?xml version="1.0"?>\n<COLLADA version="1.4.1"/>'),
    "an FBX file": ("", b"Kaydara FBX Binary  \0"),
    "a Blender file": ("", b"BLENDER-v300"),
    "an HDF5 file": ("", b"\x89HDF\r\n\x1a\n"),
    "a picture": ("", b"\x89PNG\r\n\x1a\n"),
    "a PDF document": ("", b"%PDF-1.7"),
}
NAMED = ("obj", "off", "ply", "stl", "glb", "gii", "freesurfer", "asc")


@pytest.mark.parametrize("words", FOUND)
@pytest.mark.parametrize("suffix", NAMED)
def test_a_file_of_another_kind_says_what_it_is(suffix: str, words: str) -> None:
    kind, data = FOUND[words]
    if kind == suffix:
        return
    with pytest.raises(InvalidMesh) as refusal:
        gc.load_mesh(data, suffix)
    message = str(refusal.value)
    assert message.startswith(f"the {suffix.upper()} file is in fact {words.strip()}")
    if kind:
        assert message.endswith(f": give file_type={kind!r}")


@pytest.mark.parametrize("words", ["a PLY file", "an OFF file", "a text STL file", "a GLB file"])
def test_without_a_known_suffix_the_first_bytes_decide(words: str, tmp_path: Path) -> None:
    _, data = FOUND[words]
    for name in ("mesh", "mesh.txt", "lh.pial", "mesh.asc"):
        (tmp_path / name).write_bytes(data)
        assert gc.load_mesh(tmp_path / name).faces.shape == (1, 3)
    assert gc.load_mesh(data).faces.shape == (1, 3)


def test_two_formats_share_a_suffix(tmp_path: Path) -> None:
    for name, data, faces in (("a.asc", GRID, 2), ("lh.white.asc", FREESURFER, 1)):
        (tmp_path / name).write_bytes(data)
        assert len(gc.load_mesh(tmp_path / name).faces) == faces


@pytest.mark.parametrize("words", ["a Git LFS pointer", "an HTML page", "a PDF document"])
def test_what_is_no_mesh_is_named_without_a_suffix_too(words: str, tmp_path: Path) -> None:
    (tmp_path / "mesh").write_bytes(FOUND[words][1])
    for source in (tmp_path / "mesh", FOUND[words][1]):
        with pytest.raises(InvalidMesh, match=f"the file is {words}"):
            gc.load_mesh(source)

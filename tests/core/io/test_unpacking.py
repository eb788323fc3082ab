"""Files as they come: packed, in an archive, as bytes, file objects and path-like objects."""

import bz2
import gzip
import io
import lzma
import os
import tempfile
import zipfile
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import Cancelled, FileTooLarge, InvalidMesh
from tests.support.mesh_files import glb, obj, off, ply, ply_binary, stl_binary

pytestmark = pytest.mark.slice(8)

SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
FACES = [[0, 1, 2], [0, 2, 3]]
FILES: dict[str, bytes] = {
    "obj": obj(SQUARE, FACES),
    "off": off(SQUARE, FACES),
    "ply": ply_binary(SQUARE, FACES),
    "stl": stl_binary(SQUARE, FACES),
    "glb": glb(SQUARE, FACES),
}


def zipped(data: bytes, name: str = "a/mesh.obj", **others: bytes) -> bytes:
    box = io.BytesIO()
    with zipfile.ZipFile(box, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, data)
        for other, content in others.items():
            archive.writestr(other.replace("__", "/"), content)
    return box.getvalue()


PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
}


def check_square(mesh: gc.TriangleMesh) -> None:
    assert mesh.vertices.tolist() == SQUARE.tolist()
    assert mesh.faces.tolist() == FACES
    assert mesh.warnings == ()


@pytest.mark.parametrize("suffix", FILES)
@pytest.mark.parametrize("program", PACKERS)
def test_packed_files_are_unpacked_whatever_their_name(
    program: str, suffix: str, tmp_path: Path
) -> None:
    packed = PACKERS[program](FILES[suffix])
    for name in (f"mesh.{suffix}.{program}", f"mesh.{suffix}", f"MESH.{suffix.upper()}"):
        (tmp_path / name).write_bytes(packed)
        check_square(gc.load_mesh(tmp_path / name))
    check_square(gc.load_mesh(packed, suffix))


@pytest.mark.parametrize("suffix", FILES)
def test_a_zip_archive_of_one_mesh(suffix: str, tmp_path: Path) -> None:
    packed = zipped(
        FILES[suffix],
        f"a/mesh.{suffix}",
        README=b"x",
        __MACOSX__=b"x",
        **{f"__MACOSX/._mesh.{suffix}": b"x"},
    )
    (tmp_path / "download.zip").write_bytes(packed)
    check_square(gc.load_mesh(tmp_path / "download.zip"))
    check_square(gc.load_mesh(packed))
    check_square(gc.load_mesh(zipped(gzip.compress(FILES[suffix]), f"mesh.{suffix}.gz")))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (zipped(b"x", "readme.txt"), "holds none: readme.txt"),
        (zipped(b"x", "a.obj", **{"b.ply": b"y"}), "holds 2: a.obj, b.ply"),
        (zipped(FILES["obj"])[:-30], "damaged zip archive"),
        (gzip.compress(FILES["obj"])[:-9], "gzip cannot unpack the file"),
        (gzip.compress(FILES["obj"])[:20] + b"\xff" * 9, "gzip cannot unpack the file"),
        (bz2.compress(FILES["obj"])[:-9], "bzip2 cannot unpack the file"),
        (lzma.compress(FILES["obj"])[:-9], "xz cannot unpack the file"),
        (b"\xfd7zXZ\0 and nothing of it", "xz cannot unpack the file"),
    ],
    ids=range(8),
)
def test_damaged_packings_are_refused(data: bytes, message: str) -> None:
    with pytest.raises(InvalidMesh, match=message):
        gc.load_mesh(data, "obj")


@pytest.mark.parametrize("pack", [*PACKERS.values(), zipped])
def test_the_size_when_unpacked_counts(pack: Callable[[bytes], bytes]) -> None:
    data = FILES["obj"]
    check_square(gc.load_mesh(pack(data), "obj", max_bytes=len(data)))
    with pytest.raises(FileTooLarge) as refusal:
        gc.load_mesh(pack(data), "obj", max_bytes=len(data) - 1)
    assert refusal.value.max_bytes == len(data) - 1
    bomb = pack(data + b"#" * 20_000_000)
    assert len(bomb) < 100_000
    with pytest.raises(FileTooLarge):
        gc.load_mesh(bomb, "obj", max_bytes=1_000_000)


@pytest.mark.parametrize("pack", [bytes, *PACKERS.values(), zipped])
def test_reading_stops_between_its_steps(pack: Callable[[bytes], bytes]) -> None:
    """Whenever the answer becomes yes, it stops there, and asks no more."""
    data = pack(FILES["obj"])
    asked = count()
    gc.load_mesh(data, "obj", cancel=lambda: next(asked) < 0)
    steps = next(asked)
    assert steps >= 2
    for last in range(steps):
        asked = count()
        with pytest.raises(Cancelled):
            gc.load_mesh(data, "obj", cancel=lambda: next(asked) == last)  # noqa: B023
        assert next(asked) == last + 1


ENCODINGS = ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-be")


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("kind", ["obj", "off", "ply"])
def test_text_with_a_byte_order_mark(kind: str, encoding: str) -> None:
    data = {**FILES, "ply": ply(SQUARE, FACES)}[kind]
    mark = "" if encoding in ("utf-8-sig", "utf-16", "utf-32") else "\ufeff"
    encoded = (mark + data.decode()).encode(encoding)
    check_square(gc.load_mesh(encoded, kind))
    check_square(gc.load_mesh(gzip.compress(encoded), kind))


def test_text_that_ends_within_a_character_is_refused() -> None:
    with pytest.raises(InvalidMesh, match="the text is damaged, at byte"):
        gc.load_mesh(FILES["obj"].decode().encode("utf-16")[:-1], "obj")


class LikeAPath(os.PathLike[str]):
    def __init__(self, path: Path) -> None:
        self.path = path

    def __fspath__(self) -> str:
        return str(self.path)


def temporary() -> Any:
    file = tempfile.SpooledTemporaryFile()  # noqa: SIM115 - closed by the test
    file.write(FILES["obj"])
    file.seek(0)
    return file


OPENED: dict[str, Callable[[Path], Any]] = {
    "BytesIO": lambda _: io.BytesIO(FILES["obj"]),
    "BufferedReader": lambda _: io.BufferedReader(io.BytesIO(FILES["obj"])),
    "StringIO": lambda _: io.StringIO(FILES["obj"].decode()),
    "a temporary file": lambda _: temporary(),
    "an entry of an archive": lambda _: zipfile.ZipFile(  # noqa: SIM115 - as above
        io.BytesIO(zipped(FILES["obj"]))
    ).open("a/mesh.obj"),
    "gzip": lambda _: gzip.GzipFile(fileobj=io.BytesIO(gzip.compress(FILES["obj"]))),
    "bytearray": lambda _: bytearray(FILES["obj"]),
    "memoryview": lambda _: memoryview(FILES["obj"]),
    "open": lambda path: path.open("rb"),
    "open as text": lambda path: path.open(),
    "path": lambda path: path,
    "path as text": str,
    "path-like": LikeAPath,
}


@pytest.mark.parametrize("name", OPENED)
def test_whatever_can_be_read_is_a_file(name: str, tmp_path: Path) -> None:
    path = tmp_path / "square.obj"
    path.write_bytes(FILES["obj"])
    has_name = name.startswith(("open", "path"))
    for read in (
        lambda file: gc.load_mesh(file, "obj"),
        *((gc.load_mesh, gc.as_mesh) if has_name else ()),
    ):
        file = OPENED[name](path)
        check_square(read(file))
        if hasattr(file, "close"):
            file.close()


@pytest.mark.parametrize("thing", [None, 3, 3.5, object(), ["a.obj"]])
def test_what_cannot_be_read_is_named(thing: Any) -> None:
    with pytest.raises(InvalidMesh, match=f"{type(thing).__name__} is no file: give a path"):
        gc.load_mesh(thing, "obj")


def test_files_that_fail_are_refused(tmp_path: Path) -> None:
    closed = io.BytesIO(b"x")
    closed.close()
    written = (tmp_path / "w.obj").open("wb")
    for thing in (closed, written):
        with pytest.raises(InvalidMesh, match="cannot read the open file"):
            gc.load_mesh(thing, "obj")
    written.close()
    with pytest.raises(InvalidMesh, match="cannot read "):
        gc.load_mesh(tmp_path)

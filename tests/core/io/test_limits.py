"""Files that claim or hold too much are refused before it is taken for true."""

import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest

from geodesic_core.errors import InvalidMesh, TooManyFaces
from geodesic_core.io.load import load_mesh
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from tests.core.io.test_glb import glb_scene
from tests.core.io.test_load import (
    FACES,
    FANS,
    POLYGON_VERTICES,
    POLYGONAL,
    POLYGONS,
    VERTICES,
    Writer,
    every_writer,
    name_of,
    refusal,
)
from tests.support.mesh_files import glb, glb_of, glb_tree, off, ply, ply_binary


def too_many(data: bytes, kind: str, max_faces: int) -> TooManyFaces:
    with pytest.raises(TooManyFaces, match=f"at most {max_faces} are allowed") as caught:
        load_mesh(data, kind, max_faces=max_faces)
    assert caught.value.max_faces == max_faces
    return caught.value


@every_writer
def test_as_many_faces_as_are_allowed(kind: str, write: Writer) -> None:
    data = write(VERTICES, FACES)

    assert len(load_mesh(data, kind, max_faces=len(FACES)).faces) == len(FACES)
    assert too_many(data, kind, len(FACES) - 1).faces == len(FACES)


@pytest.mark.parametrize(("kind", "write"), POLYGONAL, ids=name_of)
def test_polygons_count_as_their_triangles(kind: str, write: Writer) -> None:
    data = write(POLYGON_VERTICES, POLYGONS)

    assert len(load_mesh(data, kind, max_faces=len(FANS)).faces) == len(FANS)
    assert too_many(data, kind, len(FANS) - 1).faces == len(FANS)


@every_writer
def test_too_many_faces_are_not_looked_into(
    monkeypatch: pytest.MonkeyPatch, kind: str, write: Writer
) -> None:
    side = 100
    corner = np.arange(side * side).reshape(side, side)
    steps = (corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:])
    faces = np.stack([step.ravel() for step in steps], axis=1)
    x, y = np.divmod(np.arange(side * side), side)
    data = write(np.stack([x, y, 0 * x], axis=1).astype(float), faces)
    monkeypatch.setattr(TriangleMesh, "from_polygons", lambda *_: pytest.fail("must not begin"))

    too_many(data, kind, len(faces) - 1)  # what reads it may be imported now
    tracemalloc.start()
    error = too_many(data, kind, len(faces) - 1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert error.faces == len(faces)
    assert peak < 1.1 * len(data) + 50_000  # one copy; rows of text would take several times that


@pytest.mark.parametrize("count", [20, 4_000_000_000, 10**30])
@pytest.mark.parametrize("name", ["vertex", "face"])
@pytest.mark.parametrize("write", [ply, ply_binary, off], ids=name_of)
def test_a_refusal_names_what_is_declared_and_what_there_is(
    write: Writer, name: str, count: int
) -> None:
    data = write(VERTICES[:3], FACES[:1])
    for honest, lie in {
        "vertex": ((b"vertex 3", b"vertex %d"), (b"3 1 0", b"%d 1 0")),
        "face": ((b"face 1", b"face %d"), (b"3 1 0", b"3 %d 0")),
    }[name]:
        data = data.replace(honest, lie % count)
    error = refusal(data, "off" if write is off else "ply")

    room = len(data.partition(b" 0\n" if write is off else b"end_header\n")[2])
    assert f"{count} {name} elements" in str(error)
    assert str(error).endswith(f"but {room} bytes follow")
    assert len(str(error)) < 250


@pytest.mark.parametrize("ends", [b"", b"\n"])
def test_the_shortest_rows_there_can_be_are_read(ends: bytes) -> None:
    rows = b"0 0 0\n1 0 0\n0 1 0\n" + b"1 0\n" * 8 + b"1 0" + ends
    axes = b"".join(b"property char %c\n" % axis for axis in b"xyz")
    lists = b"element face 9\nproperty list uchar char vertex_index\nend_header\n"
    header = b"ply\nformat ascii 1.0\nelement vertex 3\n" + axes + lists

    for data, kind in ((b"OFF\n3 9 0\n" + rows, "off"), (header + rows, "ply")):
        assert "there is no surface" in str(refusal(data, kind))


def test_glb_nodes_that_show_a_mesh_often_count_as_often() -> None:
    data = glb_scene([{"mesh": 0}] * 1000, list(range(1000)))

    assert too_many(data, "glb", 1999).faces == 2000
    assert len(load_mesh(data, "glb", max_faces=2000).faces) == 2000


@pytest.mark.parametrize(("mode", "faces"), [(None, 2), (4, 2), (5, 4), (6, 4), (1, 0), (0, 0)])
def test_glb_parts_that_share_their_numbers_count_each(mode: int | None, faces: int) -> None:
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    part: dict[str, Any] = tree["meshes"][0]["primitives"][0]
    if mode is not None:
        part = part | {"mode": mode}
    tree["meshes"] = [{"primitives": [part] * 300}, {"primitives": [part]}]
    tree["nodes"] = [
        {"mesh": 0, "children": [1]},
        {"mesh": 1},
        {"mesh": 0},
    ]  # the last is not shown
    data = glb_of(tree, binary)

    if faces:
        assert too_many(data, "glb", 10).faces == 301 * faces
    else:
        with pytest.raises(InvalidMesh, match="no triangles"):
            load_mesh(data, "glb", max_faces=10)


@pytest.mark.slow
@pytest.mark.jit
def test_a_small_glb_that_shows_billions_of_faces_is_refused_at_once() -> None:
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    part = tree["meshes"][0]["primitives"][0]
    tree["meshes"] = [{"primitives": [part] * 10_000}]
    tree["nodes"] = [{"mesh": 0}] * 100_000
    tree["scenes"] = [{"nodes": list(range(100_000))}]

    assert too_many(glb_of(tree, binary), "glb", 5_000_000).faces == 2_000_000_000


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("stl", b"solid\n" + b"\n" * 1_000_000),
        ("stl", b"solid\n" + b"\t" * 1_000_000),
        ("stl", b"solid\n" + b"facet\n" * 200_000),
        ("obj", b"v" + b" " * 1_000_000),
        ("obj", b"\\" * 1_000_000),
        ("obj", b"v 0 0 0\nf " + b"1/" * 500_000),
        ("off", b"OFF" + b"\n" * 1_000_000),
        ("off", b"OFF 1" + b" " * 1_000_000),
        ("ply", b"ply\n" + b"end_header " * 100_000),
        (
            "ply",
            b"ply\n" + b"".join(b"element e%d 1\n" % i for i in range(90_000)) + b"end_header\n",
        ),
        ("glb", b"glTF" + struct.pack("<3I", 2, 1_000_020, 1_000_000) + b"JSON" + b"[" * 1_000_000),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_megabyte_of_nonsense_is_refused_in_seconds(kind: str, data: bytes) -> None:
    with pytest.raises(InvalidMesh):
        load_mesh(data, kind, max_faces=5_000_000)


def test_lack_of_memory_is_no_fault_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def run_out(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr("geodesic_core.io.glb.count_faces", run_out)
    with pytest.raises(MemoryError):
        load_mesh(glb(VERTICES, FACES), "glb", max_faces=1)


def glb_with(**members: Any) -> bytes:
    tree, binary = glb_tree(np.tile(VERTICES[:4], (10, 1)), FACES[:2])
    return glb_of(tree | members, binary)


PART = {"attributes": {"POSITION": 0}, "indices": 1}
LINE = {"attributes": {"POSITION": 0}, "mode": 1}
COUNTED: dict[str, dict[str, Any]] = {
    "nodes": {"nodes": [{"mesh": 0}, *[{}] * 100_000]},
    "a chain of nodes": {"nodes": [*({"children": [i + 1]} for i in range(100_000)), {"mesh": 0}]},
    "children": {"nodes": [{"mesh": 0, "children": [1] * 100_001}, {}]},
    "roots": {"scenes": [{"nodes": [0] * 100_001}]},
    "parts of a mesh": {"meshes": [{"primitives": [PART] * 100_001}]},
    "parts of nodes": {
        "meshes": [{"primitives": [LINE] * 101}],
        "nodes": [{"children": list(range(1, 1001))}, *[{"mesh": 0}] * 1000],
    },
    "values of a document": {"scenes": [{"nodes": []}] * 500_000},
    "a long document": {"extras": " " * 2**25},
}


@pytest.mark.slow
@pytest.mark.slice(3)
@pytest.mark.parametrize("name", COUNTED)
def test_glb_scenes_are_counted_before_they_are_walked(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    walked: list[int] = []
    monkeypatch.setattr("geodesic_core.io.glb.triangles", lambda *_: walked.append(1))
    monkeypatch.setattr("geodesic_core.io.gltf_nodes._transforms", lambda _: walked.append(1))
    with pytest.raises(InvalidMesh, match="at most"):
        load_mesh(glb_with(**COUNTED[name]), "glb")
    assert not walked


def test_glb_vertices_that_parts_share_are_counted_before_they_are_copied(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    copied: list[int] = []
    monkeypatch.setattr("geodesic_core.io.glb.placed_positions", lambda *_: copied.append(1))
    often = glb_with(nodes=[{"mesh": 0}] * 100, scenes=[{"nodes": list(range(100))}])
    with pytest.raises(InvalidMesh, match="4000 vertices, but 200 faces have at most 600"):
        load_mesh(often, "glb", max_faces=200)
    assert not copied

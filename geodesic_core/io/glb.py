"""GLB files: the parts of a binary glTF scene, placed by its nodes."""

import base64
import binascii
import io
import json
import struct
from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.glb_nodes import placements
from geodesic_core.io.gltf_document import check_document
from geodesic_core.io.limits import check_face_count

_HEADER, _CHUNK_HEADER = 12, 8
_WIDTHS = {5121: 1, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of the types of components that are read"""
_FLOAT = 5126
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6

_LARGEST_DOCUMENT = 32 * 2**20
_MOST_PARTS = 10_000
"""Parts of a file; trimesh takes a quarter of a millisecond for each"""

_Part = tuple[int, int]
"""A mesh of the file, and a primitive of that mesh"""


def read_glb(data: bytes, max_faces: int | None) -> FileContents:
    """Read a GLB file; its parts are placed by the nodes of its scene, in the order of its meshes.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, or are no such file.
    TooManyFaces
        There are more faces than ``max_faces``.
    """
    import trimesh

    tree = _read_document(data)
    check_face_count(count_faces(tree), max_faces)
    primitives = {
        (mesh, number): primitive
        for mesh, content in enumerate(tree.get("meshes", []))
        for number, primitive in enumerate(content["primitives"])
    }
    if len(primitives) > _MOST_PARTS:
        raise InvalidMesh(
            f"the GLB file has {len(primitives)} parts; at most {_MOST_PARTS} can be read: join "
            "them"
        )
    shown = _shown_parts(tree)
    _check_vertex_count(tree, [primitives[part] for part, _ in shown], max_faces)
    with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
        scene = trimesh.load_scene(
            io.BytesIO(_plain(tree, primitives, data)),
            file_type="glb",
            process=False,
            skip_materials=True,
        )
    triangles = {
        name: (np.asarray(geometry.vertices), np.asarray(geometry.faces))
        for name, geometry in scene.geometry.items()
        if isinstance(geometry, trimesh.Trimesh)
    }
    vertices, faces, count, left_out = [], [], 0, 0
    for part, transform in shown:
        if _name(part) not in triangles:
            left_out += 1
            continue
        positions, corners = triangles[_name(part)]
        with np.errstate(invalid="ignore", over="ignore"):  # the mesh refuses what is not finite
            vertices.append(positions @ transform[:3, :3].T + transform[:3, 3])
            mirrored = np.linalg.det(transform[:3, :3]) < 0.0
        faces.append(corners[:, ::-1] + count if mirrored else corners + count)
        count += len(positions)
    if not faces:
        raise InvalidMesh("the GLB file's scene shows no triangles", kind="face")
    all_corners = np.concatenate(faces).reshape(-1).astype(np.int64)
    ignored = {"parts of points or lines": left_out} if left_out else {}
    notes = note_on_ignored("GLB", ignored)
    sizes = np.full(len(all_corners) // 3, 3)
    return FileContents(np.concatenate(vertices), all_corners, sizes, notes)


def _shown_parts(tree: Mapping[str, Any]) -> list[tuple[_Part, NDArray[np.float64]]]:
    """Return the parts that the scene shows, in the order of the file, each with its place."""
    shown = [
        ((mesh, number), transform)
        for mesh, transform in placements(tree)
        for number in range(len(tree["meshes"][mesh]["primitives"]))
    ]
    return sorted(shown, key=itemgetter(0))


def _plain(tree: Mapping[str, Any], primitives: Mapping[_Part, Any], data: bytes) -> bytes:
    """Return the GLB file with nothing but positions and corners, and a mesh for each part.

    What is not read, such as normals, materials and nodes, can be no fault of the file.
    """
    numbers = sorted({number for part in primitives.values() for number in _accessors_of(part)})
    place = {number: i for i, number in enumerate(numbers)}
    plain = {
        "asset": {"version": "2.0"},
        "meshes": [
            {
                "name": _name(part),
                "primitives": [
                    {"attributes": {"POSITION": place[each["attributes"]["POSITION"]]}}
                    | ({"indices": place[each["indices"]]} if "indices" in each else {})
                    | {"mode": each.get("mode", _TRIANGLES)}
                ],
            }
            for part, each in primitives.items()
        ],
        "accessors": [tree["accessors"][number] for number in numbers],
        "bufferViews": tree.get("bufferViews", []),
        "buffers": tree.get("buffers", []),
        "scenes": [{"nodes": []}],
        "scene": 0,
    }
    document = json.dumps(plain).encode()
    document += b" " * (-len(document) % 4)
    binary = memoryview(data)[_HEADER + _CHUNK_HEADER + _json_length(data) :]
    size = _HEADER + _CHUNK_HEADER + len(document) + len(binary)
    sizes = struct.pack("<II", size, len(document))
    return b"".join([data[:8], sizes, data[16:20], document, binary])


def _accessors_of(primitive: Mapping[str, Any]) -> set[int]:
    """Return the numbers of the accessors of a part's positions and corners."""
    position: int = primitive["attributes"]["POSITION"]
    return {position, primitive.get("indices", position)}


def _name(part: _Part) -> str:
    return f"{part[0]}.{part[1]}"


def _json_length(data: bytes) -> int:
    return int.from_bytes(data[12:16], "little")


def _read_document(data: bytes) -> dict[str, Any]:
    """Return the glTF document, whose lengths and counts the bytes bear out.

    trimesh reads the geometry right: what it would misread is refused.
    """
    if data[:4] != b"glTF" or len(data) < _HEADER + _CHUNK_HEADER:
        raise InvalidMesh("the GLB file does not begin with a glTF header")
    length = int.from_bytes(data[8:12], "little")
    if length != len(data):
        raise InvalidMesh(f"the GLB header declares {length} bytes, but the file has {len(data)}")
    json_length = _json_length(data)
    start = _HEADER + _CHUNK_HEADER
    if json_length > len(data) - start:
        raise InvalidMesh(
            f"the GLB file's first chunk declares {json_length} bytes, but {len(data) - start} "
            f"follow"
        )
    if json_length > _LARGEST_DOCUMENT:
        raise InvalidMesh(
            f"the GLB file's glTF document has {json_length} bytes; at most {_LARGEST_DOCUMENT} "
            "can be read: put its data into the binary chunk"
        )
    if data[4:8] != b"\2\0\0\0" or data[16:20] != b"JSON":
        raise InvalidMesh("the GLB file is not glTF 2, or its first chunk is not JSON")
    try:
        tree: dict[str, Any] = json.loads(data[start : start + json_length])
    except (ValueError, RecursionError) as error:  # a number of too many digits is no JSON error
        raise InvalidMesh(f"the GLB file's glTF document cannot be read: {error}") from error
    check_document(tree)
    _check_buffers(tree, data[start + json_length :])
    _check_accessors(tree, len(data))
    return tree


def _check_buffers(tree: Mapping[str, Any], chunks: bytes) -> None:
    """Refuse buffers and views of them that are not in the file, or not as long as they say."""
    at, binary = 0, []
    while at < len(chunks):
        length, kind = int.from_bytes(chunks[at : at + 4], "little"), chunks[at + 4 : at + 8]
        at += _CHUNK_HEADER + length
        if at > len(chunks):
            raise InvalidMesh(f"the GLB file ends within a chunk that declares {length} bytes")
        if kind == b"BIN\0":
            binary.append(length)
    for number, buffer in enumerate(tree.get("buffers", [])):
        uri = buffer.get("uri")
        if uri is None:
            held = binary.pop(0) if binary else 0
        elif uri.startswith("data:"):
            try:
                held = len(base64.b64decode(uri.partition(";base64,")[2], validate=True))
            except (binascii.Error, ValueError) as error:
                raise InvalidMesh(f"buffer {number} of the GLB file is not valid base64") from error
        else:
            raise InvalidMesh(
                f"buffer {number} of the GLB file lies in another file, {uri[:60]!r}; embed it"
            )
        if held < buffer["byteLength"]:
            raise InvalidMesh(
                f"buffer {number} of the GLB file declares {buffer['byteLength']} bytes, but has "
                f"{held}"
            )
    for number, view in enumerate(tree.get("bufferViews", [])):
        end = view.get("byteOffset", 0) + view["byteLength"]
        length = tree["buffers"][view["buffer"]]["byteLength"]
        if end > length:
            raise InvalidMesh(
                f"bufferView {number} of the GLB file ends at byte {end} of a buffer of {length}"
            )


def _check_vertex_count(
    tree: Mapping[str, Any], shown: Sequence[Mapping[str, Any]], max_faces: int | None
) -> None:
    """Refuse more vertices than faces can have, since parts may share any number of them."""
    counts = [
        tree["accessors"][each["attributes"]["POSITION"]]["count"]
        for each in shown
        if each.get("mode", _TRIANGLES) in (_TRIANGLES, _TRIANGLE_STRIP)
    ]
    if max_faces is not None and sum(counts) > 3 * max_faces:
        raise InvalidMesh(
            f"the GLB file's scene shows {sum(counts)} vertices, but {max_faces} faces have at "
            f"most {3 * max_faces}"
        )


def _check_accessors(tree: dict[str, Any], file_bytes: int) -> None:
    """Refuse counts beyond the file, and positions that trimesh would misread."""
    for number, accessor in enumerate(tree.get("accessors", [])):
        if not 0 < accessor["count"] <= file_bytes:
            raise InvalidMesh(
                f"accessor {number} of the GLB file declares {accessor['count']} elements, but the "
                f"file has {file_bytes} bytes"
            )
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode == _TRIANGLE_FAN:
                raise InvalidMesh("the GLB file has triangle fans; save it as triangles")
            position = primitive["attributes"]["POSITION"]
            for number in _accessors_of(primitive):
                _check_accessor(tree, number, is_position=number == position)
            last = primitive.get("indices", position)
            corners = tree["accessors"][last]["count"]
            if mode == _TRIANGLES and corners % 3:
                raise InvalidMesh(
                    f"accessor {last} of the GLB file has {corners} corners, which do not form "
                    "triangles"
                )


def _check_accessor(tree: Mapping[str, Any], number: int, *, is_position: bool) -> None:
    """Refuse an accessor of another type than positions or corners, or with no plain bytes."""
    accessor = tree["accessors"][number]
    kind, shape = accessor["componentType"], accessor["type"]
    if is_position and (kind, shape) != (_FLOAT, "VEC3"):
        raise InvalidMesh(f"accessor {number} of the GLB file: positions must be floats")
    if not is_position and (kind not in _WIDTHS or kind == _FLOAT or shape != "SCALAR"):
        raise InvalidMesh(f"accessor {number} of the GLB file: indices must be unsigned integers")
    view = tree["bufferViews"][accessor["bufferView"]] if "bufferView" in accessor else None
    if (
        view is None
        or "sparse" in accessor
        or "EXT_meshopt_compression" in view.get("extensions", ())
    ):
        raise InvalidMesh(
            f"accessor {number} of the GLB file is sparse or compressed; save it uncompressed"
        )
    width = _WIDTHS[kind] * (3 if is_position else 1)
    stride = view.get("byteStride", width)
    end = accessor.get("byteOffset", 0) + stride * (accessor["count"] - 1) + width
    if stride < width or end > view["byteLength"]:
        raise InvalidMesh(
            f"accessor {number} of the GLB file has {accessor['count']} elements of {width} bytes, "
            f"{stride} apart, which do not fit into its bufferView {accessor['bufferView']}"
        )


def count_faces(tree: Mapping[str, Any]) -> int:
    """Return the number of triangles in the meshes of a glTF document, or in its nodes if larger.

    Parts may share accessors, and nodes their meshes: a small file can show any number.
    """
    sizes: list[int] = [
        sum(_count_primitive_faces(tree["accessors"], part) for part in mesh["primitives"])
        for mesh in tree.get("meshes", [])
    ]
    shown: int = sum(sizes[node["mesh"]] for node in tree.get("nodes", []) if "mesh" in node)
    return max(sum(sizes), shown)


def _count_primitive_faces(accessors: Any, primitive: Mapping[str, Any]) -> int:
    corners = accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        return int(corners) // 3
    return max(0, int(corners) - 2) if mode == _TRIANGLE_STRIP else 0

"""GLB files: the parts of a binary glTF scene, placed by its nodes."""

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.limits import check_face_count

_HEADER, _CHUNK_HEADER = 12, 8
_FLOAT = 5126
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6


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

    check_face_count(count_faces(_read_document(data)), max_faces)
    scene = trimesh.load_scene(
        io.BytesIO(data), file_type="glb", process=False, skip_materials=True
    )
    order = {name: number for number, name in enumerate(scene.geometry)}
    # trimesh walks the nodes from the last to the first.
    nodes = reversed(scene.graph.nodes_geometry)
    placed = [(transform, name) for transform, name in map(scene.graph.get, nodes)]
    placed.sort(key=lambda part: order[part[1]])
    vertices, faces, count, left_out = [], [], 0, 0
    for transform, name in placed:
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            left_out += 1
            continue
        with np.errstate(invalid="ignore", over="ignore"):  # the mesh refuses what is not finite
            vertices.append(part.vertices @ transform[:3, :3].T + transform[:3, 3])
        mirrored = np.linalg.det(transform[:3, :3]) < 0.0
        faces.append(part.faces[:, ::-1] + count if mirrored else part.faces + count)
        count += len(part.vertices)
    if not faces:
        raise InvalidMesh("the GLB file's scene shows no triangles", kind="face")
    corners = np.concatenate(faces).reshape(-1).astype(np.int64)
    ignored = {"parts of points or lines": left_out} if left_out else {}
    sizes = np.full(len(corners) // 3, 3)
    return FileContents(np.concatenate(vertices), corners, sizes, note_on_ignored("GLB", ignored))


def _read_document(data: bytes) -> dict[str, Any]:
    """Return the glTF document, whose lengths and counts the bytes bear out.

    trimesh reads all of it right: what it would misread is refused.
    """
    if data[:4] != b"glTF" or len(data) < _HEADER + _CHUNK_HEADER:
        raise InvalidMesh("the GLB file does not begin with a glTF header")
    length = int.from_bytes(data[8:12], "little")
    if length != len(data):
        raise InvalidMesh(f"the GLB header declares {length} bytes, but the file has {len(data)}")
    json_length = int.from_bytes(data[12:16], "little")
    start = _HEADER + _CHUNK_HEADER
    if json_length > len(data) - start:
        raise InvalidMesh(
            f"the GLB file's first chunk declares {json_length} bytes, but {len(data) - start} "
            f"follow"
        )
    tree: dict[str, Any] = json.loads(data[start : start + json_length])
    for number, buffer in enumerate(tree.get("buffers", [])):
        if not buffer.get("uri", "data:").startswith("data:"):
            raise InvalidMesh(
                f"buffer {number} of the GLB file lies in another file, {buffer['uri'][:60]!r}; "
                f"embed it"
            )
    _check_accessors(tree, len(data))
    scenes = tree.get("scenes", [])
    children = list(scenes[tree.get("scene", 0)].get("nodes", [])) if scenes else []
    for node in tree.get("nodes", []):
        children += node.get("children", [])
    if len(set(children)) < len(children):
        raise InvalidMesh("the GLB file's nodes form no tree: one has two parents")
    return tree


def _check_accessors(tree: dict[str, Any], file_bytes: int) -> None:
    """Refuse counts beyond the file, and positions that trimesh would misread."""
    accessors, views = tree.get("accessors", []), tree.get("bufferViews", [])
    for number, accessor in enumerate(accessors):
        if not 0 < accessor["count"] <= file_bytes:
            raise InvalidMesh(
                f"accessor {number} of the GLB file declares {accessor['count']} elements, but the "
                f"file has {file_bytes} bytes"
            )
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            if primitive.get("mode") == _TRIANGLE_FAN:
                raise InvalidMesh("the GLB file has triangle fans; save it as triangles")
            position = primitive["attributes"]["POSITION"]
            kind = accessors[position]["componentType"], accessors[position]["type"]
            if kind != (_FLOAT, "VEC3"):
                raise InvalidMesh(f"accessor {position} of the GLB file: positions must be floats")
            for number in {position, primitive.get("indices", position)}:
                accessor = accessors[number]
                if (
                    "sparse" in accessor
                    or "bufferView" not in accessor
                    or "EXT_meshopt_compression"
                    in views[accessor["bufferView"]].get("extensions", ())
                ):
                    raise InvalidMesh(
                        f"accessor {number} of the GLB file is sparse or compressed; save it plain"
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

"""GLB and glTF files: the parts of a scene, placed by its nodes."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.contents import FileContents
from geodesic_core.io.gltf_accessors import Accessors
from geodesic_core.io.gltf_document import read_document
from geodesic_core.io.gltf_nodes import Nodes
from geodesic_core.io.gltf_parts import (
    Shape,
    count_faces,
    placed_positions,
    shown_parts,
    triangles,
)
from geodesic_core.io.limits import check_face_count, check_vertex_count

_HEADER, _CHUNK_HEADER = 12, 8


def read_glb(data: bytes, max_faces: int | None) -> FileContents:
    """Read a GLB file; its parts are placed by the nodes of its scene, in the order of its meshes.

    Primitives of a mesh that share their positions share vertices.
    """
    if data[:4] != b"glTF" or len(data) < _HEADER + _CHUNK_HEADER:
        raise InvalidMesh("the GLB file does not begin with a glTF header")
    length = int.from_bytes(data[8:_HEADER], "little")
    if not _HEADER + _CHUNK_HEADER <= length <= len(data):
        raise InvalidMesh(f"the GLB header declares {length} bytes, but the file has {len(data)}")
    chunks = list(_chunks(memoryview(data)[_HEADER:length]))
    if data[4:8] != b"\2\0\0\0" or chunks[0][0] != b"JSON":
        raise InvalidMesh("the GLB file is not glTF 2, or its first chunk is not JSON")
    binary = next((chunk for kind, chunk in chunks if kind == b"BIN\0"), memoryview(b""))
    left_out = {"bytes behind its end": len(data) - length}
    return _read_scene(chunks[0][1], binary, max_faces, left_out)


def read_gltf(data: bytes, max_faces: int | None) -> FileContents:
    """Read a glTF document whose buffers are embedded in it as base64; see `read_glb`."""
    return _read_scene(memoryview(data), memoryview(b""), max_faces, {})


def _chunks(rest: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    """Yield the kind and the content of each chunk of a GLB file."""
    while len(rest) > 0:
        length, kind = int.from_bytes(rest[:4], "little"), bytes(rest[4:_CHUNK_HEADER])
        rest = rest[_CHUNK_HEADER:]
        if length > len(rest):
            raise InvalidMesh(
                f"the GLB file ends within a chunk: it declares {length} bytes, but {len(rest)} "
                "follow"
            )
        yield kind, rest[:length]
        rest = rest[length:]


def _read_scene(
    document: memoryview, binary: memoryview, max_faces: int | None, left_out: Mapping[str, int]
) -> FileContents:
    """Read the scene of a document; ``left_out`` counts what lies beside it."""
    tree = read_document(document)
    accessors = Accessors(tree, binary, len(document) + len(binary))
    nodes = Nodes(tree, accessors)
    check_face_count(count_faces(tree, nodes), max_faces)
    parts, others = shown_parts(tree, nodes)
    if not parts:
        raise InvalidMesh("the glTF document's scene shows no triangles", kind="face")
    # Nodes may share any number of vertices.
    shapes = {part.shape for part in parts}
    shown = sum(nodes.instances(each.node) * accessors.count(each.position) for each in shapes)
    check_vertex_count("the glTF document's scene", shown, max_faces)
    placed: dict[Shape, tuple[int, NDArray[np.bool_]]] = {}
    vertices, faces, vertex_count, face_count = [], [], 0, 0
    for shape, primitive in parts:
        if shape not in placed:
            with np.errstate(all="ignore"):  # the mesh refuses what is not finite
                positions, is_mirrored = placed_positions(shape, nodes, accessors)
            placed[shape] = vertex_count, is_mirrored
            vertices.append(positions.reshape(-1, 3))
            vertex_count += len(vertices[-1])
        begin, is_mirrored = placed[shape]
        size = accessors.count(shape.position)
        corners = triangles(primitive, accessors)
        _check_corners(corners, size, face_count)
        numbered = corners + (begin + size * np.arange(len(is_mirrored)))[:, None, None]
        numbered[is_mirrored] = numbered[is_mirrored][:, :, ::-1]
        faces.append(numbered.reshape(-1, 3))
        face_count += len(faces[-1])
    return FileContents.of_triangles(
        np.concatenate(vertices),
        np.concatenate(faces),
        {**left_out, "parts of points or lines": others},
    )


def _check_corners(corners: NDArray[np.integer], size: int, faces_before: int) -> None:
    """Refuse corners that are no vertex of their part: they would be one of the next."""
    if corners.size and corners.max() >= size:
        face = int((corners >= size).any(axis=1).argmax())
        raise InvalidMesh(
            f"face {faces_before + face} has corners {corners[face].tolist()}, but the vertices of "
            f"its part are numbered 0 to {size - 1}",
            kind="face",
            elements=[faces_before + face],
        )

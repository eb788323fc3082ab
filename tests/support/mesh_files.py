"""Writers of mesh files, by hand, so that no reader is tested by its own writer."""

import base64
import json
import struct
from typing import Any

import numpy as np


def obj(vertices: Any, polygons: Any) -> bytes:
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    rows += ["f " + " ".join(str(i + 1) for i in polygon) for polygon in polygons]
    return ("\n".join(rows) + "\n").encode()


def off(vertices: Any, polygons: Any) -> bytes:
    rows = ["OFF", f"{len(vertices)} {len(polygons)} 0"]
    rows += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    rows += [f"{len(polygon)} " + " ".join(map(str, polygon)) for polygon in polygons]
    return ("\n".join(rows) + "\n").encode()


def ply_header(form: str, vertex_count: int, face_count: int) -> bytes:
    return (
        f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {vertex_count}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {face_count}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()


def ply(vertices: Any, polygons: Any) -> bytes:
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    rows += [f"{len(polygon)} " + " ".join(map(str, polygon)) for polygon in polygons]
    body = "\n".join(rows) + "\n"
    return ply_header("ascii", len(vertices), len(polygons)) + body.encode()


def ply_binary(vertices: Any, polygons: Any, order: str = "<") -> bytes:
    rows = [struct.pack(order + "3d", *vertex) for vertex in vertices]
    rows += [struct.pack(f"{order}B{len(each)}i", len(each), *each) for each in polygons]
    name = "binary_little_endian" if order == "<" else "binary_big_endian"
    return ply_header(name, len(vertices), len(polygons)) + b"".join(rows)


def ply_big_endian(vertices: Any, polygons: Any) -> bytes:
    return ply_binary(vertices, polygons, ">")


def stl(vertices: Any, faces: Any) -> bytes:
    rows = ["solid part"]
    for face in faces:
        corners = [f"vertex {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices)[face].tolist()]
        rows += ["facet normal 0 0 1", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*rows, "endsolid part", ""]).encode()


def stl_binary(vertices: Any, faces: Any) -> bytes:
    body = bytes(80) + struct.pack("<I", len(faces))
    for face in faces:
        body += struct.pack("<12fH", 0, 0, 1, *np.asarray(vertices)[face].ravel(), 0)
    return body


def glb_of(tree: dict[str, Any], binary: bytes = b"") -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def glb_tree(vertices: Any, faces: Any) -> tuple[dict[str, Any], bytes]:
    points = np.asarray(vertices, "<f4").tobytes()
    indices = np.asarray(faces, "<u4").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(points) + len(indices)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(indices)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
        ],
    }
    return tree, points + indices


def glb(vertices: Any, faces: Any) -> bytes:
    return glb_of(*glb_tree(vertices, faces))


class GlbFile:
    """A GLB file that grows by accessors: a scene of one node, which shows mesh 0."""

    def __init__(self) -> None:
        self.binary = b""
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, values: Any, **members: Any) -> int:
        """Add a bufferView of the bytes of an array; return its number."""
        data = np.ascontiguousarray(values).tobytes()
        at = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.binary += data + bytes(-len(data) % 4)
        self.tree["bufferViews"].append(at | members)
        return len(self.tree["bufferViews"]) - 1

    def accessor(self, values: Any, **members: Any) -> int:
        """Add an accessor of an array, (count,) or (count, width), of its own type."""
        values = np.asarray(values)
        rows, stride = values.reshape(len(values), -1), {}
        if values.ndim > 1 and rows.strides[0] % 4:  # rows of vectors begin at multiples of four
            room = np.zeros((len(rows), -(-rows.shape[1] // 4) * 4), rows.dtype)
            room[:, : rows.shape[1]] = rows
            rows, stride = room, {"byteStride": room.strides[0]}
        return self.describe(values, bufferView=self.view(rows, **stride), **members)

    def describe(self, values: Any, **members: Any) -> int:
        """Add an accessor of an array's count and type, without its bytes."""
        values = np.asarray(values)
        kinds = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
        width = 1 if values.ndim == 1 else values.shape[1]
        accessor = {
            "componentType": kinds[values.dtype.str[1:]],
            "count": len(values),
            "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[width],
        }
        self.tree["accessors"].append(accessor | members)
        return len(self.tree["accessors"]) - 1

    def sparse(self, at: Any, values: Any) -> dict[str, Any]:
        """Return the member ``sparse`` of an accessor, with its bytes added."""
        at = np.asarray(at)
        kind = {1: 5121, 2: 5123, 4: 5125}[at.itemsize]
        return {
            "count": len(at),
            "indices": {"bufferView": self.view(at), "componentType": kind},
            "values": {"bufferView": self.view(values)},
        }

    def part(self, vertices: Any, faces: Any, **members: Any) -> dict[str, Any]:
        """Return a primitive of triangles, in single precision."""
        attributes = {"POSITION": self.accessor(np.asarray(vertices, "<f4"))}
        return {
            "attributes": attributes,
            "indices": self.accessor(np.asarray(faces, "<u2").ravel()),
        } | members

    def glb(self) -> bytes:
        return glb_of(self._with_buffer({}), self.binary)

    def gltf(self) -> bytes:
        """Return the document with its buffer inside, as base64."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        return json.dumps(self._with_buffer({"uri": uri}), indent=1).encode()

    def _with_buffer(self, members: dict[str, Any]) -> dict[str, Any]:
        return self.tree | {"buffers": [{"byteLength": len(self.binary)} | members]}

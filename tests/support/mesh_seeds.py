"""Small mesh files of every format, with what files of that format may hold besides."""

import base64
import gzip
import io
import struct
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.support.mesh_files import (
    GlbFile,
    glb,
    glb_of,
    glb_tree,
    obj,
    off,
    ply,
    ply_big_endian,
    ply_binary,
    stl,
    stl_binary,
)

VERTICES = np.array(
    [[0, 0, 0], [2, 0, 0.5], [3, 1, 0], [2, 2, 0], [0, 2, 0], [3, 3, 0], [2, 4, 0], [0, 4, -1.5]]
)
POLYGONS = [[0, 1, 2, 3, 4], [3, 2, 5], [4, 3, 6, 7]]
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 2, 5]])

OBJ_WITH_ALL = b"""# by hand
mtllib none.mtl
o part
v 0 0 0 1 0.5 0
v 1.5 0 0 1 0.5 0
v 1 1 0.25 0 0 1
vt 0 0
vt 1 0
vn 0 0 1
g one
usemtl red
s 1
f 1/1/1 2/2/1 3/1/1
v 0 1e0 0
f -4//1 -2//1 \\
 -1//1
g two
v 2 2 2
f 1/2 4/1 5/2 3/1
l 1 2
p 4
"""
PLY_WITH_ALL = """ply
format ascii 1.0
comment by hand
obj_info none
element vertex 5
property float x
property float y
property double z
property float nx
property uchar red
property char quality
element face 3
property uchar flags
property list uchar uint vertex_index
property list uchar float texcoord
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0 1 255 -1
1 0 0.25 1 0 1
1 1 0 1 7 2
0 1 0 1 7 2
2 2 2 1 7 2
1 4 0 1 2 3 0
2 3 0 1 2 2 0.5 0.5
3 3 1 4 2 0
0 1
"""
BINARY_PLY_HEADER = """ply
format {form} 1.0
element edge 2
property list ushort int path
property float weight
element vertex 5
property double nx
property short x
property uchar red
property float y
property double z
element face 3
property list {count} {item} vertex_indices
property uchar flags
property list uchar float texcoord
end_header
"""


def ply_with_all(order: str, count: str, item: str) -> bytes:
    """Return a binary PLY file with faces of several sizes, and lists elsewhere; types as codes."""
    names = {"B": "uchar", "i": "int", "I": "uint", "h": "short", "H": "uint16", "b": "int8"}
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    header = BINARY_PLY_HEADER.format(form=form, count=names[count], item=names[item])
    body = struct.pack(order + "H2if", 2, 0, 1, 0.5) + struct.pack(order + "H1if", 1, 4, 0.5)
    for x, y, z in [(0, 0, 0), (1, 0, 0.25), (1, 1, 0), (0, 1, 0), (2, 2, 2)]:
        body += struct.pack(order + "dhBfd", 1, x, 7, y, z)
    for face in ([0, 1, 2, 3], [1, 4, 2], [3, 2, 4]):
        body += struct.pack(f"{order}{count}{len(face)}{item}", len(face), *face)
        body += struct.pack(order + "BBf", 1, 1, 0.5)
    return header.encode() + body


def glb_with_nodes() -> bytes:
    """Return a scene of nodes with every kind of place, and of several meshes."""
    tree, binary = glb_tree(VERTICES, TRIANGLES)
    part = tree["meshes"][0]["primitives"][0]
    tree["meshes"] = [
        {"name": "both", "primitives": [part, {"attributes": {"POSITION": 0}, "mode": 5}]},
        {"primitives": [{**part, "mode": 4, "material": 0}, {**part, "mode": 1}]},
    ]
    tree["nodes"] = [
        {"children": [1, 2], "translation": [1, 2, 3], "scale": [2, 2, -2]},
        {"mesh": 0, "rotation": [0, 0, 0.6, 0.8]},
        {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 5, 5, 1], "children": [3]},
        {"mesh": 0, "camera": 0},
    ]
    tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
    tree["materials"] = [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}]
    return glb_of(tree, binary)


def glb_with_attributes() -> bytes:
    """Return positions between normals, indices of two bytes, and a second part without any."""
    tree, _ = glb_tree(VERTICES, TRIANGLES)
    rows = np.hstack([VERTICES, np.tile([0.0, 0.0, 1.0], (len(VERTICES), 1))]).astype("<f4")
    corners = TRIANGLES.astype("<u2")
    size = rows.nbytes + corners.nbytes
    tree["buffers"] = [{"byteLength": size}]
    tree["bufferViews"] = [
        {
            "buffer": 0,
            "byteOffset": 0,
            "byteLength": rows.nbytes,
            "byteStride": 24,
            "target": 34962,
        },
        {"buffer": 0, "byteOffset": rows.nbytes, "byteLength": corners.nbytes, "target": 34963},
    ]
    vector = {"bufferView": 0, "componentType": 5126, "type": "VEC3"}
    tree["accessors"] = [
        {**vector, "count": len(VERTICES), "min": [0, 0, -1.5], "max": [3, 4, 0.5]},
        {"bufferView": 1, "componentType": 5123, "count": corners.size, "type": "SCALAR"},
        {**vector, "count": len(VERTICES), "byteOffset": 12},
        {**vector, "count": 6},
    ]
    attributes = {"POSITION": 0, "NORMAL": 2}
    tree["meshes"] = [
        {"primitives": [{"attributes": attributes, "indices": 1}]},
        {"primitives": [{"attributes": {"POSITION": 3}}]},
    ]
    tree["nodes"] = [{"mesh": 0}, {"mesh": 1, "translation": [9, 0, 0]}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    return glb_of(tree, rows.tobytes() + corners.tobytes())


def glb_with_data_uri() -> bytes:
    tree, binary = glb_tree(VERTICES, TRIANGLES)
    text = base64.b64encode(binary).decode()
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
    return glb_of(tree)


def glb_with_sparse_accessors() -> bytes:
    """Return positions of which some are replaced, and others that stand over zeros."""
    file = GlbFile()
    part = file.part(VERTICES, TRIANGLES)
    part["indices"] = file.accessor(
        TRIANGLES.astype("u1").ravel(),
        sparse=file.sparse(np.array([2, 5], "u1"), TRIANGLES[0, :2].astype("u1")),
    )
    single = VERTICES.astype("<f4")
    some = np.array([1, 3, 6], "<u2")
    over_zeros = file.describe(single, sparse=file.sparse(some, single[some]))
    file.tree["meshes"] = [
        {"primitives": [part, {**part, "attributes": {"POSITION": over_zeros}}]},
    ]
    return file.glb()


def glb_of_small_integers() -> bytes:
    """Return quantized positions, of two kinds, and triangles that share them."""
    file = GlbFile()
    file.tree["extensionsRequired"] = file.tree["extensionsUsed"] = ["KHR_mesh_quantization"]
    scaled = VERTICES * 20
    shared = {"POSITION": file.accessor(scaled.astype("<i2"))}
    normalized = {"POSITION": file.accessor(scaled.astype("i1"), normalized=True)}
    halves = [file.accessor(half.astype("u1").ravel()) for half in (TRIANGLES[:2], TRIANGLES[2:])]
    file.tree["meshes"] = [
        {"primitives": [{"attributes": shared, "indices": half} for half in halves]},
        {"primitives": [{"attributes": normalized, "mode": 6}]},
    ]
    file.tree["nodes"] = [{"mesh": 0, "scale": [0.05] * 3, "children": [1]}, {"mesh": 1}]
    return file.glb()


def glb_of_instances() -> bytes:
    """Return a mesh that is shown three times, by every kind of place."""
    file = GlbFile()
    name = "EXT_mesh_gpu_instancing"
    file.tree["extensionsRequired"] = file.tree["extensionsUsed"] = [name]
    turns = np.array([[0, 0, 0, 127], [0, 0, 76, 102], [127, 0, 0, 0]], "i1")
    attributes = {
        "TRANSLATION": file.accessor(np.arange(9, dtype="<f4").reshape(3, 3)),
        "ROTATION": file.accessor(turns, normalized=True),
        "SCALE": file.accessor(np.array([[1, 1, 1], [2, 2, 2], [1, 1, -1]], "<f4")),
    }
    file.tree["meshes"] = [{"primitives": [file.part(VERTICES, TRIANGLES)]}]
    visible = {"KHR_node_visibility": {"visible": True}}
    file.tree["nodes"] = [{"mesh": 0, "extensions": visible | {name: {"attributes": attributes}}}]
    return file.glb()


def posed() -> GlbFile:
    """Return a file of a skin of two joints and of morph targets."""
    file = GlbFile()
    part = file.part(VERTICES, TRIANGLES)
    joints = np.tile(np.array([0, 1, 0, 0], "u1"), (len(VERTICES), 1))
    shares = np.linspace(0, 1, len(VERTICES))
    weights = np.stack([shares, 1 - shares, 0 * shares, 0 * shares], axis=1)
    part["attributes"] |= {
        "JOINTS_0": file.accessor(joints),
        "WEIGHTS_0": file.accessor(np.round(weights * 255).astype("u1"), normalized=True),
    }
    moves = VERTICES[::-1].astype("<f4")
    some = np.array([2, 7], "u1")
    part["targets"] = [
        {"POSITION": file.accessor(moves)},
        {"POSITION": file.describe(moves, sparse=file.sparse(some, moves[some]))},
    ]
    file.tree["meshes"] = [{"primitives": [part], "weights": [0.25, 0.5]}]
    file.tree["nodes"] = [
        {"mesh": 0, "skin": 0, "weights": [0.5, 0.125]},
        {"translation": [1, 0, 0], "children": [2]},
        {"rotation": [0, 0.6, 0, 0.8]},
    ]
    file.tree["scenes"] = [{"nodes": [0, 1]}]
    bound = file.accessor(np.tile(np.eye(4, dtype="<f4").ravel(), (2, 1)))
    file.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": bound}]
    return file


PLY_STRIPS = """PLY
format ascii 1.0
element vertex 6
property float x
property list uchar int near
property float y
property float z
element tristrips 2
property list uchar float weights
property list int int vertex_indices
end_header
0 1 3 0 0
1 0 0 0
0 2 1 2 1 0
1 0 1 0.5
0 0 2 0
1 0 2 0
0 4 0 1 2 3
1 0.5 7 2 3 4 -1 3 4 5
and more
"""


def off_binary(keyword: str = "OFF", colours: int = 0) -> bytes:
    """Return a binary OFF file; of 4OFF with a weight of two."""
    data = f"{keyword} BINARY\n".encode() + struct.pack(">3i", len(VERTICES), len(POLYGONS), 0)
    for vertex in VERTICES:
        data += struct.pack(">3f", *vertex) + (struct.pack(">f", 2) if keyword == "4OFF" else b"")
    for polygon in POLYGONS:
        data += struct.pack(f">{len(polygon) + 2}i", len(polygon), *polygon, colours)
        data += struct.pack(f">{colours}f", *[0.5] * colours)
    return data


def ply_strips_binary(order: str) -> bytes:
    """Return a binary PLY file of strips, with a list in each vertex."""
    text = PLY_STRIPS.partition("end_header\n")[0] + "end_header\n"
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    data = text.replace("ascii", form).encode()
    for i in range(6):
        data += struct.pack(f"{order}fB{i % 2}iff", i % 2, i % 2, *[3] * (i % 2), i // 2, 0)
    data += struct.pack(order + "Bi4i", 0, 4, 0, 1, 2, 3)
    return data + struct.pack(order + "Bfi7i", 1, 0.5, 7, 2, 3, 4, -1, 3, 4, 5)


def freesurfer_text() -> bytes:
    rows = [f"#!ascii version of lh.white\n{len(VERTICES)} {len(TRIANGLES)}"]
    rows += [f"{x} {y} {z} 0" for x, y, z in VERTICES.tolist()]
    rows += [f"{a} {b} {c} 0" for a, b, c in TRIANGLES.tolist()]
    return "\n".join([*rows, ""]).encode()


def freesurfer_triangles() -> bytes:
    counts = struct.pack(">2i", len(VERTICES), len(TRIANGLES))
    body = VERTICES.astype(">f4").tobytes() + TRIANGLES.astype(">i4").tobytes()
    return b"\xff\xff\xfeby hand\n\n" + counts + body


def freesurfer_quads(magic: bytes, form: str) -> bytes:
    """Return quadrangles, whose numbers have three bytes."""
    quads = [(4, 3, 6, 7), (1, 2, 3, 0)]
    numbers = [len(VERTICES), len(quads)], [corner for quad in quads for corner in quad]
    counts, corners = (b"".join(n.to_bytes(3, "big") for n in row) for row in numbers)
    unit = 100 if form == ">i2" else 1
    return magic + counts + (unit * VERTICES).astype(form).tobytes() + corners


GRID = b"""ncols 4
nrows 3
xllcorner 0.5
yllcorner -10
cellsize 2.5
NODATA_value -9999
0 1 2 3
0 -9999 1e1 3
0.5 1 2 -1
"""


def gifti(encoding: str) -> bytes:
    """Return the surface as GIFTI, its arrays as ASCII or in base64."""
    arrays = ""
    for intent, kind, rows in (
        ("POINTSET", "FLOAT32", VERTICES.astype("<f4")),
        ("TRIANGLE", "INT32", TRIANGLES.astype("<i4")),
    ):
        data = " ".join(map(str, rows.ravel().tolist()))
        if encoding == "Base64Binary":
            data = base64.b64encode(rows.tobytes()).decode()
        arrays += (
            f'<DataArray Intent="NIFTI_INTENT_{intent}" DataType="NIFTI_TYPE_{kind}" '
            'ArrayIndexingOrder="RowMajorOrder" Dimensionality="2" '
            f'Dim0="{len(rows)}" Dim1="3" Encoding="{encoding}" Endian="LittleEndian" '
            f'ExternalFileName="" ExternalFileOffset=""><Data>{data}</Data></DataArray>\n'
        )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<GIFTI Version="1.0" NumberOfDataArrays="2">\n'
        f"{arrays}</GIFTI>\n"
    ).encode()


def zipped(data: bytes) -> bytes:
    box = io.BytesIO()
    with zipfile.ZipFile(box, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("mesh.off"), data, zipfile.ZIP_DEFLATED)
        archive.writestr(zipfile.ZipInfo("read.me"), b"")
    return box.getvalue()


def windows(data: bytes) -> bytes:
    return data.replace(b"\n", b"\r\n")


SEEDS: Mapping[str, tuple[bytes, ...]] = {
    "obj": (
        obj(VERTICES, POLYGONS),
        OBJ_WITH_ALL,
        windows(OBJ_WITH_ALL),
        b"\xef\xbb\xbf" + obj(VERTICES, TRIANGLES).replace(b"\n", b"\r"),
    ),
    "off": (
        off(VERTICES, POLYGONS),
        windows(off(VERTICES, TRIANGLES)).replace(b"OFF", b"# by hand\r\nOFF"),
        b"OFF 3 1\n0 0 0 # corner\n1 0 0\n\n0 1 0\n3 0 1 2 255 0 0\n",
        b"COFF\n3 1 3\n0 0 0 255 0 0 1\n1 0 0 0 0 0 1\n0 1 0 9 9 9 1\n3  0 1 2  0.5 0.5 0.5",
    ),
    "ply": (ply(VERTICES, POLYGONS), PLY_WITH_ALL.encode(), windows(PLY_WITH_ALL.encode())),
    "binary ply": (
        ply_binary(VERTICES, TRIANGLES),
        ply_binary(VERTICES, POLYGONS),
        ply_big_endian(VERTICES, POLYGONS),
        ply_with_all("<", "B", "i"),
        ply_with_all(">", "i", "H"),
        ply_with_all("<", "b", "b"),
    ),
    "stl": (
        stl(VERTICES, TRIANGLES),
        windows(stl(VERTICES, TRIANGLES) + stl(VERTICES + 9, TRIANGLES)),
        stl(VERTICES, TRIANGLES).upper(),
        stl(VERTICES, TRIANGLES).replace(b"\n", b"\r"),
    ),
    "binary stl": (
        stl_binary(VERTICES, TRIANGLES),
        b"solid" + stl_binary(VERTICES, TRIANGLES)[5:],
        stl_binary(VERTICES, TRIANGLES)[:80] + bytes(4) + stl_binary(VERTICES, TRIANGLES)[84:],
        stl_binary(VERTICES, TRIANGLES) + bytes(60),
    ),
    "glb": (
        glb(VERTICES, TRIANGLES),
        glb_with_nodes(),
        glb_with_attributes(),
        glb_with_data_uri(),
        glb_with_sparse_accessors(),
        glb_of_small_integers(),
        glb_of_instances(),
        posed().glb(),
    ),
    "gltf": (posed().gltf(),),
    "free off": (
        b" ".join(off(VERTICES, POLYGONS).split()),
        b"4OFF\n3\n1\n0 0 0 1 2 0\n0 2 0 2 0 2 3\t0 1 2",
        off(VERTICES, TRIANGLES).replace(b"\n", b"\r") + b"7 7\r",
    ),
    "binary off": (off_binary(), off_binary(colours=3), off_binary("4OFF") + b"behind"),
    "strips ply": (PLY_STRIPS.encode(), windows(PLY_STRIPS.encode())),
    "binary strips ply": (ply_strips_binary("<"), ply_strips_binary(">") + b"\n"),
    "freesurfer": (freesurfer_text(), windows(freesurfer_text())),
    "binary freesurfer": (
        freesurfer_triangles(),
        freesurfer_quads(b"\xff\xff\xff", ">i2"),
        freesurfer_quads(b"\xff\xff\xfd", ">f4"),
    ),
    "asc": (GRID, windows(GRID), GRID.replace(b"xllcorner", b"XLLCENTER")),
    "gii": (gifti("ASCII"), gifti("Base64Binary")),
    "packed off": (
        gzip.compress(off(VERTICES, POLYGONS), mtime=0),
        zipped(off(VERTICES, POLYGONS)),
        off(VERTICES, POLYGONS).decode().encode("utf-16"),
    ),
}
"""Files by format, text and binary ones apart"""


def type_of(name: str) -> str:
    """Return the file type of a format."""
    return name.rpartition(" ")[2]


def glb_parts(data: bytes) -> tuple[bytes, bytes]:
    """Return the glTF document and the binary chunk of a GLB file."""
    size = int.from_bytes(data[12:16], "little")
    return data[20 : 20 + size], data[28 + size :]


def glb_around(document: bytes, binary: bytes) -> bytes:
    """Return the GLB file of a glTF document, which may be no JSON."""
    document += b" " * (-len(document) % 4)
    body = struct.pack("<I4s", len(document), b"JSON") + document
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def json_mesh() -> dict[str, Any]:
    return {"vertices": VERTICES.tolist(), "faces": TRIANGLES.tolist()}

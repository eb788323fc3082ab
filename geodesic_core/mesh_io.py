"""Mesh files: their bytes become vertex and face arrays in the file's own numbering.

trimesh reads the numbers. What a file claims is checked here first, since trimesh (5.2) trusts it:

- It splits OBJ and PLY vertices at texture seams, groups OBJ faces by material in reverse, groups
  polygons by their number of corners, and asks for Pillow once there is a texture. So it is given
  positions and polygons alone, in order.
- It takes OBJ index 0 for 1, counts OBJ's relative indices from the end of the file, and drops
  faces of two corners and rows missing at the end. So rows and counts are checked.
- It reads sparse or compressed glTF positions as zeros. So they are refused.

It never sees a path, nor gets a resolver: a file cannot make it read another one.
"""

import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from trimesh.exchange.obj import load_obj
from trimesh.exchange.off import load_off
from trimesh.exchange.ply import load_ply
from trimesh.exchange.stl import load_stl

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.mesh import Merge, TriangleMesh

Arrays = tuple[Floats, Longs]


def load_mesh(
    source: str | Path | bytes | bytearray | memoryview,
    file_type: str | None = None,
    merge: Merge = "none",
) -> TriangleMesh:
    """Read a mesh file: OBJ, OFF, PLY, STL or GLB.

    Vertices keep the file's numbering and faces its order; polygons become fans from their first
    corner, in place. The parts of a GLB scene are placed by its nodes and put one after the other,
    in the order of its meshes. An STL file has no numbering: its equal corners are always merged,
    in order of first appearance, and ``mesh.vertex_map[3 * face + corner]`` is the vertex.

    Parameters
    ----------
    source
        A path, or the bytes of a file.
    file_type
        ``"obj"``, ``"off"``, ``"ply"``, ``"stl"`` or ``"glb"``; by default the suffix of the path.
    merge
        ``"exact"`` merges vertices at equal positions, as `TriangleMesh` does.

    Raises
    ------
    InvalidMesh
        The file cannot be read, is no such file, is damaged, claims more than it holds, or holds a
        mesh that `TriangleMesh` refuses.
    """
    if isinstance(source, str | Path):
        kind = _known_kind(file_type or Path(source).suffix)
        data = _bytes_of(Path(source))
    else:
        kind = _known_kind(file_type or "")
        data = bytes(source)
    if not data:
        raise InvalidMesh(f"the {kind.upper()} file is empty")
    try:
        vertices, faces = _READERS[kind](data)
    except InvalidMesh:
        raise
    except Exception as error:  # trimesh raises whatever its parsing stumbles over
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidMesh(f"the {kind.upper()} file is damaged: {what}") from error
    if len(faces) == 0:
        raise InvalidMesh(f"the {kind.upper()} file holds no faces", kind="face")
    return TriangleMesh(vertices, faces, merge="exact" if kind == "stl" else merge)


def _known_kind(file_type: str) -> str:
    kind, known = file_type.lower().removeprefix("."), ", ".join(_READERS)
    if not kind:
        raise InvalidMesh(f"the file type is missing; say which of {known} it is")
    if kind not in _READERS:
        raise InvalidMesh(f"unknown mesh file type {kind!r}; known are {known}")
    return kind


def _bytes_of(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidMesh(f"cannot read {path}: {reason}") from error


# OBJ ---------------------------------------------------------------------------------------------

_CONTINUATION = re.compile(rb"\\\r?\n")
_OBJ_ROW = re.compile(rb"^[ \t]*([vf])[ \t]+([^#\r\n]*)", re.MULTILINE)
_NUMBER = rb"[-+]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|(?i:nan|inf(?:inity)?))"
_CORNER = rb"-?0*[1-9]\d{0,17}(?:/-?\d*){0,2}"
_VERTEX_ROW = re.compile(rb"[ \t]*" + _NUMBER + rb"(?:[ \t]+" + _NUMBER + rb"){2,}[ \t]*")
_OBJ_FACE = re.compile(_CORNER + rb"(?:[ \t]+" + _CORNER + rb"){2,}[ \t]*")
_NOT_POSITION = re.compile(rb"/\S*")


def _read_obj(data: bytes) -> Arrays:
    rows = _OBJ_ROW.findall(_CONTINUATION.sub(b" ", data))
    vertex_rows = [row for keyword, row in rows if keyword == b"v"]
    face_rows = [row for keyword, row in rows if keyword == b"f"]
    _refuse_row(vertex_rows, _VERTEX_ROW, "vertex", "it must have three numbers")
    _refuse_row(face_rows, _OBJ_FACE, "face", "it must have three vertices or more, from 1")
    if not face_rows:
        raise InvalidMesh("the OBJ file holds no faces", kind="face")
    if any(b"-" in row for row in face_rows):
        face_rows = _absolute(rows)
    face_rows = _NOT_POSITION.sub(b"", b"\n".join(face_rows)).split(b"\n")
    _refuse_out_of_range(face_rows, 1, len(vertex_rows))
    triangles = _fans([row.split() for row in face_rows])
    text = b"".join(
        [b"v %b\n" % row for row in vertex_rows] + [b"f %b\n" % row for row in triangles]
    )
    read = load_obj(io.BytesIO(text), skip_materials=True, maintain_order=True)
    (geometry,) = read["geometry"].values()
    return geometry["vertices"], geometry["faces"]


def _refuse_row(rows: list[bytes], pattern: re.Pattern[bytes], kind: str, rule: str) -> None:
    bad = next((i for i, row in enumerate(rows) if not pattern.fullmatch(row)), None)
    if bad is not None:
        raise InvalidMesh(
            f"{kind} {bad} reads {_clip(rows[bad])}; {rule}", kind=kind, elements=[bad]
        )


def _clip(row: bytes) -> str:
    text = row.decode("ascii", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _absolute(rows: list[tuple[bytes, bytes]]) -> list[bytes]:
    """Return the face rows with relative indices (-1 is the last vertex so far) made absolute."""
    so_far = 0
    absolute: list[bytes] = []
    for keyword, row in rows:
        if keyword == b"v":
            so_far += 1
            continue
        corners = [int(corner.partition(b"/")[0]) for corner in row.split()]
        if min(corners) < -so_far:
            raise InvalidMesh(
                f"face {len(absolute)} reads {_clip(row)}, but only {so_far} vertices precede it",
                kind="face",
                elements=[len(absolute)],
            )
        absolute.append(b" ".join(b"%d" % (c if c > 0 else c + so_far + 1) for c in corners))
    return absolute


def _refuse_out_of_range(rows: list[bytes], first: int, count: int) -> None:
    """Refuse rows of vertex indices outside ``first`` to ``first + count - 1``."""
    indices = np.array(b" ".join(rows).split(), dtype=np.int64)
    if indices.min() >= first and indices.max() < first + count:
        return
    valid = range(first, first + count)
    bad = next(i for i, row in enumerate(rows) if any(int(c) not in valid for c in row.split()))
    raise InvalidMesh(
        f"face {bad} reads {_clip(rows[bad])}, but the file's vertices are numbered {first} to "
        f"{first + count - 1}",
        kind="face",
        elements=[bad],
    )


# OFF ---------------------------------------------------------------------------------------------

_COMMENT = re.compile(rb"#.*")
_OFF_HEADER = re.compile(rb"\s*(?:ST)?C?N?OFF\b\s*(-?\d+)[ \t]+(-?\d+)(?:[ \t]+-?\d+)?[ \t\r]*\n")


def _read_off(data: bytes) -> Arrays:
    text = _COMMENT.sub(b"", data) if b"#" in data else data
    header = _OFF_HEADER.match(text)
    if header is None:
        raise InvalidMesh("the OFF file does not begin with OFF and its counts as ASCII numbers")
    vertex_count, face_count = int(header[1]), int(header[2])
    rows = [row for row in text[header.end() :].splitlines() if row.strip()]
    _refuse_missing_rows({"vertex": vertex_count, "face": face_count}, len(rows))
    if face_count == 0:
        raise InvalidMesh("the OFF file holds no faces", kind="face")
    vertex_rows = rows[:vertex_count]
    _refuse_row(vertex_rows, _VERTEX_ROW, "vertex", "it must have three numbers")
    polygons = _polygons(rows[vertex_count : vertex_count + face_count])
    _refuse_out_of_range([b" ".join(polygon) for polygon in polygons], 0, vertex_count)
    triangles = [b"3 " + triangle for triangle in _fans(polygons)]
    counts = b"%d %d 0" % (vertex_count, len(triangles))
    read = load_off(io.BytesIO(b"\n".join([b"OFF", counts, *vertex_rows, *triangles])))
    return read["vertices"], read["faces"]


def _polygons(rows: list[bytes], skipped: int = 0) -> list[list[bytes]]:
    """Return the corners of face rows: ``skipped`` words, a count, that many indices, anything."""
    polygons = []
    for face, row in enumerate(rows):
        words = row.split()[skipped:]
        if not words or not words[0].isdigit() or not 3 <= int(words[0]) < len(words):
            raise InvalidMesh(
                f"face {face} reads {_clip(row)}; it must have a count of three or more, then as "
                f"many vertices",
                kind="face",
                elements=[face],
            )
        polygons.append(words[1 : int(words[0]) + 1])
    return polygons


def _fans(polygons: list[list[bytes]]) -> list[bytes]:
    """Return the rows of the polygons' triangles, each polygon a fan from its first corner."""
    return [
        b"%b %b %b" % (corners[0], corners[i], corners[i + 1])
        for corners in polygons
        for i in range(1, len(corners) - 1)
    ]


def _refuse_missing_rows(counts: dict[str, int], rows: int) -> None:
    if sum(counts.values()) != rows or min(counts.values()) < 0:
        raise InvalidMesh(f"the header declares {_claim(counts)}, but {rows} rows follow")


def _claim(counts: dict[str, int]) -> str:
    return " and ".join(f"{count} {name} elements" for name, count in counts.items())


# PLY ---------------------------------------------------------------------------------------------

_PLY_HEADER = re.compile(rb"ply[ \t]*\r?\n(.*?)^end_header[ \t]*\r?\n", re.DOTALL | re.MULTILINE)
_PLY_FORMATS = (b"ascii", b"binary_little_endian", b"binary_big_endian")
_PLY_NAMES = {
    "vertex": (b"x", b"y", b"z"),
    "face": (b"vertex_indices", b"vertex_index"),
}


class _Element(NamedTuple):
    size: int
    properties: list[list[bytes]]


def _read_ply(data: bytes) -> Arrays:
    header = _PLY_HEADER.match(data)
    if header is None:
        raise InvalidMesh("the PLY file has no header from 'ply' to 'end_header'")
    form, elements = _ply_elements(header[1])
    counts = {name: element.size for name, element in elements.items()}
    for name in _PLY_NAMES:
        if not counts.get(name):
            raise InvalidMesh(f"the PLY file holds no {name} elements", kind="face")
    _place_of_corners(elements["face"])
    body = data[header.end() :]
    if form == b"ascii":
        elements, body = _plain_triangles(elements, counts, body)
    elif sum(counts.values()) > len(body):
        raise InvalidMesh(f"the header declares {_claim(counts)}, but {len(body)} bytes follow")
    read = load_ply(io.BytesIO(_ply_header(form, elements) + body))
    faces = read["faces"].astype(np.int64)
    if faces.ndim != 2 or faces.shape[1] < 3:
        raise InvalidMesh("the PLY file's faces have fewer than three corners", kind="face")
    fans = np.stack([faces[:, [0, i, i + 1]] for i in range(1, faces.shape[1] - 1)], axis=1)
    return read["vertices"], fans.reshape(-1, 3)


def _ply_elements(header: bytes) -> tuple[bytes, dict[str, _Element]]:
    """Return the format and the elements; what is no geometry gets a name of no meaning.

    trimesh would act on texture coordinates, colours and edges; this way it only steps over them.
    """
    form = b""
    elements: dict[str, _Element] = {}
    for number, line in enumerate(header.splitlines()):
        match line.split():
            case [b"format", form, _] if form in _PLY_FORMATS:
                pass
            case [b"element", word, count] if count.isdigit():
                name = word.decode() if word in (b"vertex", b"face") else f"other{number}"
                if name in elements:
                    raise InvalidMesh(f"the PLY header says {_clip(line)} twice")
                elements[name] = _Element(int(count), [])
            case [b"property", *kind, word] if elements:
                known = word in _PLY_NAMES.get(name, ())
                elements[name].properties.append([*kind, word if known else b"other%d" % number])
            case [] | [b"comment" | b"obj_info", *_]:
                pass
            case _:
                raise InvalidMesh(f"the PLY header has an unknown line, {_clip(line)}")
    if not form:
        raise InvalidMesh("the PLY header names no format")
    return form, elements


def _place_of_corners(face: _Element) -> int:
    for place, words in enumerate(face.properties):
        if words[0] == b"list" and len(words) == 4 and words[-1] in _PLY_NAMES["face"]:
            return place
    raise InvalidMesh("the PLY faces have no property 'list … vertex_indices'", kind="face")


def _ply_header(form: bytes, elements: dict[str, _Element]) -> bytes:
    lines = [b"ply", b"format %b 1.0" % form]
    for name, element in elements.items():
        lines.append(b"element %b %d" % (name.encode(), element.size))
        lines += [b" ".join([b"property", *words]) for words in element.properties]
    return b"\n".join([*lines, b"end_header\n"])


def _plain_triangles(
    elements: dict[str, _Element], counts: dict[str, int], body: bytes
) -> tuple[dict[str, _Element], bytes]:
    """Return the elements and rows of an ASCII body with nothing but vertices and triangles."""
    rows = [row for row in body.splitlines() if row.strip()]
    _refuse_missing_rows(counts, len(rows))
    blocks, start = {}, 0
    for name, count in counts.items():
        blocks[name] = rows[start : start + count]
        start += count
    _refuse_row(blocks["vertex"], _VERTEX_ROW, "vertex", "it must have three numbers")
    at = _place_of_corners(elements["face"])
    if any(words[0] == b"list" for words in elements["face"].properties[:at]):
        raise InvalidMesh("the PLY faces have another list before their vertex_indices")
    polygons = _polygons(blocks["face"], skipped=at)
    _refuse_out_of_range([b" ".join(polygon) for polygon in polygons], 0, counts["vertex"])
    triangles = [b"3 " + triangle for triangle in _fans(polygons)]
    plain = {
        "vertex": elements["vertex"],
        "face": _Element(len(triangles), [[b"list", b"uchar", b"int", b"vertex_indices"]]),
    }
    return plain, b"\n".join([*blocks["vertex"], *triangles])


# STL ---------------------------------------------------------------------------------------------

_STL_HEADER, _STL_TRIANGLE = 84, 50
_STL_FACET = re.compile(rb"^\s*facet\b", re.MULTILINE | re.IGNORECASE)
_STL_VERTEX = re.compile(rb"^[ \t]*vertex\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)


def _read_stl(data: bytes) -> Arrays:
    triangles = int.from_bytes(data[_STL_HEADER - 4 : _STL_HEADER], "little")
    expected = _STL_HEADER + triangles * _STL_TRIANGLE
    if len(data) != expected:
        facets = len(_STL_FACET.findall(data))
        if not facets or data.lstrip()[:5].lower() != b"solid":
            raise InvalidMesh(
                f"the STL file is neither ASCII nor binary: its header declares {triangles} "
                f"triangles, which take {expected} bytes, but it has {len(data)}"
            )
        corners = _STL_VERTEX.findall(data)
        _refuse_row(corners, _VERTEX_ROW, "vertex", "it must have three numbers")
        if len(corners) != 3 * facets:
            raise InvalidMesh(f"the STL file has {facets} facets, but {len(corners)} corners")
        triangles = facets
    read = load_stl(io.BytesIO(data))
    parts = read["geometry"].values() if "geometry" in read else [read]
    vertices = np.concatenate([np.empty((0, 3)), *(part["vertices"] for part in parts)])
    if len(vertices) != 3 * triangles:
        raise InvalidMesh(
            f"the STL file is cut short or damaged: it begins {triangles} triangles, but "
            f"{len(vertices)} corners are complete"
        )
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


# GLB ---------------------------------------------------------------------------------------------

_GLB_HEADER, _CHUNK_HEADER = 12, 8
_FLOAT, _TRIANGLE_FAN = 5126, 6


def _read_glb(data: bytes) -> Arrays:
    _refuse_bad_glb(data)
    scene = trimesh.load_scene(
        io.BytesIO(data), file_type="glb", process=False, skip_materials=True
    )
    order = {name: number for number, name in enumerate(scene.geometry)}
    # trimesh walks the nodes from the last to the first.
    nodes = reversed(scene.graph.nodes_geometry)
    placed = [(transform, name) for transform, name in map(scene.graph.get, nodes)]
    placed.sort(key=lambda place: order[place[1]])
    vertices, faces, count = [], [], 0
    for transform, name in placed:
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            continue  # points and lines are no surface
        with np.errstate(invalid="ignore", over="ignore"):  # the mesh refuses what is not finite
            vertices.append(part.vertices @ transform[:3, :3].T + transform[:3, 3])
        mirrored = np.linalg.det(transform[:3, :3]) < 0.0
        faces.append(part.faces[:, ::-1] + count if mirrored else part.faces + count)
        count += len(part.vertices)
    if not faces:
        raise InvalidMesh("the GLB file's scene shows no triangles", kind="face")
    return np.concatenate(vertices), np.concatenate(faces)


def _refuse_bad_glb(data: bytes) -> None:
    """Refuse lengths and counts that the bytes do not bear out, and what trimesh would misread."""
    if data[:4] != b"glTF" or len(data) < _GLB_HEADER + _CHUNK_HEADER:
        raise InvalidMesh("the GLB file does not begin with a glTF header")
    length = int.from_bytes(data[8:12], "little")
    if length != len(data):
        raise InvalidMesh(f"the GLB header declares {length} bytes, but the file has {len(data)}")
    json_length = int.from_bytes(data[12:16], "little")
    start = _GLB_HEADER + _CHUNK_HEADER
    if json_length > len(data) - start:
        raise InvalidMesh(
            f"the GLB file's first chunk declares {json_length} bytes, but {len(data) - start} "
            f"follow"
        )
    tree = json.loads(data[start : start + json_length])
    for number, buffer in enumerate(tree.get("buffers", [])):
        if not buffer.get("uri", "data:").startswith("data:"):
            raise InvalidMesh(
                f"buffer {number} of the GLB file lies in another file, {buffer['uri'][:60]!r}; "
                f"embed it"
            )
    _refuse_bad_accessors(tree, len(data))
    scenes = tree.get("scenes", [])
    children = list(scenes[tree.get("scene", 0)].get("nodes", [])) if scenes else []
    for node in tree.get("nodes", []):
        children += node.get("children", [])
    if len(set(children)) < len(children):
        raise InvalidMesh("the GLB file's nodes form no tree: one has two parents")


def _refuse_bad_accessors(tree: dict[str, Any], file_bytes: int) -> None:
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


_Reader = Callable[[bytes], Arrays]
_READERS: dict[str, _Reader] = {
    "obj": _read_obj,
    "off": _read_off,
    "ply": _read_ply,
    "stl": _read_stl,
    "glb": _read_glb,
}

"""Mesh files: their bytes become vertices and polygons in the file's own numbering.

OBJ, OFF and PLY are read here: the reader of trimesh (5.2) splits vertices at texture seams, groups
faces by material or by their number of corners, refuses binary PLY files that mix these, drops what
is too short and trusts what a file claims. trimesh reads STL and GLB; what such a file claims is
checked first, and sparse or compressed glTF positions are refused, which it would read as zeros. It
never sees a path, nor gets a resolver: a file cannot make it read another one.
"""

import codecs
import io
import json
import re
import struct
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.stl import load_stl

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.limits import claim_of, glb_faces, refuse_claim, refuse_more_faces
from geodesic_core.mesh.triangle_mesh import Merge, TriangleMesh


class Read(NamedTuple):
    """What a file holds."""

    vertices: Floats
    """(V, 3)"""
    corners: Longs
    """(C,): vertices of all polygons, one polygon after the other"""
    sizes: Longs
    """(P,): how many corners each polygon has"""
    notes: tuple[str, ...] = ()
    """A sentence on what was left out."""


def load_mesh(
    source: str | Path | bytes | bytearray | memoryview,
    file_type: str | None = None,
    merge: Merge = "none",
    *,
    max_faces: int | None = None,
) -> TriangleMesh:
    """Read a mesh file: OBJ, OFF, PLY, STL or GLB.

    Vertices keep the file's numbering and faces its order; polygons become triangles, in place, and
    ``mesh.face_map`` leads from these to the polygon. What is no surface (lines, points, curves) is
    left out, and ``mesh.warnings`` say so. The parts of a GLB scene are placed by its nodes and put
    one after the other, in the order of its meshes. An STL file has no numbering: its equal corners
    are always merged, in order of first appearance, and
    ``mesh.vertex_map[3 * face + corner]`` is the vertex.

    Parameters
    ----------
    source
        A path, or the bytes of a file.
    file_type
        ``"obj"``, ``"off"``, ``"ply"``, ``"stl"`` or ``"glb"``; by default the suffix of the path.
    merge
        ``"exact"`` merges vertices at equal positions, as `TriangleMesh` does.
    max_faces
        More triangles than that are refused: by what the header declares, else by counting, and in
        any case before they are looked into.

    Raises
    ------
    TooManyFaces
        There are more than ``max_faces``; an `InvalidMesh` as well.
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
        read = _READERS[kind](data.removeprefix(codecs.BOM_UTF8), max_faces)
    except InvalidMesh:
        raise
    except MemoryError:
        raise
    except Exception as error:  # whatever parsing stumbles over
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidMesh(f"the {kind.upper()} file is damaged: {what}") from error
    if len(read.sizes) == 0:
        raise InvalidMesh(f"the {kind.upper()} file holds no faces", kind="face")
    refuse_more_faces(int(np.maximum(read.sizes - 2, 1).sum()), max_faces)
    return TriangleMesh.from_polygons(
        read.vertices, read.corners, read.sizes, "exact" if kind == "stl" else merge, read.notes
    )


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

_COMMENT = re.compile(rb"#.*")
_CONTINUATION = re.compile(rb"\\[ \t]*\r?\n")
_OBJ_ROW = re.compile(rb"^[ \t]*(v|f|l|p|curv2?|surf)[ \t]+([^#\r\n]*)", re.MULTILINE)
_OBJ_FACE_ROW = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
_NUMBER = rb"[-+]?(?:(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|(?i:nan|inf(?:inity)?))"
_CORNER = rb"-?0*[1-9]\d{0,17}(?:/-?\d*){0,2}"
_VERTEX_ROW = re.compile(rb"[ \t]*" + _NUMBER + rb"(?:[ \t]+" + _NUMBER + rb"){2,}[ \t\r]*")
_VERTEX_RULE = "it must have three numbers"
_OBJ_FACE = re.compile(rb"[ \t]*" + _CORNER + rb"(?:[ \t]+" + _CORNER + rb")*[ \t]*")
_NOT_POSITION = re.compile(rb"/\S*")
_OBJ_IGNORED = {b"l": "lines", b"p": "points", b"surf": "surfaces"}


def _read_obj(data: bytes, max_faces: int | None) -> Read:
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    if b"\\" in data:  # a comment may end in one
        data = _CONTINUATION.sub(b" ", _COMMENT.sub(b"", data))
    _refuse_counted(_OBJ_FACE_ROW, data, max_faces)
    rows = _OBJ_ROW.findall(data)
    vertex_rows = [row for keyword, row in rows if keyword == b"v"]
    face_rows = [row for keyword, row in rows if keyword == b"f"]
    _refuse_row(vertex_rows, _VERTEX_ROW, "vertex", _VERTEX_RULE)
    _refuse_row(face_rows, _OBJ_FACE, "face", "it must have vertices, which are numbered from 1")
    if not face_rows:
        raise InvalidMesh("the OBJ file holds no faces", kind="face")
    so_far = np.cumsum([keyword == b"v" for keyword, _ in rows])
    so_far = so_far[[keyword == b"f" for keyword, _ in rows]]
    corners, sizes = _corners(_NOT_POSITION.sub(b"", b"\n".join(face_rows)).split(b"\n"))
    # -1 is the last vertex so far.
    corners = np.where(corners < 0, corners + np.repeat(so_far, sizes), corners - 1)
    bad = np.flatnonzero((corners < 0) | (corners >= len(vertex_rows)))
    if len(bad):
        face = int(np.searchsorted(np.cumsum(sizes), bad[0], side="right"))
        raise InvalidMesh(
            f"face {face} reads {_clip(face_rows[face])}, but the file's vertices are numbered 1 "
            f"to {len(vertex_rows)}, and {so_far[face]} precede the face",
            kind="face",
            elements=[face],
        )
    ignored = Counter(_OBJ_IGNORED.get(k, "curves") for k, _ in rows if k not in (b"v", b"f"))
    return Read(_table(vertex_rows, 3), corners, sizes, _notes("OBJ", ignored))


def _refuse_counted(face: re.Pattern[bytes], data: bytes, max_faces: int | None) -> None:
    if max_faces is not None:
        refuse_more_faces(sum(1 for _ in face.finditer(data)), max_faces)


def _refuse_row(rows: list[bytes], pattern: re.Pattern[bytes], kind: str, rule: str) -> None:
    bad = next((i for i, row in enumerate(rows) if not pattern.fullmatch(row)), None)
    if bad is not None:
        raise InvalidMesh(
            f"{kind} {bad} reads {_clip(rows[bad])}; {rule}", kind=kind, elements=[bad]
        )


def _clip(row: bytes) -> str:
    text = row.decode("ascii", "replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _table(rows: list[bytes], columns: int) -> Floats:
    """Return the first numbers of rows that have as many, or more."""
    words = b" ".join(rows).split()
    if len(words) != columns * len(rows):
        words = [word for row in rows for word in row.split(None, columns)[:columns]]
    return np.array(words, dtype=np.float64).reshape(-1, columns)


def _corners(rows: list[bytes]) -> tuple[Longs, Longs]:
    """Return the numbers of rows, one after the other, and how many each has."""
    words = [row.split() for row in rows]
    flat = [word for row in words for word in row]
    return np.array(flat, dtype=np.int64), np.array([len(row) for row in words], dtype=np.int64)


def _notes(kind: str, ignored: Mapping[str, int]) -> tuple[str, ...]:
    if not ignored:
        return ()
    what = ", ".join(f"{count} {name}" for name, count in ignored.items())
    return (f"The {kind} file also holds {what}, which are no part of the surface: left out.",)


# OFF ---------------------------------------------------------------------------------------------

_OFF_HEADER = re.compile(rb"\s*(?:ST)?C?N?OFF\b\s*(-?\d+)[ \t]+(-?\d+)(?:[ \t]+-?\d+)?[ \t\r]*\n")


_OFF_LEAST_BYTES = {"vertex": len("0 0 0\n"), "face": len("1 0\n")}


def _read_off(data: bytes, max_faces: int | None) -> Read:
    text = _COMMENT.sub(b"", data) if b"#" in data else data
    header = _OFF_HEADER.match(text)
    if header is None:
        raise InvalidMesh("the OFF file does not begin with OFF and its counts as ASCII numbers")
    vertex_count, face_count = int(header[1]), int(header[2])
    counts = {"vertex": vertex_count, "face": face_count}
    refuse_claim(counts, _OFF_LEAST_BYTES, len(text) - header.end())
    refuse_more_faces(face_count, max_faces)
    rows = [row for row in text[header.end() :].splitlines() if row.strip()]
    _refuse_missing_rows(counts, len(rows))
    if face_count == 0:
        raise InvalidMesh("the OFF file holds no faces", kind="face")
    vertex_rows = rows[:vertex_count]
    _refuse_row(vertex_rows, _VERTEX_ROW, "vertex", _VERTEX_RULE)
    return Read(_table(vertex_rows, 3), *_corners(_polygons(rows[vertex_count:])))


def _polygons(rows: list[bytes], skipped: int = 0) -> list[bytes]:
    """Return the corners of face rows: ``skipped`` words, a count, that many indices, anything."""
    polygons = []
    for face, row in enumerate(rows):
        words = row.split()[skipped:]
        if not words or not words[0].isdigit() or not 1 <= int(words[0]) < len(words):
            raise InvalidMesh(
                f"face {face} reads {_clip(row)}; it must have a count, then as many vertices",
                kind="face",
                elements=[face],
            )
        polygons.append(b" ".join(words[1 : int(words[0]) + 1]))
    return polygons


def _refuse_missing_rows(counts: dict[str, int], rows: int) -> None:
    if sum(counts.values()) != rows:
        raise InvalidMesh(f"the header declares {claim_of(counts)}, but {rows} rows follow")


# PLY ---------------------------------------------------------------------------------------------

_PLY_HEADER = re.compile(rb"ply[ \t]*\r?\n(.*?)^end_header[ \t]*\r?\n", re.DOTALL | re.MULTILINE)
_PLY_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_PLY_TYPES = {
    name: code
    for code, names in {
        "b": b"char int8",
        "B": b"uchar uint8",
        "h": b"short int16",
        "H": b"ushort uint16",
        "i": b"int int32",
        "I": b"uint uint32",
        "f": b"float float32",
        "d": b"double float64",
    }.items()
    for name in names.split()
}
"""The types by name, as `struct` and numpy both write them."""
_MOST_PLY_LINES = 1000
"""Elements and properties of a PLY file: more than any has, and few enough to go through."""
_CORNER_NAMES = (b"vertex_indices", b"vertex_index")


class _Property(NamedTuple):
    name: bytes
    type: str
    count_type: str
    """Of a list; else empty."""


class _Element(NamedTuple):
    name: str
    size: int
    properties: list[_Property]

    @property
    def has_lists(self) -> bool:
        return any(part.count_type for part in self.properties)

    def least_bytes(self, order: str) -> int:
        """Return how many bytes one takes, its lists empty; in text, where ``order`` is empty."""
        if not order:
            return 2 * len(self.properties)  # a digit, and what parts it from the next
        return sum(np.dtype(part.count_type or part.type).itemsize for part in self.properties)


def _read_ply(data: bytes, max_faces: int | None) -> Read:
    header = _PLY_HEADER.match(data)
    if header is None:
        raise InvalidMesh("the PLY file has no header from 'ply' to 'end_header'")
    order, elements = _ply_elements(header[1])
    counts = {element.name: element.size for element in elements}
    for name in ("vertex", "face"):
        if not counts.get(name):
            raise InvalidMesh(f"the PLY file holds no {name} elements", kind="face")
    _refuse_odd_properties(elements)
    body = data[header.end() :]
    refuse_claim(counts, {each.name: each.least_bytes(order) for each in elements}, len(body))
    refuse_more_faces(counts["face"], max_faces)
    read = _ply_binary(elements, body, order) if order else _ply_ascii(elements, body)
    others = {name: n for name, n in counts.items() if n and name not in ("vertex", "face")}
    return read._replace(notes=_notes("PLY", others))


def _ply_elements(header: bytes) -> tuple[str, list[_Element]]:
    """Return the byte order, empty for text, and the elements."""
    order: str | None = None
    elements: list[_Element] = []
    lines = header.splitlines()
    declared = sum(line.lstrip()[:7] in (b"element", b"propert") for line in lines)
    if declared > _MOST_PLY_LINES:
        raise InvalidMesh(
            f"the PLY header has {declared} elements and properties; {_MOST_PLY_LINES} are read"
        )
    for line in lines:
        match line.split():
            case [b"format", form, _] if form in _PLY_ORDERS:
                order = _PLY_ORDERS[form]
            case [b"element", word, count] if count.isdigit():
                name = word.decode("ascii", "replace")
                if name in [element.name for element in elements]:
                    raise InvalidMesh(f"the PLY header says {_clip(line)} twice")
                elements.append(_Element(name, int(count), []))
            case [b"property", b"list", count_type, item, word] if (
                elements and item in _PLY_TYPES and _PLY_TYPES.get(count_type, "f") not in "fd"
            ):
                part = _Property(word, _PLY_TYPES[item], _PLY_TYPES[count_type])
                elements[-1].properties.append(part)
            case [b"property", item, word] if elements and item in _PLY_TYPES:
                elements[-1].properties.append(_Property(word, _PLY_TYPES[item], ""))
            case [] | [b"comment" | b"obj_info", *_]:
                pass
            case _:
                raise InvalidMesh(f"the PLY header has an unknown line, {_clip(line)}")
    if order is None:
        raise InvalidMesh("the PLY header names no format")
    return order, elements


def _refuse_odd_properties(elements: list[_Element]) -> None:
    for element in elements:
        names = [part.name for part in element.properties if not part.count_type]
        if element.name == "vertex" and (
            element.has_lists or [names.count(axis) for axis in (b"x", b"y", b"z")] != [1, 1, 1]
        ):
            raise InvalidMesh("the PLY vertices must have x, y and z once each, and no lists")
        if element.name == "face":
            _place_of_corners(element)


def _place_of_corners(face: _Element) -> int:
    for place, part in enumerate(face.properties):
        if part.count_type and part.name in _CORNER_NAMES:
            return place
    raise InvalidMesh("the PLY faces have no property 'list … vertex_indices'", kind="face")


def _ply_ascii(elements: list[_Element], body: bytes) -> Read:
    rows = [row for row in body.splitlines() if row.strip()]
    _refuse_missing_rows({element.name: element.size for element in elements}, len(rows))
    start = 0
    for element in elements:
        block = rows[start : start + element.size]
        start += element.size
        if element.name == "vertex":
            vertices = _ply_positions(element, block)
        elif element.name == "face":
            at = _place_of_corners(element)
            if any(part.count_type for part in element.properties[:at]):
                raise InvalidMesh("the PLY faces have another list before their vertex_indices")
            corners, sizes = _corners(_polygons(block, skipped=at))
    return Read(vertices, corners, sizes)


def _ply_positions(element: _Element, rows: list[bytes]) -> Floats:
    columns = len(element.properties)
    _refuse_row(rows, _VERTEX_ROW, "vertex", f"it must have {columns} numbers")
    short = next((i for i, row in enumerate(rows) if len(row.split()) < columns), None)
    if short is not None:
        raise InvalidMesh(
            f"vertex {short} reads {_clip(rows[short])}; it must have {columns} numbers",
            kind="vertex",
            elements=[short],
        )
    table = dict(
        zip((part.name for part in element.properties), _table(rows, columns).T, strict=True)
    )
    types = {part.name: part.type for part in element.properties}
    with np.errstate(over="ignore"):  # the mesh refuses what is not finite
        axes = [table[axis].astype(types[axis]) for axis in (b"x", b"y", b"z")]
    return np.stack(axes, axis=1).astype(np.float64)


def _ply_binary(elements: list[_Element], body: bytes, order: str) -> Read:
    counts = {element.name: element.size for element in elements}
    short = InvalidMesh(f"the header declares {claim_of(counts)}, but {len(body)} bytes follow")
    at = 0
    for element in elements:
        table = _even_records(element, body, at, order)
        if table is None:
            if not element.has_lists:
                raise short
            walked = _walked(element, body, at, order)
            at = walked[2]
            if element.name == "face":
                corners, sizes = walked[:2]
            continue
        at += table.nbytes
        if element.name == "vertex":
            names = [part.name for part in element.properties]
            axes = [table[str(names.index(axis))] for axis in (b"x", b"y", b"z")]
            vertices = np.stack(axes, axis=1).astype(np.float64)
        elif element.name == "face":
            rows = table[str(_place_of_corners(element))]
            corners, sizes = rows.astype(np.int64).reshape(-1), np.full(len(rows), rows.shape[1])
    if at != len(body):
        raise short
    return Read(vertices, corners, sizes)


def _even_records(element: _Element, body: bytes, start: int, order: str) -> NDArray[Any] | None:
    """Return an element's records, where all lists are as long as the first; else None."""
    fields: list[Any] = []
    for i, part in enumerate(element.properties):
        if part.count_type:
            at = start + np.dtype(fields).itemsize
            count = int(np.frombuffer(body, order + part.count_type, 1, at)[0])
            fields += [(f"count{i}", order + part.count_type)]
            fields += [(str(i), order + part.type, (count,))]
        else:
            fields.append((str(i), order + part.type))
    dtype = np.dtype(fields)
    if start + element.size * dtype.itemsize > len(body):
        return None
    table = np.frombuffer(body, dtype, element.size, start)
    counts = [table[f"count{i}"] for i, part in enumerate(element.properties) if part.count_type]
    return table if all((count == count[:1]).all() for count in counts) else None


def _walked(element: _Element, body: bytes, at: int, order: str) -> tuple[Longs, Longs, int]:
    """Return the corners of faces with any number of them, how many each has, and the end."""
    place = _place_of_corners(element) if element.name == "face" else -1
    counters = [struct.Struct(order + part.count_type) for part in element.properties]
    widths = [np.dtype(part.type).itemsize for part in element.properties]
    found, sizes = [], []
    for _ in range(element.size):
        for i, (counter, width) in enumerate(zip(counters, widths, strict=True)):
            count = counter.unpack_from(body, at)[0] if counter.size else 1
            if count < 0:
                raise InvalidMesh(
                    f"a list of the PLY file's {element.name} elements has {count} items"
                )
            at += counter.size
            if i == place:
                found.append(body[at : at + count * width])
                sizes.append(count)
            at += count * width
    item = order + element.properties[place].type
    corners = np.frombuffer(b"".join(found), item).astype(np.int64)
    return corners, np.array(sizes, dtype=np.int64), at


# STL ---------------------------------------------------------------------------------------------

_STL_HEADER, _STL_TRIANGLE = 84, 50
_STL_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.IGNORECASE)
_STL_VERTEX = re.compile(rb"^[ \t]*vertex\b[ \t]*([^\r\n]*)", re.MULTILINE | re.IGNORECASE)


def _read_stl(data: bytes, max_faces: int | None) -> Read:
    triangles = int.from_bytes(data[_STL_HEADER - 4 : _STL_HEADER], "little")
    expected = _STL_HEADER + triangles * _STL_TRIANGLE
    if len(data) == expected:
        refuse_more_faces(triangles, max_faces)
    else:
        facets = sum(1 for _ in _STL_FACET.finditer(data))
        if not facets or data.lstrip()[:5].lower() != b"solid":
            raise InvalidMesh(
                f"the STL file is neither ASCII nor binary: its header declares {triangles} "
                f"triangles, which take {expected} bytes, but it has {len(data)}"
            )
        refuse_more_faces(facets, max_faces)
        corners = _STL_VERTEX.findall(data)
        _refuse_row(corners, _VERTEX_ROW, "vertex", _VERTEX_RULE)
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
    return Read(vertices, np.arange(len(vertices)), np.full(triangles, 3))


# GLB ---------------------------------------------------------------------------------------------

_GLB_HEADER, _CHUNK_HEADER = 12, 8
_FLOAT, _TRIANGLE_FAN = 5126, 6


def _read_glb(data: bytes, max_faces: int | None) -> Read:
    refuse_more_faces(glb_faces(_checked_glb(data)), max_faces)
    scene = trimesh.load_scene(
        io.BytesIO(data), file_type="glb", process=False, skip_materials=True
    )
    order = {name: number for number, name in enumerate(scene.geometry)}
    # trimesh walks the nodes from the last to the first.
    nodes = reversed(scene.graph.nodes_geometry)
    placed = [(transform, name) for transform, name in map(scene.graph.get, nodes)]
    placed.sort(key=lambda place: order[place[1]])
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
    return Read(np.concatenate(vertices), corners, sizes, _notes("GLB", ignored))


def _checked_glb(data: bytes) -> dict[str, Any]:
    """Return the document, whose lengths and counts the bytes bear out, and trimesh reads right."""
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
    tree: dict[str, Any] = json.loads(data[start : start + json_length])
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
    return tree


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


_Reader = Callable[[bytes, int | None], Read]
_READERS: dict[str, _Reader] = {
    "obj": _read_obj,
    "off": _read_off,
    "ply": _read_ply,
    "stl": _read_stl,
    "glb": _read_glb,
}

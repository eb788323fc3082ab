"""GLB and glTF files: what their scenes show, and how the numbers of it are stored."""

import base64
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh import transformations

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.load import load_mesh
from geodesic_core.solvers import exact_distance
from tests.core.io.test_load import FACES, LONG, VERTICES, lie, refusal
from tests.support.fresh import told_by
from tests.support.mesh_files import GlbFile, glb, glb_of, glb_tree, stl_binary

pytestmark = pytest.mark.slice(8)

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.uint16)
ROOT_2 = 2.0**0.5


def square(**members: Any) -> GlbFile:
    """Return a file of the unit square, with members of its node."""
    file = GlbFile()
    file.tree["meshes"] = [{"primitives": [file.part(SQUARE, HALVES)]}]
    file.tree["nodes"] = [{"mesh": 0} | members]
    return file


def distances(file: GlbFile) -> list[float]:
    """Return the distances from vertex 0, in a file that is read without a warning."""
    mesh = load_mesh(file.glb(), "glb")
    assert not mesh.warnings
    return exact_distance(mesh, 0).distances.tolist()


# --- Scenes ---------------------------------------------------------------------------------------


def test_glb_lines_and_points_are_told_of() -> None:
    tree, binary = glb_tree(VERTICES[:3], FACES[:1])
    tree["meshes"][0]["primitives"] += [{"attributes": {"POSITION": 0}, "mode": m} for m in (0, 1)]
    (note,) = load_mesh(glb_of(tree, binary), "glb").warnings
    assert "2 parts of points or lines" in note


def glb_scene(nodes: list[dict[str, Any]], roots: list[int]) -> bytes:
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    return glb_of(tree | {"nodes": nodes, "scenes": [{"nodes": roots}]}, binary)


def test_glb_nodes_place_their_meshes() -> None:
    quarter = float(np.sqrt(0.5))
    nodes = [
        {"mesh": 0},
        {"children": [2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, quarter, quarter], "scale": [2, 2, 2]},
    ]
    mesh = load_mesh(glb_scene(nodes, [0, 1]), "glb")
    turned = VERTICES[:4] @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) * 2 + [10, 0, 0]
    np.testing.assert_allclose(mesh.vertices, np.vstack([VERTICES[:4], turned]), atol=1e-12)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]


def test_glb_mirrored_nodes_keep_their_outside_out() -> None:
    mirrored = load_mesh(glb_scene([{"mesh": 0, "scale": [-1, 1, 1]}], [0]), "glb")
    assert mirrored.vertices.tolist() == (VERTICES[:4] * [-1, 1, 1]).tolist()
    assert mirrored.faces.tolist() == [[2, 1, 0], [3, 2, 0]]


@pytest.mark.jit
def test_glb_nodes_of_any_depth_place_their_meshes() -> None:
    depth = 5000
    nodes = [{"mesh": 0, "translation": [1, 0, 0], "children": [i + 1]} for i in range(depth - 1)]
    nodes.append({"mesh": 0, "translation": [1, 0, 0]})
    mesh = load_mesh(glb_scene(nodes, [0]), "glb")
    expected = [VERTICES[:4] + np.array([1.0 + i, 0, 0]) for i in reversed(range(depth))]
    np.testing.assert_array_equal(mesh.vertices, np.vstack(expected))


def test_a_glb_node_with_a_camera_places_what_is_below_it() -> None:
    camera = {"type": "perspective", "perspective": {"znear": 1, "yfov": 1, "aspectRatio": 1}}
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    tree |= {"cameras": [camera], "scenes": [{"nodes": [0]}]}
    tree["nodes"] = [{"camera": 0, "translation": [5, 0, 0], "children": [1]}, {"mesh": 0}]
    mesh = load_mesh(glb_of(tree, binary), "glb")
    np.testing.assert_array_equal(mesh.vertices, VERTICES[:4] + np.array([5, 0, 0]))


@pytest.mark.slow
@pytest.mark.jit
def test_no_glb_part_is_lost_among_many() -> None:
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    parts = tree["meshes"][0]["primitives"] * 5000
    tree["meshes"] = [{"name": "same", "primitives": parts}] * 2
    tree["nodes"] = [{"mesh": 0, "name": "same"}, {"mesh": 1, "name": "same"}]
    tree["scenes"] = [{"nodes": [0, 1]}]
    mesh = load_mesh(glb_of(tree, binary), "glb")
    np.testing.assert_array_equal(mesh.vertices, np.tile(VERTICES[:4], (2, 1)))
    expected = [np.tile(FACES[:2] + begin, (5000, 1)) for begin in (0, 4)]
    np.testing.assert_array_equal(mesh.faces, np.vstack(expected))


def test_glb_meshes_come_in_the_order_of_the_file() -> None:
    tree, binary = glb_tree(VERTICES[:4], FACES[:2])
    tree["meshes"] = [{"name": name, **tree["meshes"][0]} for name in "zyx"]
    tree["nodes"] = [{"mesh": i, "translation": [10 * i, 0, 0]} for i in range(3)]
    tree["scenes"] = [{"nodes": [2, 0, 1]}]
    assert load_mesh(glb_of(tree, binary), "glb").vertices[::4, 0].tolist() == [0, 10, 20]


def test_glb_primitives_without_indices_with_texture_and_of_lines() -> None:
    tree, binary = glb_tree(VERTICES[:3], FACES[:1])
    primitive = tree["meshes"][0]["primitives"][0]
    del primitive["indices"]
    primitive["attributes"]["NORMAL"] = 0
    primitive["material"] = 0
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["textures"] = [{"source": 0}]
    tree["images"] = [{"uri": "nowhere.png"}]
    tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 0})
    assert load_mesh(glb_of(tree, binary), "glb").faces.tolist() == [[0, 1, 2]]


def test_glb_with_its_buffer_in_a_data_uri() -> None:
    tree, binary = glb_tree(VERTICES, FACES)
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    tree["buffers"][0]["uri"] = uri
    assert load_mesh(glb_of(tree), "glb").faces.tolist() == FACES.tolist()


def test_glb_nodes_that_go_in_circles_are_refused() -> None:
    nodes = [{"mesh": 0, "children": [1]}, {"children": [2]}, {"mesh": 0, "children": [1]}]
    assert "do not form a tree" in str(refusal(glb_scene(nodes, [0]), "glb"))


@pytest.mark.parametrize("offset", [8, 12])
@pytest.mark.parametrize("lie", [0, 100, 2**32 - 1])
def test_lying_glb_lengths_are_refused(offset: int, lie: int) -> None:
    data = glb(VERTICES, FACES)
    refusal(data[:offset] + struct.pack("<I", lie) + data[offset + 4 :], "glb")


def test_glb_places_beyond_all_numbers_are_refused_without_a_warning() -> None:
    nodes = [
        {"scale": [1e308, 1e308, 1e308], "children": [1]},
        {"scale": [1e308, 1e308, 1e308], "children": [2]},
        {"mesh": 0, "translation": [1, -1, 0]},
    ]
    assert "must be finite" in str(refusal(glb_scene(nodes, [0]), "glb"))


@pytest.mark.parametrize(
    ("where", "to", "says"),
    [
        (("meshes",), 5, "meshes is 5"),
        (("meshes", 0, "primitives"), {}, "meshes[0].primitives is dict"),
        (("meshes", 0, "primitives", 0), {}, "meshes[0].primitives[0].attributes is missing"),
        (("accessors", 1, "count"), "9", "accessors[1].count is '9'"),
        (("accessors", 1, "count"), True, "accessors[1].count is True"),
        (("accessors", 1, "count"), 10, "accessor 1 of the glTF document: it has 10"),
        (("accessors", 1, "count"), 8, "accessor 1 of the glTF document: its 8 corners"),
        (("accessors", 1, "type"), "VEC3", "accessor 1 of the glTF document: indices"),
        (("nodes", 0, "mesh"), 4, "nodes[0].mesh is 4"),
        (("nodes", 0, "matrix"), [1, 2, 3], "nodes[0].matrix is list"),
        (("nodes", 0, "rotation"), [0, 0, 0, "1"], "nodes[0].rotation is list"),
        (("nodes", 0, "children"), [-1], "nodes[0].children[0] is -1"),
        (("scene",), 1, "scene is 1"),
        (("bufferViews", 1, "byteLength"), 10**9, "bufferView 1 of the glTF document ends"),
        (("bufferViews", 1, "byteStride"), 2, "accessor 1 of the glTF document: it has 9"),
        (("buffers", 0, "byteLength"), 10**9, "buffer 0 of the glTF document declares"),
        (
            ("buffers", 0, "uri"),
            "data:;base64,x",
            "buffer 0 of the glTF document is not valid base64",
        ),
    ],
)
def test_a_glb_document_names_the_member_at_fault(
    where: tuple[str | int, ...], to: Any, says: str
) -> None:
    tree, binary = glb_tree(VERTICES, FACES)
    lie(tree, *where, to=to)
    assert says in str(refusal(glb_of(tree, binary), "glb"))


@pytest.mark.parametrize(
    ("where", "to"),
    [
        (("materials",), [None, 7]),
        (("cameras",), "none"),
        (("meshes", 0, "name"), [[]]),
        (("meshes", 0, "primitives", 0, "material"), 99),
        (("meshes", 0, "primitives", 0, "attributes", "NORMAL"), 77),
        (("accessors", 0, "min"), {}),
        (("asset",), 3),
    ],
)
def test_glb_members_that_are_not_read_are_no_fault(where: tuple[str | int, ...], to: Any) -> None:
    tree, binary = glb_tree(VERTICES, FACES)
    lie(tree, *where, to=to)
    assert load_mesh(glb_of(tree, binary), "glb").faces.tolist() == FACES.tolist()


def test_glb_documents_that_are_nested_too_deep_are_refused() -> None:
    for document in (b"[" * 10**5 + b"]" * 10**5, b'{"scene": ' + LONG + b"}"):
        text = document + b" " * (-len(document) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        data = struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
        assert "glTF document cannot be read" in str(refusal(data, "glb"))


# --- Shared positions -----------------------------------------------------------------------------


def test_parts_of_two_materials_share_the_vertices_of_their_positions() -> None:
    file = GlbFile()
    position = file.accessor(SQUARE)
    attributes = {"POSITION": position}
    file.tree["meshes"] = [
        {
            "primitives": [
                {"attributes": attributes, "indices": file.accessor(half), "material": number}
                for number, half in enumerate(HALVES)
            ]
        }
    ]
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])
    assert load_mesh(file.glb(), "glb").faces.tolist() == HALVES.tolist()


def test_each_mesh_and_each_node_has_vertices_of_its_own() -> None:
    file = GlbFile()
    part, other = file.part(SQUARE, HALVES), file.part(SQUARE + 7, HALVES)
    file.tree["meshes"] = [{"primitives": [other, part, other]}, {"primitives": [part]}]
    file.tree["nodes"] = [{"mesh": 1}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 2]}]
    file.tree["scenes"] = [{"nodes": [0, 1, 2]}]
    mesh = load_mesh(file.glb(), "glb")
    up = [0, 0, 2]
    places = [SQUARE + 7, SQUARE + 7 + up, SQUARE, SQUARE + up, SQUARE]
    np.testing.assert_array_equal(mesh.vertices, np.vstack(places))
    begins = [0, 4, 8, 12, 0, 4, 16]
    np.testing.assert_array_equal(mesh.faces, np.vstack([HALVES + begin for begin in begins]))


def test_an_index_beyond_its_part_is_no_vertex_of_the_next() -> None:
    file = GlbFile()
    good, bad = file.part(SQUARE, HALVES), file.part(SQUARE[:3], HALVES)
    file.tree["meshes"] = [{"primitives": [good, bad, file.part(SQUARE, HALVES)]}]
    error = refusal(file.glb(), "glb")
    assert (error.kind, error.elements) == ("face", (3,))
    assert "numbered 0 to 2" in str(error)


# --- Numbers in the file --------------------------------------------------------------------------


def quantized(values: Any, scale: float, **members: Any) -> GlbFile:
    file = GlbFile()
    file.tree["extensionsRequired"] = file.tree["extensionsUsed"] = ["KHR_mesh_quantization"]
    part = {"attributes": {"POSITION": file.accessor(values, **members)}}
    file.tree["meshes"] = [{"primitives": [part | {"indices": file.accessor(HALVES.ravel())}]}]
    file.tree["nodes"] = [{"mesh": 0, "scale": [scale] * 3}]
    return file


@pytest.mark.parametrize("kind", ["u1", "i1", "<u2", "<i2"])
def test_quantized_positions_are_integers_that_a_node_scales(kind: str) -> None:
    file = quantized((SQUARE * 100).astype(kind), 0.02)
    assert distances(file) == pytest.approx([0, 2, 2 * ROOT_2, 2], rel=1e-15)


@pytest.mark.parametrize(
    ("kind", "one"), [("u1", 255), ("i1", 127), ("<u2", 65535), ("<i2", 32767)]
)
def test_normalized_positions_are_parts_of_the_largest_integer(kind: str, one: int) -> None:
    file = quantized((SQUARE * one).astype(kind), 2.0, normalized=True)
    assert load_mesh(file.glb(), "glb").vertices.tolist() == (SQUARE * 2).tolist()


@pytest.mark.parametrize(("kind", "least"), [("i1", -128), ("<i2", -32768)])
def test_the_least_normalized_integer_is_minus_one(kind: str, least: int) -> None:
    file = quantized((SQUARE * least).astype(kind), 1.0, normalized=True)
    assert load_mesh(file.glb(), "glb").vertices.tolist() == (SQUARE * -1).tolist()


@pytest.mark.parametrize("kind", ["u1", "i1", "<u2", "<i2", "<u4"])
def test_positions_of_integers_without_the_extension_are_refused(kind: str) -> None:
    file = quantized((SQUARE * 100).astype(kind), 0.02)
    if kind != "<u4":
        del file.tree["extensionsRequired"], file.tree["extensionsUsed"]
    assert "positions must be floats" in str(refusal(file.glb(), "glb"))


@pytest.mark.parametrize("kind", ["u1", "<u2", "<u4"])
@pytest.mark.parametrize("is_over_zeros", [False, True])
def test_sparse_positions_replace_some_of_others_or_of_zeros(
    kind: str, *, is_over_zeros: bool
) -> None:
    file = GlbFile()
    at = np.arange(4, dtype=kind) if is_over_zeros else np.array([1, 2], kind)
    sparse = file.sparse(at, SQUARE[at])
    base = SQUARE * [0, 1, 1]
    base[2] = [9, 9, 9]
    position = (
        file.describe(base.astype("<f4"), sparse=sparse)
        if is_over_zeros
        else file.accessor(base.astype("<f4"), sparse=sparse)
    )
    part = {"attributes": {"POSITION": position}, "indices": file.accessor(HALVES.ravel())}
    file.tree["meshes"] = [{"primitives": [part]}]
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])


@pytest.mark.parametrize("kind", ["u1", "<u2", "<u4"])
def test_sparse_indices_replace_some_of_others(kind: str) -> None:
    file = GlbFile()
    wrong = np.array([0, 1, 3, 0, 2, 3], kind)
    part = {
        "attributes": {"POSITION": file.accessor(SQUARE)},
        "indices": file.accessor(wrong, sparse=file.sparse(np.array([2], "u1"), wrong[4:5])),
    }
    file.tree["meshes"] = [{"primitives": [part]}]
    assert load_mesh(file.glb(), "glb").faces.tolist() == HALVES.tolist()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda sparse: lie(sparse, "count", to=5), "5 elements of 4 bytes"),
        (lambda sparse: lie(sparse, "count", to=0), "sparse.count is 0"),
        (lambda sparse: lie(sparse, "indices", "componentType", to=5126), "unsigned integers"),
        (lambda sparse: lie(sparse, "indices", "componentType", to=7), "unknown componentType 7"),
        (lambda sparse: lie(sparse, "indices", "bufferView", to=99), "sparse.indices.bufferView"),
        (lambda sparse: sparse.pop("values"), "sparse.values is missing"),
    ],
)
def test_sparse_accessors_that_lie_are_refused(
    change: Callable[[dict[str, Any]], Any], says: str
) -> None:
    file = GlbFile()
    sparse = file.sparse(np.arange(4, dtype="<u4"), SQUARE)
    change(sparse)
    position = file.accessor(SQUARE, sparse=sparse)
    file.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}}]}]
    assert says in str(refusal(file.glb(), "glb"))


def test_a_sparse_element_beyond_the_accessor_is_refused() -> None:
    file = GlbFile()
    sparse = file.sparse(np.array([4], "u1"), SQUARE[:1])
    position = file.accessor(SQUARE, sparse=sparse)
    file.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}}]}]
    assert "a sparse index is 4" in str(refusal(file.glb(), "glb"))


def test_zeros_of_no_bytes_are_no_more_than_the_file_has() -> None:
    file = GlbFile()
    sparse = file.sparse(np.arange(4, dtype="u1"), SQUARE)
    position = file.describe(SQUARE, sparse=sparse)
    file.tree["accessors"][position]["count"] = 3 * 10**9
    file.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}}]}]
    assert "3000000000 elements, but the file has" in str(refusal(file.glb(), "glb"))


# --- Strips and fans ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [None, "u1", "<u2", "<u4"])
@pytest.mark.parametrize(
    ("mode", "corners", "faces"),
    [
        (5, [0, 1, 3, 2, 4], [[0, 1, 3], [1, 2, 3], [3, 2, 4]]),
        (6, [0, 1, 2, 3, 4], [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    ],
)
def test_strips_and_fans_are_wound_as_their_first_triangle(
    kind: str | None, mode: int, corners: list[int], faces: list[list[int]]
) -> None:
    points = np.vstack([SQUARE, [[-0.5, 1.5, 0]]]).astype("<f4")
    file = GlbFile()
    part: dict[str, Any] = {"attributes": {"POSITION": file.accessor(points)}, "mode": mode}
    if kind is None:  # the corners are the vertices as they come
        part["attributes"]["POSITION"] = file.accessor(points[corners])
        faces = [[corners.index(v) for v in face] for face in faces]
    else:
        part["indices"] = file.accessor(np.array(corners, kind))
    file.tree["meshes"] = [{"primitives": [part]}]
    mesh = load_mesh(file.glb(), "glb")
    assert mesh.faces.tolist() == faces
    places = mesh.vertices[mesh.faces]
    assert (np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])[:, 2] > 0).all()


def test_parts_without_positions_are_told_of() -> None:
    file = square()
    file.tree["meshes"][0]["primitives"].append({"attributes": {"COLOR_0": 0}})
    (note,) = load_mesh(file.glb(), "glb").warnings
    assert "1 parts of points or lines" in note


# --- Extensions -----------------------------------------------------------------------------------

INSTANCING = "EXT_mesh_gpu_instancing"


def instanced(file: GlbFile, **attributes: Any) -> GlbFile:
    file.tree["extensionsUsed"] = [INSTANCING]
    numbers = {
        name: file.accessor(values, **({"normalized": True} if values.dtype.kind == "i" else {}))
        for name, values in attributes.items()
    }
    file.tree["nodes"][0]["extensions"] = {INSTANCING: {"attributes": numbers}}
    return file


@pytest.mark.parametrize("is_required", [False, True])
def test_instances_of_a_node_are_shown_one_after_the_other(*, is_required: bool) -> None:
    moved = np.array([[0, 0, 0], [5, 0, 0], [0, 0, 9]], "<f4")
    file = instanced(square(translation=[0, 3, 0], scale=[2, 2, 2]), TRANSLATION=moved)
    if is_required:
        file.tree["extensionsRequired"] = [INSTANCING]
    mesh = load_mesh(file.glb(), "glb")
    expected = [(SQUARE + move) * 2 + [0, 3, 0] for move in moved]
    np.testing.assert_allclose(mesh.vertices, np.vstack(expected), rtol=1e-15)
    np.testing.assert_array_equal(mesh.faces, np.vstack([HALVES + 4 * i for i in range(3)]))


@pytest.mark.parametrize("kind", ["<f4", "<i2", "i1"])
def test_instances_are_turned_scaled_and_mirrored(kind: str) -> None:
    one = 1.0 if kind == "<f4" else np.iinfo(kind).max
    turns = np.array([[0, 0, 0, 1], [0, 0, 0.6, 0.8]]) * one
    file = instanced(
        square(),
        ROTATION=turns.astype(kind),
        SCALE=np.array([[1, 2, 1], [1, 1, -3]], "<f4"),
    )
    mesh = load_mesh(file.glb(), "glb")
    stored = turns.astype(kind) / one
    turn = transformations.quaternion_matrix([stored[1, 3], *stored[1, :3]])[:3, :3]
    expected = [SQUARE * [1, 2, 1], SQUARE * [1, 1, -3] @ turn.T]
    np.testing.assert_allclose(mesh.vertices, np.vstack(expected), atol=1e-12)
    np.testing.assert_array_equal(mesh.faces, np.vstack([HALVES, HALVES[:, ::-1] + 4]))


def test_instances_count_as_faces_and_vertices() -> None:
    file = instanced(square(), TRANSLATION=np.zeros((100, 3), "<f4"))
    with pytest.raises(InvalidMesh, match="200 faces"):
        load_mesh(file.glb(), "glb", max_faces=199)
    assert len(load_mesh(file.glb(), "glb", max_faces=200).vertices) == 400


def test_instances_of_different_numbers_are_refused() -> None:
    places = {"TRANSLATION": np.zeros((3, 3), "<f4"), "SCALE": np.ones((2, 3), "<f4")}
    assert "as many of each kind" in str(refusal(instanced(square(), **places).glb(), "glb"))
    assert "must have places" in str(refusal(instanced(square()).glb(), "glb"))


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("KHR_draco_mesh_compression", "save it uncompressed"),
        ("EXT_meshopt_compression", "save it uncompressed"),
        ("KHR_meshopt_compression", "save it uncompressed"),
        ("VENDOR_other_geometry", "save it without it"),
        ("KHR_gaussian_splatting", "save it without it"),
        ("CESIUM_RTC", "save it without it"),
        ("KHR_materialsx", "save it without it"),
    ],
)
def test_an_extension_that_is_required_and_not_known_is_named(name: str, remedy: str) -> None:
    file = square()
    file.tree["extensionsUsed"] = [name]
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])
    file.tree["extensionsRequired"] = ["KHR_texture_transform", name]
    message = str(refusal(file.glb(), "glb"))
    assert repr(name) in message
    assert remedy in message


@pytest.mark.parametrize(
    "name",
    [
        *("KHR_materials_unlit", "KHR_materials_variants", "ADOBE_materials_thin_transparency"),
        *("KHR_texture_basisu", "EXT_texture_webp", "MSFT_texture_dds", "KHR_lights_punctual"),
        *("KHR_techniques_webgl", "KHR_xmp_json_ld", "EXT_structural_metadata", "MSFT_lod"),
        *("EXT_mesh_features", "KHR_animation_pointer", "CESIUM_primitive_outline"),
    ],
)
def test_extensions_that_move_no_vertex_are_no_fault(name: str) -> None:
    file = square()
    file.tree["extensionsUsed"] = file.tree["extensionsRequired"] = [name]
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])


def test_what_a_node_hides_is_not_shown() -> None:
    file = square()
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    seen = {"extensions": {"KHR_node_visibility": {"visible": True}}}
    file.tree["extensionsRequired"] = ["KHR_node_visibility"]
    file.tree["nodes"] = [
        {"mesh": 0} | seen,
        {"mesh": 0, "children": [2]} | hidden,
        {"mesh": 0} | seen,
    ]
    file.tree["scenes"] = [{"nodes": [0, 1]}]
    assert len(load_mesh(file.glb(), "glb").faces) == 2


def test_a_compressed_view_that_is_not_required_is_read_from_its_plain_bytes() -> None:
    file = square()
    for view in file.tree["bufferViews"]:
        view["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])


# --- Skins and morph targets ----------------------------------------------------------------------


def test_the_place_of_a_skinned_node_does_not_count() -> None:
    file = square(skin=0, scale=[100, 100, 100])
    joints, weights = np.zeros((4, 4), "u1"), np.tile(np.eye(4, dtype="<f4")[0], (4, 1))
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"JOINTS_0": file.accessor(joints), "WEIGHTS_0": file.accessor(weights)}
    file.tree["nodes"].append({"name": "joint"})
    file.tree["scenes"] = [{"nodes": [0, 1]}]
    file.tree["skins"] = [{"joints": [1]}]
    assert distances(file) == pytest.approx([0, 1, ROOT_2, 1])


def weights_as(kind: str, shares: Any) -> tuple[Any, dict[str, Any]]:
    if kind == "<f4":
        return shares.astype(kind), {}
    return np.round(shares * np.iinfo(kind).max).astype(kind), {"normalized": True}


@pytest.mark.parametrize("sets", [1, 2])
@pytest.mark.parametrize("joint_kind", ["u1", "<u2"])
@pytest.mark.parametrize("weight_kind", ["<f4", "u1", "<u2"])
def test_skinned_vertices_are_means_of_where_their_joints_move_them(
    sets: int, joint_kind: str, weight_kind: str
) -> None:
    random = np.random.default_rng(7)
    joints = random.integers(0, 3, (sets, 4, 4))
    shares = random.random((sets, 4, 4))
    shares /= shares.sum(axis=(0, 2))[None, :, None]
    bound = np.array(
        [transformations.compose_matrix(translate=random.random(3)) for _ in range(3)], "<f4"
    )

    file = square(skin=0, translation=[50, 0, 0])
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    stored = []
    for i in range(sets):
        values, members = weights_as(weight_kind, shares[i])
        stored.append(values / (1 if weight_kind == "<f4" else np.iinfo(weight_kind).max))
        attributes[f"JOINTS_{i}"] = file.accessor(joints[i].astype(joint_kind))
        attributes[f"WEIGHTS_{i}"] = file.accessor(values, **members)
    file.tree["nodes"] += [
        {"translation": [1, 2, 3], "children": [2]},
        {"rotation": [0, 0, 0.6, 0.8], "scale": [2, 1, 1]},
        {"matrix": np.diag([1.0, 3.0, 1.0, 1.0]).ravel().tolist()},
    ]
    file.tree["scenes"] = [{"nodes": [0, 1, 3]}]
    inverse = file.accessor(bound.transpose(0, 2, 1).reshape(-1, 16))
    file.tree["skins"] = [{"joints": [3, 2, 1], "inverseBindMatrices": inverse}]

    moved = transformations.translation_matrix([1, 2, 3])
    turned = moved @ transformations.quaternion_matrix([0.8, 0, 0, 0.6]) @ np.diag([2.0, 1, 1, 1])
    worlds = [np.diag([1.0, 3.0, 1.0, 1.0]), turned, moved]
    expected = np.zeros((4, 3))
    for vertex in range(4):
        weight = sum(stored[i][vertex, k] for i in range(sets) for k in range(4))
        for i in range(sets):
            for k in range(4):
                joint = joints[i][vertex, k]
                place = worlds[joint] @ bound[joint] @ [*SQUARE[vertex], 1.0]
                expected[vertex] += stored[i][vertex, k] / weight * place[:3]
    np.testing.assert_allclose(load_mesh(file.glb(), "glb").vertices, expected, rtol=1e-6)


def skinned(joints: Any, weights: Any) -> GlbFile:
    file = square(skin=0)
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"JOINTS_0": file.accessor(joints), "WEIGHTS_0": file.accessor(weights)}
    file.tree["nodes"].append({})
    file.tree["skins"] = [{"joints": [1]}]
    return file


def test_skins_that_lack_something_are_refused() -> None:
    joints, weights = np.zeros((4, 4), "u1"), np.full((4, 4), 0.25, "<f4")
    assert distances(skinned(joints, weights)) == pytest.approx([0, 1, ROOT_2, 1])
    unused = weights * np.array([1, 1, 2, 0], np.float32)
    assert distances(skinned(joints + np.array([0, 0, 0, 9], np.uint8), unused))[
        1
    ] == pytest.approx(1)

    loose = weights * np.array([[1], [1], [0], [1]], np.float32)
    for file, says in (
        (skinned(joints + np.uint8(1), weights), "names joint 1 of a skin of 1"),
        (skinned(joints, loose), "the weights of element 2 are 0"),
        (skinned(joints[:3], weights), "has 3 elements for 4 positions"),
        (skinned(joints, weights[:3]), "has 3 elements for 4 positions"),
        (skinned(weights, weights), "joints must be unsigned integers"),
        (skinned(joints, joints), "weights of joints must be floats"),
        (square(skin=0), "nodes[0].skin is 0"),
    ):
        assert says in str(refusal(file.glb(), "glb"))

    bare = skinned(joints, weights)
    del bare.tree["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]
    assert "lacks JOINTS_0 or WEIGHTS" in str(refusal(bare.glb(), "glb"))
    short = skinned(joints, weights)
    short.tree["skins"][0] = {"joints": [1, 0], "inverseBindMatrices": 4}
    short.accessor(np.eye(4, dtype="<f4").reshape(1, 16))
    assert "has 2 joints, but 1 inverseBindMatrices" in str(refusal(short.glb(), "glb"))


SHIFT = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 0], [0, 0, 0]], "<f4")


def morphed(file: GlbFile, *targets: int, **weights: list[float]) -> GlbFile:
    part = file.tree["meshes"][0]["primitives"][0]
    part["targets"] = [{"POSITION": target, "NORMAL": 99} for target in targets]
    for of, values in weights.items():
        file.tree[of][0]["weights"] = values
    return file


def test_morph_targets_move_by_the_weights_of_the_mesh_or_else_of_the_node() -> None:
    file = square()
    target = file.accessor(SHIFT)
    wide = pytest.approx([0, 3, 10.0**0.5, 1])
    assert distances(morphed(file, target)) == pytest.approx([0, 1, ROOT_2, 1])
    assert distances(morphed(file, target, meshes=[1.0])) == wide
    assert distances(morphed(file, target, nodes=[0.5])) == pytest.approx([0, 2, 5.0**0.5, 1])
    assert distances(morphed(file, target, target, meshes=[1.0, 0], nodes=[0.5, 0.5])) == wide


def test_morph_targets_may_be_sparse_quantized_or_nothing() -> None:
    file = square()
    sparse = file.describe(SHIFT, sparse=file.sparse(np.array([1, 2], "u1"), SHIFT[1:3]))
    nothing = file.describe(SHIFT)
    small = file.accessor((SHIFT * 63.5).astype("i1"), normalized=True)
    wide = pytest.approx([0, 3, 10.0**0.5, 1])
    assert distances(morphed(file, nothing, sparse, meshes=[5.0, 1.0])) == wide
    assert distances(morphed(file, small, meshes=[2.0])) == wide


def test_morph_targets_that_do_not_fit_are_refused() -> None:
    file = square()
    short = file.accessor(SHIFT[:3])
    assert "has 3 elements for 4" in str(refusal(morphed(file, short, meshes=[1.0]).glb(), "glb"))
    more = morphed(file, short, meshes=[0.0, 1.0]).glb()
    assert "has 2 weights, but a part of it has 1 targets" in str(refusal(more, "glb"))
    assert "meshes[0].weights is list" in str(
        refusal(morphed(file, short, meshes=["1"]).glb(), "glb")  # type: ignore[list-item]
    )


def test_parts_that_share_positions_and_move_apart_share_no_vertices() -> None:
    file = square()
    first, target = file.tree["meshes"][0]["primitives"][0], file.accessor(SHIFT)
    moved = first | {"targets": [{"POSITION": target}]}
    still = first | {"targets": [{}]}
    file.tree["meshes"][0] = {"primitives": [moved, still, moved], "weights": [1.0]}
    mesh = load_mesh(file.glb(), "glb")
    np.testing.assert_array_equal(mesh.vertices, np.vstack([SQUARE + SHIFT, SQUARE]))
    np.testing.assert_array_equal(mesh.faces, np.vstack([HALVES, HALVES + 4, HALVES]))


# --- Containers -----------------------------------------------------------------------------------


def test_gltf_with_its_buffer_inside_is_read() -> None:
    mesh = load_mesh(square(scale=[2, 2, 2]).gltf(), "gltf")
    assert mesh.vertices.tolist() == (SQUARE * 2).tolist()
    assert mesh.faces.tolist() == HALVES.tolist()


def test_gltf_with_its_buffer_in_another_file_names_it_and_the_remedy() -> None:
    tree = json.loads(square().gltf())
    tree["buffers"][0]["uri"] = "square.bin"
    message = str(refusal(json.dumps(tree).encode(), "gltf"))
    assert "'square.bin'" in message
    assert "save as .glb" in message
    del tree["buffers"][0]["uri"]
    assert "but has 0" in str(refusal(json.dumps(tree).encode(), "gltf"))


@pytest.mark.parametrize("behind", [b"\n", bytes(512)])
def test_bytes_behind_a_glb_are_left_out_with_a_note(behind: bytes) -> None:
    (note,) = load_mesh(glb(SQUARE, HALVES) + behind, "glb").warnings
    assert f"{len(behind)} bytes behind its end" in note


def test_buffers_that_no_part_needs_may_lie_anywhere() -> None:
    tree, binary = glb_tree(VERTICES, FACES)
    tree["buffers"].append({"byteLength": 10**6, "uri": "animation.bin"})
    tree["bufferViews"].append({"buffer": 1, "byteLength": 10**6})
    assert len(load_mesh(glb_of(tree, binary), "glb").faces) == 3


# --- Against other readers ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_plain_scenes_are_what_trimesh_reads(seed: int) -> None:
    random = np.random.default_rng(seed)
    scene = trimesh.Scene()
    for number in range(4):
        shape = trimesh.creation.icosphere(subdivisions=1)
        place = transformations.random_rotation_matrix(random.random(3))
        place[:3, :3] *= random.uniform(0.5, 2.0)
        place[:3, 3] = random.normal(size=3)
        scene.add_geometry(shape, geom_name=f"part {number}", transform=place)
    data = scene.export(file_type="glb")
    expected = trimesh.load_scene(
        trimesh.util.wrap_as_stream(data), file_type="glb", process=False
    ).to_geometry()
    mesh = load_mesh(data, "glb")
    ours, theirs = (
        np.sort(vertices[faces].mean(axis=1).round(5), axis=0)
        for vertices, faces in ((mesh.vertices, mesh.faces), (expected.vertices, expected.faces))
    )
    assert len(mesh.vertices) == len(expected.vertices)
    np.testing.assert_allclose(ours, theirs, atol=2e-5)


READS = """
import sys
import geodesic_core as gc
for kind, data in {files!r}.items():
    assert len(gc.load_mesh(data, kind).faces) == 3
print("trimesh" in sys.modules)
"""


@pytest.mark.slow  # a process
def test_no_file_imports_trimesh() -> None:
    files = {"glb": glb(VERTICES, FACES), "stl": stl_binary(VERTICES, FACES)}
    assert told_by(READS.format(files=files)) == "False\n"

"""glTF documents: each member that is read has its type, and points to what there is."""

import json
import re
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

from geodesic_core.errors import InvalidMesh

_LARGEST_DOCUMENT = 32 * 2**20
_MOST_VALUES = 1_000_000
"""Values of a document that are looked at; as many take a second"""

JOINT_SETS = range(4)
"""Numbers of the attributes ``JOINTS_n`` and ``WEIGHTS_n``: sixteen joints move a vertex"""

_READ = frozenset({"EXT_mesh_gpu_instancing", "KHR_mesh_quantization", "KHR_node_visibility"})
_COMPRESSIONS = frozenset(
    {"EXT_meshopt_compression", "KHR_draco_mesh_compression", "KHR_meshopt_compression"}
)
_NO_GEOMETRY = re.compile(
    r"[A-Z0-9]+_"
    r"(materials|texture|techniques|packing|lights|primitive_outline|"  # looks
    r"animation|articulations|interactivity|node_hoverability|node_selectability|audio|"  # motion
    r"xmp|structural_metadata|geometry_metadata|mesh_features|instance_features|"  # data about it
    r"lod)"  # coarser levels, which no scene shows
    r"(_|$)"
)
"""Extensions that say nothing of where a surface is at rest"""


class _Value(NamedTuple):
    """What a member must be that is neither an object nor a list of these."""

    words: str
    is_right: Callable[[Any], bool]


class _Object(NamedTuple):
    """Members that an object must have, and others that are read where it has them."""

    required: dict[str, Any]
    optional: dict[str, Any]


def _integer(least: int = 0, most: int = 2**53) -> _Value:
    return _Value(f"an integer, {least} to {most}", lambda value: _is_integer(value, least, most))


def _numbers(length: int | None = None) -> _Value:
    words = "a list of numbers" if length is None else f"a list of {length} numbers"
    return _Value(
        words,
        lambda value: (
            isinstance(value, list) and all(map(_is_number, value)) and length in (None, len(value))
        ),
    )


_STRING = _Value("a string", lambda value: isinstance(value, str))
_TRUTH = _Value("true or false", lambda value: isinstance(value, bool))


def _document_for(tree: Any) -> _Object:
    """Return what is read of a document, where ``tree`` has the lists that numbers point into."""

    def number_of(name: str) -> _Value:
        elements = tree.get(name, []) if isinstance(tree, dict) else []
        count = len(elements) if isinstance(elements, list) else 0
        return _integer(0, count - 1)._replace(words=f"the number of one of {count} {name}")

    view, accessor, node = map(number_of, ("bufferViews", "accessors", "nodes"))
    size, count = _integer(), _integer(1)
    offset = {"byteOffset": size}
    buffer = _Object({"byteLength": size}, {"uri": _STRING})
    buffer_view = _Object(
        {"buffer": number_of("buffers"), "byteLength": size}, offset | {"byteStride": size}
    )
    sparse = {
        "count": count,
        "indices": _Object({"bufferView": view, "componentType": size}, offset),
        "values": _Object({"bufferView": view}, offset),
    }
    array = _Object(
        {"componentType": size, "count": count, "type": _STRING},
        offset | {"bufferView": view, "normalized": _TRUTH, "sparse": _Object(sparse, {})},
    )
    names = [f"{kind}_{number}" for number in JOINT_SETS for kind in ("JOINTS", "WEIGHTS")]
    target = _Object({}, {"POSITION": accessor})
    primitive = _Object(
        {"attributes": _Object({}, dict.fromkeys(["POSITION", *names], accessor))},
        {"indices": accessor, "mode": _integer(0, 6), "targets": [target]},
    )
    mesh = _Object({"primitives": [primitive]}, {"weights": _numbers()})
    instances = dict.fromkeys(("TRANSLATION", "ROTATION", "SCALE"), accessor)
    extensions = {
        "EXT_mesh_gpu_instancing": _Object({"attributes": _Object({}, instances)}, {}),
        "KHR_node_visibility": _Object({}, {"visible": _TRUTH}),
    }
    placed = {
        "mesh": number_of("meshes"),
        "skin": number_of("skins"),
        "weights": _numbers(),
        "children": [node],
        "matrix": _numbers(16),
        "translation": _numbers(3),
        "rotation": _numbers(4),
        "scale": _numbers(3),
        "extensions": _Object({}, extensions),
    }
    members = {
        "extensionsUsed": [_STRING],
        "extensionsRequired": [_STRING],
        "buffers": [buffer],
        "bufferViews": [buffer_view],
        "accessors": [array],
        "meshes": [mesh],
        "nodes": [_Object({}, placed)],
        "skins": [_Object({"joints": [node]}, {"inverseBindMatrices": accessor})],
        "scenes": [_Object({}, {"nodes": [node]})],
        "scene": number_of("scenes"),
    }
    return _Object({}, members)


def read_document(text: memoryview) -> dict[str, Any]:
    """Return a glTF document whose members are of their types, and name only what is there.

    Members that are not read are not looked at. A document is refused that requires an extension
    which is not read, and one of more than 32 MiB or a million values.
    """
    if len(text) > _LARGEST_DOCUMENT:
        raise InvalidMesh(
            f"the glTF document has {len(text)} bytes; at most {_LARGEST_DOCUMENT} can be read: "
            "put its data into the binary chunk of a GLB file"
        )
    try:
        tree: dict[str, Any] = json.loads(bytes(text))
    except (ValueError, RecursionError) as error:  # a number of too many digits is no JSON error
        raise InvalidMesh(f"the glTF document cannot be read: {error}") from error
    _Checker().check(tree, _document_for(tree), "")
    for name in tree.get("extensionsRequired", []):
        if name not in _READ and not _NO_GEOMETRY.match(name):
            remedy = "uncompressed" if name in _COMPRESSIONS else "without it"
            raise InvalidMesh(
                f"the glTF document requires the extension {name[:60]!r}, which is not read; save "
                f"it {remedy}"
            )
    return tree


class _Checker:
    """Compares values with what they must be, and counts them."""

    def __init__(self) -> None:
        self._values = 0

    def check(self, value: Any, expected: Any, place: str) -> None:
        self._values += 1
        if self._values > _MOST_VALUES:
            raise InvalidMesh(
                f"the glTF document has too many values; at most {_MOST_VALUES} can be read: put "
                "its data into the binary chunk"
            )
        match expected:
            case _Value(words, is_right):
                if not is_right(value):
                    _refuse(value, place, words)
            case _Object(required, optional):
                if not isinstance(value, dict):
                    _refuse(value, place, "an object")
                for name, inner in (required | optional).items():
                    inside = f"{place}.{name}" if place else name
                    if name in value:
                        self.check(value[name], inner, inside)
                    elif name in required:
                        raise InvalidMesh(f"{inside} is missing in the glTF document")
            case [item]:
                if not isinstance(value, list):
                    _refuse(value, place, "a list")
                for number, each in enumerate(value):
                    self.check(each, item, f"{place}[{number}]")


def _is_integer(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or _is_integer(value, -(2**1023), 2**1023)


def _refuse(value: Any, place: str, expected: str) -> NoReturn:
    kind = type(value).__name__ if isinstance(value, dict | list) else repr(value)[:40]
    where = place or "the whole"
    raise InvalidMesh(f"{where} is {kind} in the glTF document; it must be {expected}")

"""glTF documents: each member that is read has its type, and points to what there is."""

import json
import re
from collections.abc import Mapping
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


class _Index(NamedTuple):
    """The number of an element of one of the document's lists."""

    of: str


class _Numbers(NamedTuple):
    """A list of numbers, of so many if a length is given."""

    length: int | None = None


class _Integer(NamedTuple):
    least: int = 0
    most: int = 2**53


class _Required(NamedTuple):
    """A member that is there wherever its object is."""

    kind: Any


_ACCESSOR, _NODE = _Index("accessors"), _Index("nodes")
_ELEMENTS = {"bufferView": _Required(_Index("bufferViews")), "byteOffset": _Integer()}
_KIND = {"componentType": _Required(_Integer())}
_MEMBERS: Mapping[str, Any] = {
    "extensionsUsed": [str],
    "extensionsRequired": [str],
    "buffers": [{"byteLength": _Required(_Integer()), "uri": str}],
    "bufferViews": [
        {
            "buffer": _Required(_Index("buffers")),
            "byteOffset": _Integer(),
            "byteLength": _Required(_Integer()),
            "byteStride": _Integer(),
        }
    ],
    "accessors": [
        {
            "bufferView": _Index("bufferViews"),
            "byteOffset": _Integer(),
            **_KIND,
            "normalized": bool,
            "count": _Required(_Integer(1)),
            "type": _Required(str),
            "sparse": {
                "count": _Required(_Integer(1)),
                "indices": _Required(_ELEMENTS | _KIND),
                "values": _Required(_ELEMENTS),
            },
        }
    ],
    "meshes": [
        {
            "primitives": _Required(
                [
                    {
                        "attributes": _Required(
                            {"POSITION": _ACCESSOR}
                            | {f"JOINTS_{number}": _ACCESSOR for number in JOINT_SETS}
                            | {f"WEIGHTS_{number}": _ACCESSOR for number in JOINT_SETS}
                        ),
                        "indices": _ACCESSOR,
                        "mode": _Integer(0, 6),
                        "targets": [{"POSITION": _ACCESSOR}],
                    }
                ]
            ),
            "weights": _Numbers(),
        }
    ],
    "nodes": [
        {
            "mesh": _Index("meshes"),
            "skin": _Index("skins"),
            "weights": _Numbers(),
            "children": [_NODE],
            "matrix": _Numbers(16),
            "translation": _Numbers(3),
            "rotation": _Numbers(4),
            "scale": _Numbers(3),
            "extensions": {
                "EXT_mesh_gpu_instancing": {
                    "attributes": _Required(
                        {"TRANSLATION": _ACCESSOR, "ROTATION": _ACCESSOR, "SCALE": _ACCESSOR}
                    )
                },
                "KHR_node_visibility": {"visible": bool},
            },
        }
    ],
    "skins": [{"joints": _Required([_NODE]), "inverseBindMatrices": _ACCESSOR}],
    "scenes": [{"nodes": [_NODE]}],
    "scene": _Index("scenes"),
}
_IN_WORDS = {str: "a string", bool: "true or false"}


def read_document(text: memoryview) -> dict[str, Any]:
    """Return a glTF document whose members are of their types, and name only what is there.

    Parameters
    ----------
    text
        The document in JSON; members that are not read are not looked at.

    Raises
    ------
    InvalidMesh
        Naming the member, or an extension that the document requires and that is not read. Or the
        document is no JSON, has more than 32 MiB, or more than a million values.
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
    _Checker(tree).check(tree, _MEMBERS, "")
    for name in tree.get("extensionsRequired", []):
        if name not in _READ and not _NO_GEOMETRY.match(name):
            remedy = "uncompressed" if name in _COMPRESSIONS else "without it"
            raise InvalidMesh(
                f"the glTF document requires the extension {name[:60]!r}, which is not read; save "
                f"it {remedy}"
            )
    return tree


class _Checker:
    def __init__(self, document: Any) -> None:
        self._document = document
        self._values = 0

    def check(self, value: Any, expected: Any, place: str) -> None:
        self._values += 1
        if self._values > _MOST_VALUES:
            raise InvalidMesh(
                f"the glTF document has too many values; at most {_MOST_VALUES} can be read: put "
                "its data into the binary chunk"
            )
        match expected:
            case _Required(kind):
                self.check(value, kind, place)
            case {}:
                self._check_members(value, expected, place)
            case _Index(of):
                elements = self._document.get(of, [])
                if not isinstance(elements, list):
                    _refuse(elements, of, "a list")
                if not _is_integer(value, 0, len(elements) - 1):
                    _refuse(value, place, f"the number of one of {len(elements)} {of}")
            case _Integer(least, most):
                if not _is_integer(value, least, most):
                    _refuse(value, place, f"an integer, {least} to {most}")
            case _Numbers(length):
                if not isinstance(value, list) or not all(map(_is_number, value)):
                    _refuse(value, place, "a list of numbers")
                if length is not None and len(value) != length:
                    _refuse(value, place, f"a list of {length} numbers")
            case [item]:
                if not isinstance(value, list):
                    _refuse(value, place, "a list")
                for number, each in enumerate(value):
                    self.check(each, item, f"{place}[{number}]")
            case _:
                if not isinstance(value, expected):
                    _refuse(value, place, _IN_WORDS[expected])

    def _check_members(self, value: Any, expected: Mapping[str, Any], place: str) -> None:
        if not isinstance(value, dict):
            _refuse(value, place, "an object")
        for name, inner in expected.items():
            inside = f"{place}.{name}" if place else name
            if name in value:
                self.check(value[name], inner, inside)
            elif isinstance(inner, _Required):
                raise InvalidMesh(f"{inside} is missing in the glTF document")


def _is_integer(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or _is_integer(value, -(2**1023), 2**1023)


def _refuse(value: Any, place: str, expected: str) -> NoReturn:
    kind = type(value).__name__ if isinstance(value, dict | list) else repr(value)[:40]
    where = place or "the whole"
    raise InvalidMesh(f"{where} is {kind} in the glTF document; it must be {expected}")

"""Members of a glTF document that are read: each has its type, and points to what there is."""

from collections.abc import Mapping
from typing import Any, NamedTuple, NoReturn

from geodesic_core.errors import InvalidMesh

_MOST_VALUES = 1_000_000
"""Values of a document that are looked at; as many take a second"""


class _Index(NamedTuple):
    """The number of an element of one of the document's lists."""

    of: str


class _Numbers(NamedTuple):
    """A list of so many numbers."""

    length: int


class _Integer(NamedTuple):
    least: int


_MEMBERS: Mapping[str, Any] = {
    "buffers": [{"byteLength": _Integer(0), "uri": str}],
    "bufferViews": [
        {
            "buffer": _Index("buffers"),
            "byteOffset": _Integer(0),
            "byteLength": _Integer(0),
            "byteStride": _Integer(0),
            "extensions": {},
        }
    ],
    "accessors": [
        {
            "bufferView": _Index("bufferViews"),
            "byteOffset": _Integer(0),
            "componentType": _Integer(0),
            "count": _Integer(0),
            "type": str,
        }
    ],
    "meshes": [
        {
            "primitives": [
                {
                    "attributes": {"POSITION": _Index("accessors")},
                    "indices": _Index("accessors"),
                    "mode": _Integer(0),
                }
            ]
        }
    ],
    "nodes": [
        {
            "mesh": _Index("meshes"),
            "children": [_Index("nodes")],
            "matrix": _Numbers(16),
            "translation": _Numbers(3),
            "rotation": _Numbers(4),
            "scale": _Numbers(3),
        }
    ],
    "scenes": [{"nodes": [_Index("nodes")]}],
    "scene": _Index("scenes"),
}
"""Each list comes before what points into it."""
_REQUIRED = frozenset(
    {"attributes", "buffer", "byteLength", "componentType", "count"}
    | {"POSITION", "primitives", "type"}
)
"""Members that are there wherever they may be"""


def check_document(document: Any) -> None:
    """Refuse a glTF document whose members are not of their types, or name what is not there.

    Parameters
    ----------
    document
        The document; members that are not read are not looked at.

    Raises
    ------
    InvalidMesh
        Naming the member, or the document has more than a million values.
    """
    _Checker(document).check(document, _MEMBERS, "")


class _Checker:
    def __init__(self, document: Any) -> None:
        self._document = document
        self._values = 0

    def check(self, value: Any, expected: Any, place: str) -> None:
        self._values += 1
        if self._values > _MOST_VALUES:
            raise InvalidMesh(
                f"the GLB file's glTF document has too many values; at most {_MOST_VALUES} can be "
                "read: put its data into the binary chunk"
            )
        match expected:
            case {}:
                self._check_members(value, expected, place)
            case _Index(of):
                count = len(self._document.get(of, ()))
                if not _is_integer(value, 0) or value >= count:
                    _refuse(value, place, f"the number of one of {count} {of}")
            case _Integer(least):
                if not _is_integer(value, least):
                    _refuse(value, place, f"an integer, {least} or more")
            case _Numbers(length):
                if not isinstance(value, list) or len(value) != length or not _are_numbers(value):
                    _refuse(value, place, f"a list of {length} numbers")
            case [item]:
                if not isinstance(value, list):
                    _refuse(value, place, "a list")
                for number, each in enumerate(value):
                    self.check(each, item, f"{place}[{number}]")
            case _:
                if not isinstance(value, expected):
                    _refuse(value, place, "a string")

    def _check_members(self, value: Any, expected: Mapping[str, Any], place: str) -> None:
        if not isinstance(value, dict):
            _refuse(value, place, "an object")
        for name, inner in expected.items():
            inside = f"{place}.{name}" if place else name
            if name in value:
                self.check(value[name], inner, inside)
            elif name in _REQUIRED:
                raise InvalidMesh(f"{inside} is missing in the GLB file's glTF document")


def _is_integer(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _are_numbers(values: list[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _refuse(value: Any, place: str, expected: str) -> NoReturn:
    kind = type(value).__name__ if isinstance(value, dict | list) else repr(value)[:40]
    where = place or "the whole"
    raise InvalidMesh(f"{where} is {kind} in the GLB file's glTF document; it must be {expected}")

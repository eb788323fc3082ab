"""Accessors of a glTF document: arrays in its buffers."""

import base64
import binascii
from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Accessors:
    """Reader of the accessors of a checked document; those that bytes do not bear out are refused.

    The ``binary`` chunk is what the first buffer holds, if that names no other place. An accessor
    without bytes of its own, whose elements are zeros, may have at most ``most`` of them.
    """

    def __init__(self, tree: Mapping[str, Any], binary: memoryview, most: int) -> None:
        self._tree = tree
        self._binary = binary
        self._most = most
        self._buffers: dict[int, memoryview] = {}
        used = [*tree.get("extensionsUsed", ()), *tree.get("extensionsRequired", ())]
        self._is_quantized = "KHR_mesh_quantization" in used

    def count(self, number: int) -> int:
        """Return the number of elements that an accessor declares."""
        count: int = self._tree["accessors"][number]["count"]
        return count

    def floats(self, number: int, shape: str, what: str) -> Floats:
        """Return the elements of an accessor as numbers, (count, width).

        ``shape`` is the type that it must have, such as ``"VEC3"``; ``what`` names its content.
        """
        values, normalized = self._values(number, shape, what)
        if values.dtype.kind == "f":
            with np.errstate(invalid="ignore"):  # the mesh refuses what is not finite
                return values.astype(np.float64)
        if values.itemsize == 4 or not (normalized or self._is_quantized):
            refuse(number, f"{what} must be floats, or integers by KHR_mesh_quantization")
        if normalized:
            return np.maximum(values / np.iinfo(values.dtype).max, -1.0)
        return values.astype(np.float64)

    def integers(self, number: int, shape: str, what: str) -> NDArray[np.unsignedinteger[Any]]:
        """Return the elements of an accessor of unsigned integers, (count, width); see `floats`."""
        values, _ = self._values(number, shape, what)
        if values.dtype.kind != "u":
            refuse(number, f"{what} must be unsigned integers")
        return values

    def _values(self, number: int, shape: str, what: str) -> tuple[NDArray[Any], bool]:
        accessor = self._tree["accessors"][number]
        if accessor["type"] != shape:
            refuse(number, f"{what} must be of type {shape}")
        count, width = accessor["count"], _WIDTHS[shape]
        dtype = _dtype_of(number, accessor)
        if "bufferView" in accessor:
            values = self._rows(number, accessor, count, dtype, width)
        elif count > self._most:
            refuse(number, f"it declares {count} elements, but the file has {self._most} bytes")
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            places = _dtype_of(number, sparse["indices"])
            if places.kind != "u":
                refuse(number, "its sparse indices must be unsigned integers")
            at = self._rows(number, sparse["indices"], sparse["count"], places, 1)[:, 0]
            if at.max() >= count:
                refuse(number, f"a sparse index is {at.max()}, but it has {count} elements")
            values = values.copy()
            values[at] = self._rows(number, sparse["values"], sparse["count"], dtype, width)
        return values, accessor.get("normalized", False)

    def _rows(
        self, number: int, source: Mapping[str, Any], count: int, dtype: np.dtype[Any], width: int
    ) -> NDArray[Any]:
        """Return a view of (count, width) elements, which the bytes of a bufferView bear out."""
        view = self._tree["bufferViews"][source["bufferView"]]
        size = width * dtype.itemsize
        stride, start = view.get("byteStride", size), source.get("byteOffset", 0)
        if stride < size or start + stride * (count - 1) + size > view["byteLength"]:
            refuse(
                number,
                f"it has {count} elements of {size} bytes, {stride} apart, which do not fit into "
                f"bufferView {source['bufferView']}",
            )
        data = self._bytes_of_view(source["bufferView"])
        return np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))

    def _bytes_of_view(self, number: int) -> memoryview:
        view = self._tree["bufferViews"][number]
        if view["buffer"] not in self._buffers:
            self._buffers[view["buffer"]] = self._bytes_of_buffer(view["buffer"])
        buffer = self._buffers[view["buffer"]]
        start = view.get("byteOffset", 0)
        end = start + view["byteLength"]
        if end > len(buffer):
            raise InvalidMesh(
                f"bufferView {number} of the glTF document ends at byte {end} of a buffer of "
                f"{len(buffer)}"
            )
        return buffer[start:end]

    def _bytes_of_buffer(self, number: int) -> memoryview:
        buffer = self._tree["buffers"][number]
        uri = buffer.get("uri")
        if uri is None:
            held = self._binary if number == 0 else memoryview(b"")
        elif uri.startswith("data:"):
            try:
                text = uri.partition(";base64,")[2]
                held = memoryview(base64.b64decode(text, validate=True))
            except (binascii.Error, ValueError) as error:
                raise InvalidMesh(
                    f"buffer {number} of the glTF document is not valid base64"
                ) from error
        else:
            raise InvalidMesh(
                f"buffer {number} of the glTF document lies in another file, {uri[:60]!r}; embed "
                "it: save as .glb"
            )
        if len(held) < buffer["byteLength"]:
            raise InvalidMesh(
                f"buffer {number} of the glTF document declares {buffer['byteLength']} bytes, but "
                f"has {len(held)}"
            )
        return held[: buffer["byteLength"]]


def _dtype_of(number: int, source: Mapping[str, Any]) -> np.dtype[Any]:
    if source["componentType"] not in _TYPES:
        refuse(number, f"it has the unknown componentType {source['componentType']}")
    return np.dtype(_TYPES[source["componentType"]])


def refuse(number: int, why: str) -> NoReturn:
    """Refuse an accessor."""
    raise InvalidMesh(f"accessor {number} of the glTF document: {why}")

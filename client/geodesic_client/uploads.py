"""Bodies of uploads: a file, bytes, or arrays, which become a PLY file."""

from collections.abc import Callable, Iterator
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from geodesic_client.flow import Progress

Source = str | PathLike[str] | bytes | tuple[ArrayLike, ArrayLike]
"""The path of a mesh file, its bytes, or vertices (V, 3) and triangles (F, 3)"""

_BLOCK = 2**18


def format_of(mesh: Source, file_format: str | None) -> str:
    """Return the format of a mesh: as named, or by the end of its file's name."""
    if isinstance(mesh, tuple):
        return "ply"
    if file_format is not None:
        return file_format
    if isinstance(mesh, bytes):
        raise TypeError("give the format of these bytes, such as format='obj'")
    return Path(mesh).suffix.lower().removeprefix(".")


def name_of(mesh: Source, name: str | None) -> str | None:
    """Return what people call a mesh: as given, or the name of its file."""
    if name is None and isinstance(mesh, str | PathLike):
        return Path(mesh).name
    return name


def body_of(mesh: Source, progress: Progress) -> tuple[int, Callable[[], Iterator[bytes]]]:
    """Return the size of a mesh file in bytes, and what begins to read it."""
    data = ply_of(*mesh) if isinstance(mesh, tuple) else mesh
    size = len(data) if isinstance(data, bytes) else Path(data).stat().st_size

    def read() -> Iterator[bytes]:
        sent = 0
        with _opened(data) as file:
            while block := file.read(_BLOCK):
                yield block
                sent += len(block)
                progress(min(sent / size, 1.0))

    return size, read


def _opened(data: str | PathLike[str] | bytes) -> BinaryIO:
    return BytesIO(data) if isinstance(data, bytes) else Path(data).open("rb")


def ply_of(vertices: ArrayLike, faces: ArrayLike) -> bytes:
    """Return a binary PLY file of a triangle mesh, which holds every bit of its coordinates."""
    points = np.ascontiguousarray(vertices, "<f8")
    corners = np.asarray(faces)
    for name, array in (("vertices", points), ("faces", corners)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"{name} have the shape {array.shape}; it must be (…, 3)")
    if not np.issubdtype(corners.dtype, np.integer):
        raise ValueError(f"faces have the type {corners.dtype}; they must be integers")
    if corners.size and (corners.min() < 0 or corners.max() >= len(points)):
        raise ValueError(f"faces name vertices outside 0 to {len(points) - 1}")
    table: np.ndarray[Any, Any] = np.empty(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    table["count"], table["corners"] = 3, corners
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode() + points.tobytes() + table.tobytes()

"""VTK's files, legacy and XML, read by VTK itself in a process of its own."""

import importlib.util
import io
import json
import subprocess
import sys

import numpy as np

from geodesic_core.errors import InvalidMesh, MissingExtra
from geodesic_core.io import vtk_polygons
from geodesic_core.io.contents import FileContents, note_on_ignored
from geodesic_core.io.limits import check_face_count

_SECONDS, _BYTES_A_SECOND = 10, 1_000_000
"""Processor time that VTK may take: in any case, and for how many bytes a second more"""
_MEMORY, _MEMORY_OF_BYTE = 2 << 30, 200
"""Memory that VTK may take: in any case, of which its libraries take half, and for each byte"""


def read_vtk(data: bytes, max_faces: int | None) -> FileContents:
    """Read the polygons of a VTK file: a legacy one, or XML of one data set in any number of parts.

    The same reader reads all of them, as their content says what they are.

    Raises
    ------
    InvalidMesh
        The bytes are damaged, are no such file, or hold no polygons.
    TooManyFaces
        There are more faces than ``max_faces``.
    MissingExtra
        VTK is not installed.
    """
    if importlib.util.find_spec("vtkmodules") is None:
        raise MissingExtra("load_mesh of a VTK file", "vtk", "vtk")
    limits = _SECONDS + len(data) // _BYTES_A_SECOND, _MEMORY + _MEMORY_OF_BYTE * len(data)
    command = [sys.executable, "-P", vtk_polygons.__file__, *map(str, limits)]
    done = subprocess.run(command, input=data, capture_output=True, check=False)  # noqa: S603
    stream = io.BytesIO(done.stdout)
    if done.returncode:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = said[-1][:200] if said and done.returncode > 0 else "it crashed"
        raise InvalidMesh(
            f"VTK cannot read the file in {limits[0]} s and {limits[1] >> 20} MiB: {reason}"
        )
    answer = json.loads(stream.readline())
    if "error" in answer:
        raise InvalidMesh(f"the VTK file cannot be read: {answer['error']}")
    points, corners, sizes = (np.load(stream) for _ in range(3))
    if len(sizes) == 0:
        cells = ", ".join(f"{count} {name}" for name, count in answer["left_out"].items())
        raise InvalidMesh(
            f"the VTK file holds no polygons: it has {cells or 'no cells'}. Extract its surface "
            "first (PyVista: data.extract_surface())",
            kind="face",
        )
    check_face_count(int((sizes - 2).sum()), max_faces)
    return FileContents(points, corners, sizes, note_on_ignored("VTK", answer["left_out"]))

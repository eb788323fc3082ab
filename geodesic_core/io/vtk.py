"""VTK's files, legacy and XML, read by VTK itself in a process of its own."""

import importlib.util
import io
import json
import os
import subprocess
import sys

import numpy as np

from geodesic_core.errors import InvalidMesh, MissingExtra
from geodesic_core.io import vtk_polygons
from geodesic_core.io.contents import FileContents
from geodesic_core.io.limits import check_face_count

_SECONDS, _BYTES_A_SECOND = 9, 1_000_000
"""Time by the clock, from when its process has started: in any case, and bytes of a second more"""
_MEMORY, _MEMORY_OF_BYTE = 2 << 30, 200
"""Memory that VTK may take: in any case, of which its libraries take half, and for each byte"""


def read_vtk(data: bytes, max_faces: int | None) -> FileContents:
    """Read the polygons of a VTK file: a legacy one, or XML of one data set in any number of parts.

    The same reader reads all of them, as their content says what they are.
    """
    if importlib.util.find_spec("vtkmodules") is None:
        raise MissingExtra("load_mesh of a VTK file", "vtk", "vtk")
    seconds = _SECONDS + len(data) // _BYTES_A_SECOND
    memory = _MEMORY + _MEMORY_OF_BYTE * len(data)
    command = [sys.executable, "-P", vtk_polygons.__file__, str(seconds), str(memory)]
    refusal = f"VTK cannot read the file in {seconds} s and {memory >> 20} MiB"
    environment = {**os.environ, "GLIBC_TUNABLES": vtk_polygons.FILLED_MEMORY}
    pipe = subprocess.PIPE
    with subprocess.Popen(  # noqa: S603
        command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment
    ) as process:
        if process.stdout is not None:
            process.stdout.readline()  # `READY`, or it has ended
        try:
            answered, complaint = process.communicate(data, seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            raise InvalidMesh(f"{refusal}: it takes longer") from None
    if process.returncode:
        said = complaint.decode("utf-8", "replace").strip().splitlines()
        reason = said[-1][:200] if said and process.returncode > 0 else "it crashed"
        raise InvalidMesh(f"{refusal}: {reason}")
    stream = io.BytesIO(answered)
    answer = json.loads(stream.readline())
    if "error" in answer:
        what = answer["error"][:200]  # which may hold any part of the file
        raise InvalidMesh(f"the VTK file cannot be read: {what}")
    points, corners, sizes = (np.load(stream) for _ in range(3))
    read = FileContents(points, corners, sizes, answer["left_out"])
    if len(sizes) == 0:
        held = read.left_out_in_words() or "no cells"
        raise InvalidMesh(
            f"the VTK file holds no polygons: it has {held}. Extract its surface first (PyVista: "
            "data.extract_surface())",
            kind="face",
        )
    check_face_count(int((sizes - 2).sum()), max_faces)
    return read

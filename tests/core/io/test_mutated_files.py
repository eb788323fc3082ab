"""Mutated files of every format: a mesh comes of each, or a refusal that says where it is damaged.

With ``--full`` there are 2000 of each format, text and binary apart.
"""

import json
import logging
import re
import sys
import tracemalloc
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from random import Random
from types import FrameType
from typing import Any

import numpy as np
import pytest

from geodesic_core.errors import InvalidMesh
from geodesic_core.io.load import load_mesh
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from tests.support.mesh_files import ply_binary
from tests.support.mesh_seeds import SEEDS, glb_around, glb_parts, type_of
from tests.support.mutations import BYTES, IN_PLACE, TEXT, mutated, mutated_json

BATCHES, CASES = 80, 25

MOST_FACES = 1000
"""More are refused; without such a limit, a GLB file can show its parts any number of times."""
LEAST_BYTES, BYTES_OF_ONE = 300_000, 30
"""Memory that reading may take at a time, in any case and for each byte of the file"""
LEAST_CALLS, CALLS_OF_BYTE = 3_000, 4
"""Python functions that reading may call, in any case and for each byte of the file"""


def one_case(name: str, number: int) -> bytes:
    random = Random(f"{name} {number}")
    data = random.choice(SEEDS[name])
    match name:
        case "glb" if random.random() < 0.7:
            document, binary = glb_parts(data)
            return glb_around(mutated_json(random, json.loads(document)), binary)
        case "gltf" if random.random() < 0.7:
            return mutated_json(random, json.loads(data))
        case _ if name.startswith(("binary", "packed", "glb")):
            header, body = split_header(name, data)
            if name.startswith(("binary ply", "binary strips")) and random.random() < 0.4:
                return mutated(random, header, TEXT) + body
            return header + mutated(random, body, random.choice((BYTES, IN_PLACE)))
    return mutated(random, data, TEXT)


def split_header(name: str, data: bytes) -> tuple[bytes, bytes]:
    """Return the part that says what follows, and the rest, with the count of an STL file."""
    size = 0
    if name == "binary stl":
        size = 80
    elif type_of(name) == "ply":
        size = data.find(b"end_header\n") + len(b"end_header\n")
    return data[:size], data[size:]


@pytest.fixture(scope="module", autouse=True)
def everything_imported() -> None:
    """Have parsers imported and kernels loaded before memory is measured."""
    for name, seeds in SEEDS.items():
        for data in seeds:
            assert len(load_mesh(data, type_of(name), max_faces=MOST_FACES).faces) > 0


def read(data: bytes, kind: str) -> TriangleMesh | InvalidMesh:
    """Return what comes of a file, without a warning and without a line in the log."""
    with warnings.catch_warnings(record=True) as caught, capture_logging() as lines:
        warnings.simplefilter("always")  # as errors they would be taken for a parser's
        try:
            return load_mesh(data, kind, max_faces=MOST_FACES)
        except InvalidMesh as error:
            return error
        finally:
            assert not caught, caught[0].message
            assert not lines, lines[0]


@contextmanager
def capture_logging() -> Iterator[list[str]]:
    lines: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage())  # type: ignore[method-assign]
    logging.getLogger().addHandler(handler)
    try:
        yield lines
    finally:
        logging.getLogger().removeHandler(handler)


def check_work(data: bytes, kind: str) -> None:
    """Check that memory and calls are bounded by the size of the file."""
    most_bytes = LEAST_BYTES + BYTES_OF_ONE * len(data)
    most_calls = LEAST_CALLS + CALLS_OF_BYTE * len(data)
    # Memory is counted for the whole process, and another test's threads may just allocate.
    for _ in range(3):
        peak, calls = work_of(data, kind)
        if peak <= most_bytes:
            break
    assert peak <= most_bytes, f"{peak} bytes of memory"
    assert calls <= most_calls, f"{calls} calls"


def work_of(data: bytes, kind: str) -> tuple[int, int]:
    """Read a file; return the most bytes allocated at a time, and the calls of functions."""
    calls = 0

    def count(_frame: FrameType, event: str, _argument: Any) -> None:
        nonlocal calls
        calls += event == "call"

    tracemalloc.start()
    sys.setprofile(count)
    try:
        read(data, kind)
    finally:
        sys.setprofile(None)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    return peak, calls


def check_mesh(mesh: TriangleMesh) -> None:
    """Check that a mesh is sound, and that a file written of it gives it back to the bit."""
    assert mesh.vertices.dtype == np.float64
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.shape[1:] == (3,)
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    for array in (mesh.face_map, mesh.vertex_map):
        assert array is None or array.min() >= 0
    again = load_mesh(ply_binary(mesh.vertices, mesh.faces.tolist()), "ply")
    assert again.vertices.tobytes() == mesh.vertices.tobytes()
    assert again.faces.tobytes() == mesh.faces.tobytes()


def check_refusal(error: InvalidMesh) -> None:
    """Check that a refusal is one of ours, in one line: a reader's own words name no place."""
    message = str(error)
    assert "file is damaged: " not in message or "GII" in message, message  # nibabel's words
    assert "\n" not in message
    assert len(message) < 400, message
    assert error.kind in ("vertex", "face", "edge", "file")
    if re.match(r"(vertex|face|facet) \d", message):
        assert error.elements, message


def check_same(one: TriangleMesh | InvalidMesh, other: TriangleMesh | InvalidMesh) -> None:
    if isinstance(one, InvalidMesh):
        assert isinstance(other, InvalidMesh)
        assert (str(one), one.kind, one.elements) == (str(other), other.kind, other.elements)
        return
    assert isinstance(other, TriangleMesh)
    arrays = other.arrays()
    assert arrays.keys() == one.arrays().keys()
    assert all(array.tobytes() == arrays[name].tobytes() for name, array in one.arrays().items())
    assert one.warnings == other.warnings


@pytest.mark.slice(7)
@pytest.mark.parametrize(
    ("name", "batch"), [(name, batch) for name in SEEDS for batch in range(BATCHES)]
)
def test_a_mutated_file_gives_a_mesh_or_is_refused(name: str, batch: int) -> None:
    for number in range(batch * CASES, (batch + 1) * CASES):
        data = one_case(name, number)
        try:
            check_work(data, type_of(name))
            found = read(data, type_of(name))
            if isinstance(found, InvalidMesh):
                check_refusal(found)
            else:
                check_mesh(found)
            check_same(found, read(data, type_of(name)))
        except Exception as error:
            error.add_note(f"case {number} of {name}: {data[:2000]!r}")
            raise

"""Reader of meshes in JSON: ``{"vertices": [[x, y, z], …], "faces": [[i, j, k], …]}``.

``"lengths": [[a, b, c], …]``, of the edges of each face, may stand in place of the vertices, or
beside them.
"""

from typing import Any, NamedTuple

import numpy as np
import orjson
from numpy.typing import NDArray

from app.errors import Fault, ProblemError, pointer, problem

_ROWS = {
    "vertices": ("iuf", "three finite numbers"),
    "faces": ("iu", "three vertex indices"),
    "lengths": ("iuf", "three finite numbers"),
}
"""The members: which kinds of numbers they have, and of what each of their rows consists"""


class JsonMesh(NamedTuple):
    """The arrays of a mesh in JSON, (N, 3) each."""

    faces: NDArray[np.int64]
    vertices: NDArray[np.float64] | None
    lengths: NDArray[np.float64] | None
    """None where they are the distances of the vertices, which are there then"""


def read_json_mesh(body: bytes) -> JsonMesh:
    """Return the arrays of a mesh; `TriangleMesh` checks whether they make one."""
    try:
        document = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        raise problem("malformed_body", f"the body is not JSON: {error}") from error
    if not isinstance(document, dict):
        raise _invalid("", "an object with vertices and faces is expected")
    for name in document:
        if name not in _ROWS:
            raise _invalid(pointer(name), f"unknown field {name!r}")
    for name in ("faces", *([] if "lengths" in document else ["vertices"])):
        if name not in document:
            raise _invalid(pointer(name), f"{name} is missing")
    if b"true" in body or b"false" in body:  # which NumPy takes for 1 and 0
        for name in document:
            _refuse_booleans(name, document[name])
    found = {name: _rows(document, name, *_ROWS[name]) for name in _ROWS if name in document}
    vertices, lengths = (
        found[name].astype(np.float64) if name in found else None
        for name in ("vertices", "lengths")
    )
    return JsonMesh(found["faces"].astype(np.int64), vertices, lengths)


def _refuse_booleans(name: str, rows: Any) -> None:
    for i, row in enumerate(rows if isinstance(rows, list) else ()):
        if any(isinstance(value, bool) for value in (row if isinstance(row, list) else ())):
            raise _invalid(pointer(name, i), f"{name}[{i}] has a boolean, not a number")


def _rows(document: dict[str, Any], name: str, kinds: str, what: str) -> NDArray[Any]:
    rows = document[name]
    if not isinstance(rows, list):
        raise _invalid(pointer(name), f"{name} is not a list")
    array = _as_array(rows)
    if array.dtype.kind in kinds and array.ndim == 2 and array.shape[1] == 3:
        return array
    for i, row in enumerate(rows):
        values = _as_array(row)
        if values.dtype.kind not in kinds or values.shape != (3,):
            raise _invalid(pointer(name, i), f"{name}[{i}] is not {what}")
    raise _invalid(pointer(name), f"{name} is not a list whose items are {what} each")


def _as_array(rows: Any) -> NDArray[Any]:
    try:
        return np.array(rows)
    except (ValueError, OverflowError):  # ragged
        return np.array(None)


def _invalid(place: str, message: str) -> ProblemError:
    return problem("invalid_request", message, errors=(Fault(place, message),))
